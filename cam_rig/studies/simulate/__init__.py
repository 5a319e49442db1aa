"""Simulated and recorded runs, with tables and figures of motion, force and sound."""
