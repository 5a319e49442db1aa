"""Campaigns: many rigs that differ in some numbers, measured in the same way."""

from __future__ import annotations
