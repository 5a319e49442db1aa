"""Drawing board: a motion law with movable ordinates, and its evaluation."""
