"""The paper's vibration experiment: stem and shaft in their steady states."""

from __future__ import annotations
