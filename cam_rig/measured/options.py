"""Options that ``cam-rig fit cam`` and ``cam-rig new`` share."""

from __future__ import annotations

from enum import Enum
from typing import Annotated

import typer


class Shape(Enum):
    """What is laid through the readings."""

    spline = "spline"
    arcs = "arcs"


class OwnFollower(Enum):
    """Kind of follower that was read."""

    roller = "roller"
    flat = "flat"
    point = "point"


class OwnFlank(Enum):
    """What is known of the flanks of arcs."""

    straight = "straight"
    curved = "curved"


ShapeOption = Annotated[
    Shape,
    typer.Option(help="A smooth spline with exact dwells, or one contour of tangent arcs."),
]

FollowerOption = Annotated[
    list[OwnFollower] | None,
    typer.Option(
        help="Follower of the readings and of the cam's file; by default a roller, and with arcs "
        "the kind of each column is found. Of several columns once for the file alone, or once "
        "for each in their order."
    ),
]

FlankOption = Annotated[
    OwnFlank | None,
    typer.Option(
        help="Flanks of arcs that are known; by default straight where the readings do not rule "
        "it out."
    ),
]

ColumnOption = Annotated[
    str | None, typer.Option(help="Heading of the column of lifts, the only one that is read.")
]

ToleranceOption = Annotated[
    float | None,
    typer.Option(metavar="MM", help="Error of the gauge; by default the scatter of the readings."),
]

ReverseOption = Annotated[
    bool, typer.Option("--reverse", help="The cam was turned the other way: take -angle.")
]

RollerOption = Annotated[
    float | None, typer.Option(metavar="MM", min=0.0, help="Roller radius; by default assumed.")
]

BaseOption = Annotated[
    float | None, typer.Option(metavar="MM", min=0.0, help="Base radius; by default assumed.")
]
