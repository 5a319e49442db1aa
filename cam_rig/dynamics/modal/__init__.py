"""A follower with one mode on a turning cam: its least force at a speed, and where that is zero."""
