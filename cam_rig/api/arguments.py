"""What the functions of `import cam_rig` may be given: refused by the argument's name."""

from __future__ import annotations

from typing import Any

from cam_rig.errors import ConfigError


def require_type(argument: str, value: Any, kind: type, remedy: str) -> None:
    """Refuse an argument of another type.

    Raises
    ------
    ConfigError : with the argument, the value, and where one is had
    """
    if not isinstance(value, kind):
        shown = repr(value) if isinstance(value, str | int | float | None) else type(value).__name__
        raise ConfigError(f"{argument}: is {shown}; allowed: {remedy}")


def require_within(argument: str, value: Any, low: float, high: float, unit: str) -> None:
    """Refuse a number beyond its limits; NaN is beyond any.

    Raises
    ------
    ConfigError : with the argument, the value and the limits
    """
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (number and low <= value <= high):
        raise ConfigError(f"{argument}: is {value!r}; allowed: {low:g} to {high:g} {unit}")
