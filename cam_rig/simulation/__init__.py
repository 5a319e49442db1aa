"""Computation of samples and sound levels from a scene file, without ROS.

The nodes use the same classes.
"""
