"""Benchmarks of cam_rig: computing time, comparison with other solvers, accuracy."""
