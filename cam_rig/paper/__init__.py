"""What an experimenter does with the rig: programs, sweeps, comparisons, identification."""

from __future__ import annotations
