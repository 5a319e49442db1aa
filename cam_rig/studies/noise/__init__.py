"""Noise study of three cams: one calibrated, one predicted, one identified."""
