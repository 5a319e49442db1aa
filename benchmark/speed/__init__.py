"""Comparison of cam_rig with other ODE solvers: error and time on the same cases.

A case is a law, a speed, a model and output times. The solutions of a case by cam_rig, by each
other solver (peer) and with 50 digits (the stored reference) have the same form, so that the errors
are comparable.
"""

from __future__ import annotations
