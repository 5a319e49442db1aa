"""Pictures of runs that instruments saw."""

from __future__ import annotations
