"""Comparison of a recorded run with the model of a scene: function and result."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from cam_rig.arguments import check_arguments
from cam_rig.errors import BagError, ConfigError
from cam_rig.extras import friendly_import_errors
from cam_rig.show.result import (
    SI_UNITS,
    Column,
    Footnote,
    Records,
    Result,
    subject_line,
)
from cam_rig.show.tables import Cell, format_number
from cam_rig.simulation.instruments import ReadingCount
from cam_rig.simulation.scene import RELATIVE_NOTE, LoadedScene, load_scene
from cam_rig.studies.compare.comparison import (
    AlignmentNumber,
    LargestDeviation,
    SpeedDeparture,
    alignment_numbers,
    common_frequency,
    compare_steps,
    largest_deviations,
    turn_warnings,
    warnings_of,
)
from cam_rig.studies.compare.pairs import RecordedPairs, pair_measured


def _departure_columns(name: str, unit: str) -> tuple[Column, ...]:
    """Return the table columns of one quantity: lift or force.

    They are the r.m.s. difference, the noise if there is any, the largest difference with its
    angle, and a mark if run and model agree.
    """

    def noise(row: SpeedDeparture) -> Cell:
        part = getattr(row, name)
        return None if row.exact or part is None else part.noise / SI_UNITS.get(unit, ("", 1.0))[1]

    def mark(row: SpeedDeparture) -> Cell:
        part = getattr(row, name)
        if part is None or not part.within:
            return "~" if part is not None and part.varies_by_turn else None
        return "=" if row.exact else "*"

    def angle(row: SpeedDeparture) -> float | None:
        part = getattr(row, name)
        return None if part is None else math.radians(part.degrees)

    return (
        Column(f"{name}_rms", unit, ".3g", f"{name} r.m.s.", f"{name}.rms"),
        Column(f"{name}_noise", unit, ".3g", "noise", f"{name}.noise", noise),
        Column(f"{name}_largest", unit, "+.3g", "largest", f"{name}.largest"),
        Column(f"{name}_largest_at", "°", ".0f", "at", angle),
        Column(f"{name}_within_noise", "", "", " ", f"{name}.within", mark),
    )


#: Footnotes of the table of lift and force. A footnote is printed only if its condition is true for
#: a row of the table.
NOTES = (
    Footnote(
        "R.m.s. of all readings. Noise: scatter of the readings from turn to turn. Largest: of the "
        "mean over the turns, per 2° of the turn. Forces within 0.5° of a jump of the model's "
        "force, such as a landing, are left out: they depend on its time, which the next table "
        "shows.",
        lambda row: not row.exact,
    ),
    Footnote(
        "*: within the noise. The systematic difference is at most half of the noise.",
        lambda row: not row.exact,
    ),
    Footnote(
        "Sample by sample, driven with the recorded states of the cam.", lambda row: row.exact
    ),
    Footnote("=: equal to rounding.", lambda row: row.exact),
    Footnote(
        "~: the model's turns differ from each other, because it bounces: compare the lift-offs "
        "instead of the curves.",
        lambda row: any(part is not None and part.varies_by_turn for part in (row.lift, row.force)),
    ),
)
#: Displayed unit of each quantity in tables whose rows have different units. Other quantities are
#: displayed in SI units.
DISPLAY_UNITS = {
    "lift": "µm",
    "lift_zero": "mm",
    "lift_hysteresis": "µm",
    "event_delay": "ms",
    "cam_angle_offset": "°",
    "angle_residual": "°",
    "sensor_stamp_delay": "ms",
    "sensor_clock_drift": "ppm",
    "uneven_speed": "%",
    "excluded_time": "%",
}


def _display_unit(row: LargestDeviation | AlignmentNumber) -> str:
    """Return the unit in which the quantity of a table row is displayed."""
    return DISPLAY_UNITS.get(row.quantity, row.unit)


def _value_cell(digits: str) -> Callable[[Any], Cell]:
    """Return a function that formats the value of a table row in its displayed unit.

    ``digits`` is a format such as ``.3g``. The function returns None for a missing value.
    """

    def cell(row: Any) -> Cell:
        if row.value is None:
            return None
        unit = _display_unit(row)
        factor = 1e-6 if unit == "ppm" else SI_UNITS.get(unit, ("", 1.0))[1]
        return format_number(row.value / factor, digits)

    return cell


#: Footnote of the table of lift-offs and landings that explains their delay.
LATER = Footnote(
    "Events later by: median of the lift-offs and landings that run and model have in common.",
    lambda row: row.contact is not None and row.contact.shift is not None,
)


@dataclass(frozen=True, eq=False, repr=False)
class RunComparison(Result):
    """Differences between a recorded run and a model.

    Attributes
    ----------
    source
        The bag of the run.
    loaded
        The scene whose model was driven with the recorded cam angle.
    speeds
        The differences, one element per cam and speed.
    notes
        Sentences on how the bag was read, and warnings.
    alignment
        Parameters by which the readings of a test bench were aligned with the cam. It is empty for
        a bag of the rig.
    counts
        Readings and skipped messages of each quantity. It is empty for a bag of the rig.
    """

    schema = "cam_rig.compare.1"
    plot_function = "cam_rig.studies.compare.figures:figure"
    columns: ClassVar = {
        "departures": (
            Column("cam"),
            Column("rpm", "rpm", ".5g", "speed"),
            Column("turns", "", ".3g"),
            *_departure_columns("lift", "µm"),
            *_departure_columns("force", "N"),
            Column("force_ringing", "Hz", hidden=True, of="peak_hz", doc="None without ringing"),
        ),
        "events": (
            Column("cam"),
            Column("rpm", "rpm", ".5g", "speed"),
            Column("lift_offs_measured", "1/turn", ".3g", "lift-offs measured", "contact.measured"),
            Column("lift_offs_model", "1/turn", ".3g", "model", "contact.model"),
            Column("event_delay", "ms", "+.3f", "event delay", "contact.shift"),
            Column("event_delay_angle", "°", "+.2f", "by", "later"),
            Column("contact_lost", "", "", "contact lost", "contact.rule"),
            Column("level_measured", "dB", ".1f", "level measured", "measured_db"),
            Column(
                *("level_model", "dB", ".1f", "model", "model_db"),
                cell=lambda row: None if row.measured_db is None else row.model_db,
            ),
            Column("level_difference", "dB", "+.2f", "difference"),
        ),
        "largest": (
            Column("quantity", cell=lambda row: row.quantity.replace("_", " ")),
            Column("value", heading="largest deviation", cell=_value_cell("+.3g")),
            Column("unit", cell=_display_unit),
            Column("rpm", "rpm", ".5g", "at"),
            Column("angle", "°", ".0f", "θ", doc="cam angle in the turn"),
            Column("relative", "%", ".3g", "of the range"),
            Column("agreeing", "", "d", "speeds that agree", doc="within noise, or rounding"),
            Column("speeds", "", "d", "of", doc="speeds at which it was measured"),
        ),
        "alignment": (
            Column("quantity", cell=lambda row: row.quantity.replace("_", " ")),
            Column("value", cell=_value_cell(".4g")),
            Column("unit", cell=_display_unit),
            Column("origin", of="origin.value"),
        ),
        "readings": (
            Column("quantity"),
            Column("source", doc="topic and field"),
            Column("readings", "", "d", doc="readings that were used"),
            Column("messages", "", "d", doc="messages of the topic"),
            Column("skipped", "", "d", doc="messages that gave no reading"),
        ),
        "run": (
            Column("bag", of=lambda comparison: str(comparison.source)),
            Column("scene", of="loaded.scene.name"),
            Column("force_ringing", "Hz", doc="of the force's deviation, equal at several speeds"),
            Column("notes", doc="how the bag was read, and warnings"),
        ),
    }

    source: Path
    loaded: LoadedScene
    speeds: tuple[SpeedDeparture, ...]
    notes: tuple[str, ...]
    alignment: tuple[AlignmentNumber, ...] = ()
    counts: tuple[ReadingCount, ...] = ()

    @property
    def subject(self) -> str:
        """Cams, rig and model of the scene."""
        return subject_line(self.loaded.laws, self.loaded.rig.name, self.loaded.scene.model)

    @property
    def force_ringing(self) -> float | None:
        """Frequency (Hz) at which the force deviates from the model at several speeds.

        It is None if there is no such frequency. It may be a resonance of the sensor or its mount.
        """
        return common_frequency(
            [row.rpm for row in self.speeds], [row.peak_hz for row in self.speeds]
        )

    def tables(self) -> list[Records]:
        """Return the tables of the comparison.

        They contain lift and force, events and sound levels, the largest deviations, the alignment,
        the readings, and the run.
        """
        caption = f"{self.loaded.scene.title}: measured less model"
        relative = Footnote(
            RELATIVE_NOTE, lambda row: not self.loaded.calibrated and row.measured_db is not None
        )
        events = "Lift-offs and landings, sound level"
        alignment = "How the readings were aligned with the cam"
        return [
            self.table("departures", caption, self.speeds, *NOTES),
            self.table("events", events, self.speeds, LATER, relative),
            self.table("largest", "Largest deviations", largest_deviations(self.speeds)),
            self.table("alignment", alignment, self.alignment, hidden=not self.alignment),
            self.table("readings", "Readings of each quantity", self.counts, hidden=True),
            self.table("run", "The run", [self], single=True, hidden=True),
        ]

    def summary(self) -> list[str]:
        """Return the notes, the number of speeds that agree, and any ringing of the force."""
        agreeing = sum(row.agrees for row in self.speeds)
        lines = [*self.notes, f"lift and force agree at {agreeing} of {len(self.speeds)} speeds"]
        if self.force_ringing is not None:
            lines.append(f"the deviation of the force rings at {self.force_ringing:.3g} Hz")
        return lines


@check_arguments
def compare(
    bag: str | Path,
    scene: str | Path | LoadedScene,
    *,
    topics: str | None = None,
    cam: str | None = None,
    namespace: str | None = None,
    offset_deg: float | None = None,
) -> RunComparison:
    """Compare a recorded run with a model driven with the recorded cam angle.

    The command is ``cam-rig compare``.

    Parameters
    ----------
    bag : str or Path
        Bag of the run.
    scene : str, Path or Scene
        Scene of the model: its name in ``config/scenes``, its path, or the result of `load_scene`.
    topics : str, optional
        Topic fields of the quantities in a bag of another program, such as
        ``angle=/encoder.data:deg lift=/lvdt.data:mm``. A bag of the rig must not have it.
    cam : str, optional
        Cam to compare. In a bag of another program it is the cam that was mounted.
    namespace : str, optional
        Namespace of the rig in a bag with several rigs.
    offset_deg : float, optional
        Cam angle minus encoder angle in degrees (default: identified from the lift).

    Returns
    -------
    RunComparison
        The differences, one row per cam and speed.

    Raises
    ------
    BagError
        If the bag cannot be read, or has no data to compare.
    ConfigError
        If the scene does not have the cam, or an argument does not fit the bag.
    MissingLibraryError
        If the extra ``bags`` is not installed.

    Examples
    --------
    >>> import cam_rig
    >>> found = cam_rig.compare("bags/golden", "quick", cam="tm21")
    >>> found.summary()
    ['lift and force agree at 4 of 4 speeds']
    """
    loaded = scene if isinstance(scene, LoadedScene) else load_scene(scene)
    if topics is None:
        if offset_deg is not None:
            raise ConfigError(
                f"an offset of {offset_deg:g}° requires --topics, because bags of the rig have "
                "exact angles"
            )
        return _compare_recording(Path(bag), loaded, cam, namespace)
    if namespace is not None:
        raise ConfigError("namespace cannot be combined with --topics, which has whole topic names")
    return _compare_bench(Path(bag), loaded, topics, cam, offset_deg)


def _compare_recording(
    bag: Path, loaded: LoadedScene, cam: str | None, namespace: str | None
) -> RunComparison:
    """Compare a bag of the rig, which contains the exact states of the cam."""
    with friendly_import_errors():
        from cam_rig.bag.measured_run import own_namespace, read_pressures, read_states
        from cam_rig.bag.partial_reader import recovery_notes
        from cam_rig.bag.reader import read_ticks

    if cam is not None:
        loaded.law_of(cam)
    rig = own_namespace(bag, namespace)
    pairs = RecordedPairs(loaded, cam)
    steps = pairs.steps(read_ticks(bag, rig), read_states(bag, rig), read_pressures(bag, rig))
    rows = compare_steps(steps, loaded.laws)
    if not rows:
        label = "" if cam is None else f" of cam {cam}"
        raise BagError(
            f"{bag} must contain a settled turn{label} at a steady speed; run one whole step"
        )
    notes = recovery_notes(bag)
    if pairs.lost:
        notes.append(f"{pairs.lost} ticks without samples in the bag are left out.")
    return RunComparison(bag, loaded, tuple(rows), tuple(notes))


def _compare_bench(
    bag: Path, loaded: LoadedScene, topics: str, cam: str | None, offset_deg: float | None
) -> RunComparison:
    """Compare a bag of another program, whose cam angle is measured by an encoder."""
    with friendly_import_errors():
        from cam_rig.bag.foreign.topic_line import parse_topics
        from cam_rig.bag.measured_run import read_measured

    mapping = parse_topics(topics)
    cams = list(loaded.laws)
    if cam is None and len(cams) > 1:
        raise ConfigError(f"{loaded.scene_file}: has cams {', '.join(cams)}; choose one with --cam")
    chosen = cam or cams[0]
    loaded.law_of(chosen)
    run = read_measured(bag, mapping, chosen)
    offset = None if offset_deg is None else math.radians(offset_deg)
    pairs = pair_measured(run, loaded, chosen, offset)
    rows = compare_steps(pairs.steps(), loaded.laws)
    notes = (*run.notes, *warnings_of(pairs), *turn_warnings(rows))
    if loaded.no_sound_note:
        notes += (loaded.no_sound_note,)
    alignment = tuple(alignment_numbers(pairs))
    return RunComparison(bag, loaded, tuple(rows), notes, alignment, run.counts)
