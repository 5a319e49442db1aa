"""A rig's numbers from what was measured on it."""

from __future__ import annotations
