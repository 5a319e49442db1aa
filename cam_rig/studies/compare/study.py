"""A recorded run beside the model of a scene."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from cam_rig.arguments import checked
from cam_rig.errors import BagError, ConfigError
from cam_rig.extras import libraries_named
from cam_rig.show.result import SI_UNITS, Column, Footnote, Records, Result
from cam_rig.show.tables import Cell
from cam_rig.simulation.scene import RELATIVE_NOTE, LoadedScene, load_scene
from cam_rig.studies.compare.comparison import SpeedDeparture, compare_steps, done, sentences
from cam_rig.studies.compare.pairs import RecordedPairs, pair_measured


def _departure(name: str, unit: str) -> tuple[Column, ...]:
    """How far one quantity departs, its noise where there is any, and a mark where they agree."""

    def noise(row: SpeedDeparture) -> Cell:
        found = getattr(row, name)
        return (
            None if row.exact or found is None else found.noise / SI_UNITS.get(unit, ("", 1.0))[1]
        )

    def mark(row: SpeedDeparture) -> Cell:
        found = getattr(row, name)
        return ("=" if row.exact else "*") if found is not None and found.within else None

    def angle(row: SpeedDeparture) -> float | None:
        found = getattr(row, name)
        return None if found is None else math.radians(found.degrees)

    return (
        Column(f"{name}_rms", unit, ".3g", f"{name} r.m.s.", f"{name}.rms"),
        Column(f"{name}_noise", unit, ".3g", "noise", f"{name}.noise", noise),
        Column(f"{name}_largest", unit, "+.3g", "largest", f"{name}.largest"),
        Column(f"{name}_largest_at", "°", ".0f", "at", angle),
        Column(f"{name}_within_noise", "", "", " ", f"{name}.within", mark),
    )


NOTES = (
    Footnote(
        "R.m.s. of all readings. Noise: scatter of the readings from turn to turn. Largest: of the "
        "mean over the turns, in parts of 2°. Forces within 0.5° of a jump of the model's are left "
        "out, such as at a landing: there they say when, as the other table does.",
        lambda row: not row.exact,
    ),
    Footnote(
        "*: within the noise, which explains all but half of itself at most.",
        lambda row: not row.exact,
    ),
    Footnote(
        "Sample by sample, driven with the recorded states of the cam.", lambda row: row.exact
    ),
    Footnote("=: equal to rounding.", lambda row: row.exact),
)
LATER = Footnote(
    "Events later by: the median, of lift-offs and landings that both have.",
    lambda row: row.contact is not None and row.contact.shift is not None,
)


@dataclass(frozen=True, eq=False, repr=False)
class RunComparison(Result):
    """Where a recorded run and a model part.

    ``source``: the bag; ``loaded``: the scene whose model was driven with its cam angle;
    ``speeds``: a row each cam and speed; ``notes``: what was found in the bag and done to its
    readings, each a sentence.
    """

    schema = "cam_rig.compare.1"
    plot_function = "cam_rig.studies.compare.figures:figure"
    columns: ClassVar = {
        "departures": (
            Column("cam"),
            Column("rpm", "rpm", ".5g", "speed"),
            Column("turns", "", ".3g"),
            *_departure("lift", "µm"),
            *_departure("force", "N"),
            Column("force_ringing", "Hz", hidden=True, of="peak_hz", doc="None: nothing rings"),
        ),
        "events": (
            Column("cam"),
            Column("rpm", "rpm", ".5g", "speed"),
            Column("lift_offs_measured", "1/turn", ".3g", "lift-offs measured", "contact.measured"),
            Column("lift_offs_model", "1/turn", ".3g", "model", "contact.model"),
            Column("events_later", "ms", "+.3f", "events later by", "contact.shift"),
            Column("events_later_angle", "°", "+.2f", "by", "later"),
            Column("contact_lost", "", "", "contact lost", "contact.rule"),
            Column("level_measured", "dB", ".1f", "level measured", "measured_db"),
            Column(
                *("level_model", "dB", ".1f", "model", "model_db"),
                cell=lambda row: None if row.measured_db is None else row.model_db,
            ),
            Column("level_difference", "dB", "+.2f", "difference"),
        ),
        "run": (
            Column("bag", of=lambda found: str(found.source)),
            Column("scene", of="loaded.scene.name"),
            Column("notes", doc="what was found in the bag and done to its readings"),
            Column("conclusions"),
        ),
    }

    source: Path
    loaded: LoadedScene
    speeds: tuple[SpeedDeparture, ...]
    notes: tuple[str, ...]

    @property
    def conclusions(self) -> tuple[str, ...]:
        """Where they part most, or that they agree; each a sentence."""
        return tuple(sentences(self.speeds))

    def tables(self) -> list[Records]:
        """Lift and force; lift-offs and levels; the run."""
        caption = f"{self.loaded.scene.title}: measured less model"
        relative = Footnote(
            RELATIVE_NOTE, lambda row: not self.loaded.calibrated and row.measured_db is not None
        )
        events = "Lift-offs and landings, sound level"
        return [
            self.table("departures", caption, self.speeds, *NOTES),
            self.table("events", events, self.speeds, LATER, relative),
            self.table("run", "The run", [self], single=True, hidden=True),
        ]

    def summary(self) -> list[str]:
        """What was done to the readings, and where run and model part."""
        return [*self.notes, *self.conclusions]


@checked
def compare(
    bag: str | Path,
    scene: str | Path | LoadedScene,
    *,
    topics: str | None = None,
    cam: str | None = None,
    namespace: str | None = None,
    offset_deg: float | None = None,
) -> RunComparison:
    """Drive a scene's model with the cam angle of a recorded run, and find where the two part.

    The command is ``cam-rig compare``.

    Parameters
    ----------
    scene : a name in ``config/scenes``, a path, or what `load_scene` gave
    topics : of a bag of another program, where the quantities are, as ``angle=/encoder.data:deg
        lift=/lvdt.data:mm``; a bag of the rig needs none
    cam : one cam; of a bag of another program the one that ran
    namespace : one rig of a bag that holds several
    offset_deg : cam angle less the encoder's; by default found from the lift

    Raises
    ------
    BagError : the bag cannot be read, or holds nothing to compare
    ConfigError : the scene has no such cam, or an argument does not fit the bag
    MissingLibraryError : the extra ``bags`` is not installed

    Examples
    --------
    >>> import cam_rig
    >>> found = cam_rig.compare("bags/golden", "quick", cam="tm21")
    >>> found.conclusions[1]
    'The force is that of the model, to rounding, at every speed.'
    """
    loaded = scene if isinstance(scene, LoadedScene) else load_scene(scene)
    if topics is None:
        if offset_deg is not None:
            raise ConfigError(
                f"offset {offset_deg:g}°: the rig's bags have exact angles; allowed: with --topics"
            )
        rows, notes = _recorded(Path(bag), loaded, cam, namespace)
    else:
        if namespace is not None:
            raise ConfigError(f"namespace {namespace}: --topics names whole topics; allowed: one")
        rows, notes = _measured(Path(bag), loaded, topics, cam, offset_deg)
    return RunComparison(Path(bag), loaded, tuple(rows), tuple(notes))


def _recorded(
    bag: Path, loaded: LoadedScene, cam: str | None, namespace: str | None
) -> tuple[list[SpeedDeparture], list[str]]:
    with libraries_named():
        from cam_rig.bag.measured_run import own_namespace, read_pressures, read_states
        from cam_rig.bag.partial_reader import recovered_words
        from cam_rig.bag.reader import read_ticks

    if cam is not None:
        loaded.law_of(cam)
    rig = own_namespace(bag, namespace)
    pairs = RecordedPairs(loaded, cam)
    steps = pairs.steps(read_ticks(bag, rig), read_states(bag, rig), read_pressures(bag, rig))
    rows = compare_steps(steps, loaded.laws)
    if not rows:
        what = "settled turn" if cam is None else f"settled turn of cam {cam}"
        raise BagError(f"{bag}: holds no {what} at a steady speed to compare; run one whole step")
    notes = recovered_words(bag)
    if pairs.lost:
        notes.append(f"{pairs.lost} ticks have no samples in the bag: they are left out.")
    return rows, notes


def _measured(
    bag: Path, loaded: LoadedScene, topics: str, cam: str | None, offset_deg: float | None
) -> tuple[list[SpeedDeparture], list[str]]:
    with libraries_named():
        from cam_rig.bag.foreign_topics import parse_topics
        from cam_rig.bag.measured_run import read_measured

    mapping = parse_topics(topics)
    there = list(loaded.laws)
    if cam is None and len(there) > 1:
        raise ConfigError(
            f"{loaded.scene_file}: has cams {', '.join(there)}; say with --cam which one ran"
        )
    known = cam or there[0]
    loaded.law_of(known)
    run = read_measured(bag, mapping, known)
    offset = None if offset_deg is None else math.radians(offset_deg)
    pairs = pair_measured(run, loaded, known, offset)
    return compare_steps(pairs.steps(), loaded.laws), [*run.notes, *done(pairs)]
