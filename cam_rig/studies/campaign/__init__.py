"""Campaigns: the same quantities measured for many rigs with varied numbers."""

from __future__ import annotations
