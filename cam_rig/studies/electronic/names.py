"""Names of targets, interpolations and types of numbers, as options and parameters."""

from typing import Literal

#: Names of the targets.
TargetName = Literal["codesys", "codesys_builder", "twincat", "twincat_mc3", "vdi2143", "table"]
#: Names of the interpolations.
InterpolationName = Literal["linear", "cubic", "spline", "sliding"]
#: Names of the types of numbers.
RoundingName = Literal["lreal", "real", "dint"]
