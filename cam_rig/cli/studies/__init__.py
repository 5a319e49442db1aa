"""Commands that compare cams with the paper, or solvers with each other."""
