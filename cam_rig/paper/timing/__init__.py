"""When a cam has lifted its follower, and what moves that: the paper's own caveat."""
