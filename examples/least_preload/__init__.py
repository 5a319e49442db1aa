"""An experiment of one's own: the least preload that keeps a rigid follower on its cam."""
