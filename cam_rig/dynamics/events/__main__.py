"""Command that compiles the searches for lift-offs and landings with numba, in advance.

The compiled code is stored in the user's cache, so that later runs start without this delay.

Usage: ``python -m cam_rig.dynamics.events``
"""

from __future__ import annotations

from importlib.util import find_spec

from cam_rig.dynamics.events.backend import build, load

if __name__ == "__main__" and find_spec("numba") is not None and load() is None:
    build()
