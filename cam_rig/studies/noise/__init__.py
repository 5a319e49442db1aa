"""Noise study of three cams with published noise curves.

The acoustic constants are calibrated on one cam, the noise of the second is predicted, and the
geometry of the third is identified.
"""
