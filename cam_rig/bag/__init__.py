"""Recordings of runs in MCAP bags: writing, reading, comparison and recovery."""
