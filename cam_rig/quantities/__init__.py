"""Quantities of a law on a rig, each defined once with its unit, title and value."""

from __future__ import annotations
