"""Parameter of a fitted contour with its 95 % interval, and its form in tables."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from cam_rig.units import round_to_error

#: Half the width of the 95 % interval of a normal distribution, in standard deviations.
NORMAL_95 = 1.96
#: Largest relative standard error of a parameter that counts as well identifiable. Its 95 %
#: interval then extends from a third of its value to five thirds.
MAX_RELATIVE_ERROR = 1.0 / 3.0


class Identifiability(StrEnum):
    """Result of the fit for a parameter: how well the readings determine it.

    A parameter that was fixed in the fit is given or assumed.
    """

    IDENTIFIABLE = "identifiable"
    POOR = "poorly identifiable"
    STRAIGHT = "straight not excluded"
    NOT_IDENTIFIABLE = "not identifiable"
    GIVEN = "given"
    ASSUMED = "assumed"


@dataclass(frozen=True)
class ParameterInterval:
    """Parameter of a contour (m or rad) with its 95 % interval.

    ``low`` and ``high`` are the ends of the interval. The interval of a flank radius can contain a
    straight flank (infinite radius). It then extends from the smallest convex radius, ``low``, over
    infinity to concave flanks (negative radius) up to ``high``, so that ``low`` is above ``high``.

    ``origin`` is "identified", or "given" or "assumed" for a fixed parameter, which has no
    interval. ``unit`` is the unit for display: mm or deg.
    """

    name: str
    value: float
    low: float
    high: float
    origin: str = "identified"
    unit: str = "mm"

    @property
    def is_fixed(self) -> bool:
        """True if the parameter was given or assumed, and so fixed in the fit."""
        return self.origin != "identified"

    @property
    def over_straight(self) -> bool:
        """True if the interval of a flank radius contains a straight flank."""
        return self.low > self.high

    @property
    def ends(self) -> tuple[float | None, ...]:
        """Limits of the interval for a table, four values in m or rad.

        The first two are its lower and upper end. They are None if the interval contains a straight
        flank. The others are then the smallest possible convex and concave radius, otherwise None.
        All are None if the parameter is fixed.
        """
        if self.is_fixed:
            return (None,) * 4
        if self.over_straight:
            return (None, None, self.low, -self.high)
        return (self.low, self.high, None, None)

    @property
    def error(self) -> float:
        """Standard error (m or rad) from the width of the interval.

        It is NaN if the width is not finite, if the parameter is fixed, or if the interval contains
        a straight flank.
        """
        if self.is_fixed or self.over_straight or not math.isfinite(self.high - self.low):
            return math.nan
        return (self.high - self.low) / (2.0 * NORMAL_95)

    @property
    def identifiability(self) -> Identifiability:
        """Class of the parameter: identifiable, poorly or not, given, or assumed.

        The relative error of an angle is not checked, because an angle can be 0.
        """
        if self.is_fixed:
            return Identifiability(self.origin)
        if self.over_straight or not math.isfinite(self.value):
            return Identifiability.STRAIGHT
        if not math.isfinite(self.error):
            return Identifiability.NOT_IDENTIFIABLE
        if self.unit == "mm" and self.error > MAX_RELATIVE_ERROR * abs(self.value):
            return Identifiability.POOR
        return Identifiability.IDENTIFIABLE

    @property
    def value_text(self) -> str:
        """Value as text with its unit, rounded to its standard error.

        A value without a standard error has four digits, or six if it is fixed. An infinite flank
        radius is "straight".
        """
        if not math.isfinite(self.value):
            return "straight"
        value = self._factor * self.value
        if math.isfinite(self.error):
            return f"{round_to_error(value, self._factor * self.error)} {self.unit}"
        return f"{value:.{6 if self.is_fixed else 4}g} {self.unit}"

    @property
    def interval_text(self) -> str:
        """95 % interval as text, empty for a fixed parameter."""
        if self.is_fixed:
            return ""
        low, high = self._end_text(self.low), self._end_text(self.high)
        if self.over_straight:
            convex = f"{low} {self.unit} convex" if 0.0 < self.low < math.inf else "any"
            concave = f"{high.lstrip('-')} {self.unit} concave" if self.high < 0.0 else "any"
            return f"{convex} over straight to {concave}"
        if not math.isfinite(self.high):
            return f"above {low} {self.unit}" if math.isfinite(self.low) else "any"
        start = f"{low} to" if math.isfinite(self.low) else "below"
        return f"{start} {high} {self.unit}"

    def _end_text(self, end: float) -> str:
        """Return an end of a parameter's interval as text in its display unit."""
        value, error = self._factor * end, self._factor * self.error
        if math.isfinite(error):
            return round_to_error(value, error)
        return f"{float(f'{value:.3g}'):g}"

    @property
    def _factor(self) -> float:
        """Factor from the SI unit of a parameter to its display unit."""
        return 1e3 if self.unit == "mm" else math.degrees(1.0)
