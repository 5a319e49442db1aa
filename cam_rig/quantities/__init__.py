"""What may be asked of a law on a rig: each quantity once, with its unit, title and value."""

from __future__ import annotations
