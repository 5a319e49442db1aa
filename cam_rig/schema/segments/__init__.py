"""What may stand in a cam's ``segments``: one model a law, told apart by the key ``law``."""

from typing import Annotated

from pydantic import Field

from cam_rig.schema.segments.arcs import ArcsByCentres, ArcsByRadii, ArcSpec, TangentArcs
from cam_rig.schema.segments.curves import Bezier, BSpline, Polynomial, Trigonometric
from cam_rig.schema.segments.rise import Dwell, Rise
from cam_rig.schema.segments.table import Table

Segment = Annotated[
    Dwell
    | Rise
    | Bezier
    | BSpline
    | Polynomial
    | Trigonometric
    | TangentArcs
    | ArcsByRadii
    | ArcsByCentres
    | Table,
    Field(discriminator="law"),
]

__all__ = [
    "ArcSpec",
    "ArcsByCentres",
    "ArcsByRadii",
    "BSpline",
    "Bezier",
    "Dwell",
    "Polynomial",
    "Rise",
    "Segment",
    "Table",
    "TangentArcs",
    "Trigonometric",
]
