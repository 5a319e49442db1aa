"""Least output over a run of a system with one vibration mode, and its first zero.

The output is, for example, the contact force of a follower.
"""
