"""Campaigns: many rigs that differ in some numbers, each measured alike, kept as rows."""
