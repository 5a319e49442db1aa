"""A level's letter symbol as the microphone's parameters."""

from __future__ import annotations

from rclpy.parameter import Parameter


def weightings(quantity: str) -> list[Parameter]:
    """The parameters that make the microphone read a quantity: LAF, LZS."""
    return [
        Parameter("frequency_weighting", value=quantity[1]),
        Parameter("time_weighting", value=quantity[2]),
    ]
