"""The cam as fig. 12 of the paper draws it, a point's contour, and a roller that runs on it."""
