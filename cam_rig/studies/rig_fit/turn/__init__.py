"""One turn of a follower that comes back to itself, and what a force sensor shows of it."""
