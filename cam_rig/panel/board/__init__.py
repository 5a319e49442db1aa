"""Drawing board: a motion law whose curve a person changes, and its evaluation."""
