"""From gauge readings to a cam: a spline with exact dwells, or a contour of tangent arcs."""
