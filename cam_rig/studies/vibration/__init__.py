"""Vibration of stem and shaft in steady state, as in the paper's experiments."""
