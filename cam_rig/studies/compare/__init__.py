"""A recorded run beside the model that was driven with the run's own cam angle."""

from __future__ import annotations
