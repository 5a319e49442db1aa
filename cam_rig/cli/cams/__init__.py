"""Commands on one cam: its law and its contour."""
