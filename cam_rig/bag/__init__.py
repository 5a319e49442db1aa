"""Recordings: MCAP bags written, read, compared, recovered."""
