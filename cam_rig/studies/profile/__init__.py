"""Contours of cams: points, checks, figures and files."""
