"""Lift-offs and landings: the search for them, one source for plain Python and compiled."""
