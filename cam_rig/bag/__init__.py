"""Recordings as MCAP bags: writing, reading, comparison and recovery."""
