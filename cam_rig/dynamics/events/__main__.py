"""Command that compiles the searches for lift-offs and landings with numba, in advance.

The compiled code is stored in the user's cache, so that later runs start without this delay.

Usage: ``python -m cam_rig.dynamics.events``. The exit code is 1 if nothing can be compiled.
"""

from __future__ import annotations

import sys

from cam_rig.dynamics.events.backend import build, load


def main() -> int:
    """Build the compiled code unless it exists, and return 1 if it cannot be built."""
    try:
        return 0 if load() or (build() and load()) else 1
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main())
