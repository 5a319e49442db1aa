"""Comparison of a recorded run with the model, driven with the recorded cam angle."""

from __future__ import annotations
