"""Simulated and recorded runs: tables and figures of motion, force and sound."""
