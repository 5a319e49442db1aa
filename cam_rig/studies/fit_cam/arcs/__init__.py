"""Fit of tangent arcs to gauge readings: contour, search, intervals and cam file."""
