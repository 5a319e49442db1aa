"""Quantities of a law on a rig, each defined once with its unit, its title and its function.

Examples are the jump speed and the peak contact force. Designs and campaigns use them as goals,
limits and measures.
"""

from __future__ import annotations
