"""Commands that compare cams with the paper, or solvers with each other."""

from __future__ import annotations
