"""Figures of sound: levels over speed, the noise study, orders."""

from __future__ import annotations
