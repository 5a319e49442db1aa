"""The best law of a class: convex programs in its ordinates, and the bounds that prove it."""

from __future__ import annotations
