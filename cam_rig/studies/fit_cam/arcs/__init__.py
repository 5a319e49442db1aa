"""Tangent arcs through gauge readings: contour, search, intervals, selection and cam file."""
