"""The rig against the solvers one would otherwise pick: error and time on the same cases.

A case is a law, a speed, a model and output times. Its solution by the rig, by each peer and
by 50-digit arithmetic (stored in ``reference/``) are alike, so that one measure fits all.
"""

from __future__ import annotations
