"""User-defined experiment: the least preload that keeps a follower on its cam."""
