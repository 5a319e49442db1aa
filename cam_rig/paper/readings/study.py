"""The readings of Table 2 as a result, and what they come to in a sentence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from cam_rig.arguments import checked
from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.paper.readings.readings import Read, ReadRow, read
from cam_rig.paper.readings.search import Found, ReadingSearch
from cam_rig.schema import CamConfig, TableReadings, load_cam, load_readings, load_tables
from cam_rig.schema.load import cam_path, readings_path, tables_path
from cam_rig.schema.published import PublishedJump
from cam_rig.show.result import NULL_PROGRESS, Column, Progress, Records, Result
from cam_rig.studies.jump.study import ROUNDED_TO


def _number(key: str, unit: str, shown: str, heading: str = "") -> Column:
    """A number of a reading, marked where it was identified from the table."""
    column = Column(key, unit, shown, heading, f"reading.{key}.si")

    def cell(one: Read) -> str:
        value, mark = column.display_cell(one), "*" if key in one.reading.fitted else ""
        return f"{value:{shown}}{mark}"

    return Column(key, unit, "", heading, column.of, cell)


class ReadCam(NamedTuple):
    """A cam on the rig of a reading."""

    read: Read
    row: ReadRow


@dataclass(frozen=True, repr=False)
class ReadingsResult(Result):
    """Readings of Table 2, each on every cam; what a search found, where there was one."""

    schema = "cam_rig.readings.1"
    columns: ClassVar = {
        "readings": (
            Column("reading", of="name"),
            _number("event", "°", ".1f", "event angle"),
            _number("high_dwell", "°", ".1f"),
            _number("stem_stiffness", "N/m", ".4g", "stem"),
            _number("roller_share", "", ".4g", "mass split"),
            _number("stem_damping", "N·s/m", ".4g"),
            _number("damping", "N·s/m", ".4g", "damping to ground"),
            _number("preload", "N", ".4g"),
            Column("fitted", "", "d", of=lambda one: len(one.reading.fitted)),
            Column("speeds", "", "d", "speeds that agree"),
            Column("times", "", "d", "times that agree"),
            Column("rms", "%", ".2f", "jump speeds, r.m.s."),
        ),
        "cams": (
            Column("reading", of="read.name"),
            Column("cam", of="row.cam"),
            Column("published_rpm", "rpm", "g", "paper", "row.printed.rpm"),
            Column("rpm", "rpm", "g", "first of the grid", "row.rpm"),
            Column("jump_rpm", "rpm", ".1f", "jump speed", "row.jump"),
            Column("published_time", "s", ".2f", "paper", "row.printed.time_s"),
            Column("time", "s", ".3f", of="row.time"),
            Column("time_at_jump", "s", ".3f", "at the jump + 1e-6", "row.at_limit"),
            Column("time_beyond", "s", ".3f", "+ 1e-3", "row.beyond"),
            Column("window", "rpm", ".2f", of="row.window"),
            Column("least_force", "N", "+.1f", of="row.force"),
        ),
        "search": (Column("trials"), Column("miss", "rpm", doc="of all cams together")),
    }

    found: tuple[Read, ...]
    searched: Found | None = None

    @property
    def widest(self) -> float:
        """The widest range of speeds (rpm) over which a printed time comes out."""
        return max(row.window for one in self.found for row in one.rows)

    @property
    def nearest(self) -> Read:
        """The reading whose jump speeds, at any speed, are nearest to the printed ones."""
        return min(self.found, key=lambda one: one.rms)

    def tables(self) -> list[Records]:
        """``readings``, their numbers and what agrees; ``cams``, a row of each; ``search``."""
        search = [] if self.searched is None else [self.searched]
        return [
            self.table(
                "readings",
                "Readings of the paper's Table 2: their numbers, and what they show of it",
                self.found,
                "* identified from the paper's Table 2. The others are given or assumed, with "
                "their sources in the readings' file.",
                "A speed agrees where it is the first of the grid with loss of contact, a time "
                "within half a turn, where the speed does.",
                "Jump speeds, r.m.s.: of those at any speed, also between those of the grid.",
            ),
            self.table(
                "cams",
                "Readings of the paper's Table 2: first loss of contact, looked at every "
                f"{ROUNDED_TO:g} rpm",
                (ReadCam(one, row) for one in self.found for row in one.rows),
                "Time: at the first speed of the grid, and above the jump speed by so much of it.",
                f"Window: over how many rpm, of {ROUNDED_TO:g} on either side of the printed "
                "speed, the printed time comes out within half a turn.",
                "Least force: of a run at the printed speed. Where it is positive, vibration would "
                "have to take it away.",
            ),
            self.table("search", "The search", search, hidden=True),
        ]

    def summary(self) -> list[str]:
        """What the readings come to."""
        fitted = ", ".join(
            f"{one.name} {one.speeds} of {len(one.rows)} speeds and {one.times} times with "
            f"{len(one.reading.fitted)} fitted"
            for one in self.found
        )
        near = self.nearest
        words = (
            f"{fitted}; jump speeds at any speed are nearest on {near.name}, "
            f"{100.0 * near.rms:.2f} % r.m.s.; a printed time comes out over {self.widest:.2g} of "
            f"{2 * ROUNDED_TO:g} rpm about its speed at most"
        )
        if self.searched is None:
            return [words]
        return [f"best of {self.searched.trials} trials, by the exact model:", words]


def read_all(
    known: TableReadings,
    cams: dict[str, CamConfig],
    printed: dict[str, PublishedJump],
    progress: Progress = NULL_PROGRESS,
) -> ReadingsResult:
    """Every reading on every cam of the table."""
    found = [
        read(name, known.readings[name], cams, printed, known.run_s)
        for name in progress.track(known.readings)
    ]
    return ReadingsResult(tuple(found))


#: Generations of a search, at most.
MOST_GENERATIONS = 10_000


@checked
def readings(
    *,
    search: str | None = None,
    with_times: bool = False,
    nearby: bool = False,
    generations: int = 60,
    seed: int = 1,
    progress: Progress = NULL_PROGRESS,
) -> ReadingsResult:
    r"""The paper's Table 2 read in several ways: which rig shows its speeds, and its times.

    The command is ``cam-rig readings``.

    Parameters
    ----------
    search : a reading whose identified numbers are sought anew, minutes; None reads all
    with_times, nearby : of a search: by the printed times too; contact need hold 5 rpm below each
        speed, no slower
    generations, seed : of a search: how long, up to 10 000, and of which random numbers
    progress : told how far it is

    Raises
    ------
    ConfigError : no such reading, or options of a search without one

    Examples
    --------
    >>> import cam_rig
    >>> found = cam_rig.readings()  # doctest: +SKIP
    >>> found.summary()  # doctest: +SKIP
    """
    if search is None and (with_times or nearby):
        raise ConfigError("--with-times, --nearby: are of a search; needed: --search NAME")
    if not (1 <= generations <= MOST_GENERATIONS and seed >= 0):
        raise ConfigError(
            f"generations: {generations}, seed: {seed}; allowed: 1 to {MOST_GENERATIONS}, and a "
            "seed of at least 0"
        )
    known, printed = load_readings(readings_path()), load_tables(tables_path()).table_2_jump
    cams = {cam: load_cam(cam_path(cam)) for cam in printed}
    if search is None:
        return read_all(known, cams, printed, progress)
    if search not in known.readings:
        raise ConfigError(
            f"--search: is {search!r}{did_you_mean(search, known.readings)}; allowed: "
            f"{', '.join(known.readings)}"
        )
    reading = known.readings[search]
    seek = ReadingSearch.of(reading, cams, printed, with_times, known.run_s, nearby)
    found = seek.best(generations, seed, progress)
    other = {key: getattr(reading, key).with_si(value) for key, value in found.numbers.items()}
    changed = reading.model_copy(update=other)
    return ReadingsResult((read(search, changed, cams, printed, known.run_s),), found)
