"""What the functions of `import cam_rig` may be given: refused by the argument's name."""

from __future__ import annotations

from typing import Any

from cam_rig.errors import ConfigError


def require_type(argument: str, value: Any, kind: type | tuple[type, ...], remedy: str) -> None:
    """Refuse an argument of another type.

    Raises
    ------
    ConfigError : with the argument, the value, and where one is had
    """
    if not isinstance(value, kind):
        shown = repr(value) if isinstance(value, str | int | float | None) else type(value).__name__
        raise ConfigError(f"{argument}: is {shown}; allowed: {remedy}")
