"""Comparison of the rig with common solvers: error and time on the same cases.

A case is a law, a speed, a model and output times. Its solutions by the rig, by each peer and by
50-digit arithmetic (stored in ``reference/``) have the same form, so that one measure fits all.
"""

from __future__ import annotations
