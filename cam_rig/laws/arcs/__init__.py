"""Tangent-arc cams: a contour of arcs and lines, and the law of a follower on it."""
