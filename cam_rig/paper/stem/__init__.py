"""Where two masses stop being enough: a stem of n masses, and the bar that is their limit."""

from __future__ import annotations
