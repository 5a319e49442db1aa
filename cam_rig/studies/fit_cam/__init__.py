"""Fit of a cam to gauge readings: a spline with exact dwells, or tangent arcs."""
