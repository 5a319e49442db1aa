"""Noise study of three cams: one is calibrated, one predicted, and one identified."""
