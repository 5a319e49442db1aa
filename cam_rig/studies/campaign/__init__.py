"""Campaigns: many rigs that differ in some numbers, each measured alike, kept as rows."""

from __future__ import annotations
