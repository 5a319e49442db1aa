"""Design of cam motion laws that are best for a goal under limits.

Convex programs find the best law of a class and prove a bound that no law of the class exceeds.
"""

from __future__ import annotations
