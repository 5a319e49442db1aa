"""Numbers as a report writes them."""

from __future__ import annotations


def number(value: float, digits: int = 6) -> str:
    """A number in as few characters as it needs: 1.26e6, 0.05, 4030."""
    text = f"{value:.{digits}g}"
    if "e" not in text:
        return text
    mantissa, exponent = text.split("e")
    return f"{mantissa}e{int(exponent)}"
