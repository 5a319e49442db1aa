"""Benchmarks: cost of the rig, comparison with other solvers, and accuracy."""
