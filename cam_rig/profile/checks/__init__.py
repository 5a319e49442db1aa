"""The checks of a contour: undercut, curvature, pressure angle, reach, breadth."""
