"""Least output of a follower with one vibration mode, and its first zero."""
