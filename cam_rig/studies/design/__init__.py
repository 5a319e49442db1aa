"""Optimal laws of a class from convex programs, with proved bounds of the goal."""

from __future__ import annotations
