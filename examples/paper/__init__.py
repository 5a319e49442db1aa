"""Experiments on the published paper, with a script for each, and their report.

The paper compares cams by jump speed, vibration and noise. docs/theory.md explains the models.
"""
