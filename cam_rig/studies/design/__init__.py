"""Optimal laws of a class from convex programs, with proved bounds."""

from __future__ import annotations
