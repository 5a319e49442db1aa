"""The paper's noise experiment: calibrate on one cam, predict another, identify the third."""

from __future__ import annotations
