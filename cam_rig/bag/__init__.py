"""Recordings: the table of topics, MCAP writing and reading."""
