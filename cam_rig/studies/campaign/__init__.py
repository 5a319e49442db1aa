"""Campaigns: computation of the same measures for many rigs with varied numbers."""

from __future__ import annotations
