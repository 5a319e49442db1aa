"""Contours as files: DXF, SVG and CSV, written and read."""
