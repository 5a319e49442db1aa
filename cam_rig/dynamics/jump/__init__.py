"""Jump speed: the lowest cam speed at which a follower loses contact with the cam."""
