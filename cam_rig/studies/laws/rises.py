"""Results of ``cam-rig laws`` and of named rises: peaks and curves.

A named rise is a law from 0 to 1 over a span of 1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from cam_rig.arguments import check_arguments
from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.laws import catalogue
from cam_rig.laws.catalogue import all_families
from cam_rig.laws.families import FAMILIES
from cam_rig.laws.segments import NAMED_RISES, RISES
from cam_rig.schema.law_names import LAW_NAMES, MANUALS
from cam_rig.show.result import Column, Records, Result
from cam_rig.units import FloatArray


@dataclass(frozen=True)
class RiseRow:
    """Row of the table of laws: name, source and peak values.

    `figures` is None for a law whose peaks depend on the cam file.
    """

    law: str
    source: str
    figures: catalogue.Figures | None


#: Columns of the table of rises: name, source, peaks and continuity.
RISE_COLUMNS = (
    Column("law"),
    Column("source", heading="from, or by", doc="equation, or keys of the cam's file"),
    *(
        Column(f"peak_{order}", "", ".4f", order, f"figures.peak_{order}", missing="any")
        for order in ("velocity", "acceleration", "jerk")
    ),
    Column(
        "continuity",
        heading="joins",
        of="figures.continuity",
        cell=lambda row: "any" if row.figures is None else f"C{row.figures.continuity}",
        doc="order of the highest derivative without a jump",
    ),
)
#: Columns of the table of names.
NAME_COLUMNS = (
    Column("law"),
    Column("twincat", heading="TwinCAT"),
    Column("codesys", heading="CODESYS"),
    Column("siemens", heading="Siemens"),
    Column("other", heading="others"),
)
#: Caption of a table of rises.
CAPTION = "Peaks for unit rise and unit span"


def _rise_rows(names: Iterable[str]) -> list[RiseRow]:
    """Return the rows of named rises."""
    sources = {name: rise.source for name, rise in (NAMED_RISES | FAMILIES).items()}
    return [RiseRow(name, sources[name], catalogue.rise_figures(name)) for name in names]


@dataclass(frozen=True, repr=False)
class LawsResult(Result):
    """Named rises of one or all families, with their peaks.

    Parameters
    ----------
    families : tuple of RiseFamily
        The families.
    free : bool
        True if the laws whose peaks depend on the cam file are listed too.

    Examples
    --------
    >>> import cam_rig
    >>> cam_rig.list_laws("end").to_pandas().law.tolist()
    ['bezier4_end', 'bezier6_end', 'bezier8_end']
    """

    schema = "cam_rig.laws.1"
    plot_function = "cam_rig.studies.laws.figures:laws_figure"
    columns: ClassVar = {"laws": RISE_COLUMNS, "names": NAME_COLUMNS}

    families: tuple[catalogue.RiseFamily, ...]
    free: bool

    def tables(self) -> list[Records]:
        """Return `laws` in the order of the catalogue, and `names`, one row per law."""
        listed = {name for family in self.families for name in family.rises}
        rows = _rise_rows(name for name in RISES if name in listed)
        if self.free:
            free = catalogue.list_parametric_laws().items()
            rows += [RiseRow(name, keys or "the level before", None) for name, keys in free]
        names = [row for row in LAW_NAMES if row.law in listed or self.free]
        notes = (f"{manual}." for manual in MANUALS.values())
        caption = "Other names of laws, which files and commands accept"
        return [self.table("laws", CAPTION, rows), self.table("names", caption, names, *notes)]


def curve_column(key: str) -> Callable[[Any], Any]:
    """Return a function that reads the array ``key`` from the `curves` of a result."""
    return lambda result: result.curves[key]


#: Number of steps of u from 0 to 1 in the exported curve of a rise.
RISE_STEPS = 200
#: Names of the lift and its derivatives, by order.
QUANTITIES = ("lift", "velocity", "acceleration", "jerk")
#: Symbols of the lift and its derivatives, by order.
SYMBOLS = ("s", "s'", "s''", "s'''")


@dataclass(frozen=True, repr=False)
class RisesResult(Result):
    """Named rises of unit lift over a unit span, with curves and peaks.

    Parameters
    ----------
    names : tuple of str
        Names of the rises.
    """

    schema = "cam_rig.law_rises.1"
    plot_function = "cam_rig.studies.laws.figures:rises_result_figure"
    columns: ClassVar = {
        "curves": (
            Column("rise", of=curve_column("rise")),
            Column("u", of=curve_column("u"), doc="fraction of the span"),
            *(
                Column(key, of=curve_column(key), doc="for unit rise and unit span")
                for key in QUANTITIES
            ),
        ),
        "laws": RISE_COLUMNS,
    }

    names: tuple[str, ...]

    @property
    def labels(self) -> list[str]:
        """Words for the default file name of the figure: "rises", then the rises' names."""
        return ["rises", *self.names]

    @cached_property
    def curves(self) -> dict[str, Any]:
        """Columns of the exported table of curves by name, one rise after the other."""
        u = np.linspace(0.0, 1.0, RISE_STEPS + 1)
        motion = np.hstack([catalogue.rise_values(name, u) for name in self.names])
        rises = np.repeat(self.names, u.size)
        return {"rise": rises, "u": np.tile(u, len(self.names))} | by_order(motion)

    def tables(self) -> list[Records]:
        """Return the table `curves`, and the table `laws` with one row per rise."""
        return [self.array_table("curves"), self.table("laws", CAPTION, _rise_rows(self.names))]


def by_order(motion: FloatArray) -> dict[str, FloatArray]:
    """Return lift, velocity, acceleration and jerk by name.

    ``motion`` contains them as rows, shape ``(4, n)``.
    """
    return dict(zip(QUANTITIES, motion, strict=True))


@check_arguments
def list_laws(family: str | None = None) -> LawsResult:
    """List the laws by name with their peaks per unit rise and unit span.

    The table also has the continuity at the ends of each rise, and another table has the names of
    laws in controllers. The command is ``cam-rig laws``.

    Parameters
    ----------
    family : str, optional
        Family of rises: ``polynomial``, ``start`` or ``end`` (half-rises), ``classical``,
        ``handbook`` or ``motion`` (default: all laws).

    Returns
    -------
    LawsResult
        One row per law.

    Raises
    ------
    ConfigError
        The family is unknown.

    Examples
    --------
    >>> import cam_rig
    >>> table = cam_rig.list_laws("polynomial").to_pandas()
    >>> table.law.tolist()[:2]
    ['poly345', 'poly4567']
    """
    by_name = all_families()
    if family is None:
        return LawsResult(tuple(by_name.values()), free=True)
    if family not in by_name:
        hint = did_you_mean(family, by_name)
        raise ConfigError(f"--family must be one of {', '.join(by_name)}, got {family!r}{hint}")
    return LawsResult((by_name[family],), free=False)
