"""Vibration of stem and shaft in steady state, the paper's vibration experiment."""
