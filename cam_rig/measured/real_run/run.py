"""A recorded run beside the model of a scene."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cam_rig.arguments import checked
from cam_rig.errors import BagError, ConfigError
from cam_rig.extras import libraries_named
from cam_rig.measured.real_run import tables
from cam_rig.measured.real_run.comparison import SpeedDeparture, compare_steps
from cam_rig.measured.real_run.pairs import RecordedPairs, pair_measured
from cam_rig.measured.real_run.tables import done, sentences
from cam_rig.show.result import notebook
from cam_rig.show.tables import DataTable
from cam_rig.simulation.scene import LoadedScene, load_scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame


@dataclass(frozen=True, eq=False, repr=False)
class RunComparison:
    """Where a recorded run and a model part.

    Parameters
    ----------
    source : the bag
    loaded : the scene whose model was driven with the cam angle of the bag
    speeds : a row each cam and speed: lift, force, lift-offs, level, measured and of the model
    notes : what was found in the bag and done to its readings, each a sentence
    """

    source: Path
    loaded: LoadedScene
    speeds: tuple[SpeedDeparture, ...]
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        return f"RunComparison({self.source}, {self.loaded.scene.name}: {len(self.speeds)} speeds)"

    @property
    def conclusions(self) -> tuple[str, ...]:
        """Where they part most, or that they agree; each a sentence."""
        return tuple(sentences(self.speeds))

    @property
    def tables(self) -> tuple[DataTable, DataTable]:
        """Lift and force; lift-offs and levels."""
        title = self.loaded.scene.title
        both = tables.departure_table, tables.event_table
        return both[0](self.speeds, title), both[1](self.speeds, self.loaded.calibrated)

    @property
    def every_number(self) -> DataTable:
        """All of both tables and more in one, SI units in the names of the columns."""
        return tables.every_number_table(self.speeds, self.loaded.scene.title)

    def plain(self) -> dict[str, Any]:
        """Every number with its unit in its name, and the sentences."""
        return tables.to_json(self.speeds, [*self.notes, *self.conclusions])

    def to_pandas(self) -> DataFrame:
        """A row each cam and speed, as `plain` has them."""
        with libraries_named():
            from pandas import DataFrame
        return DataFrame(self.plain()["speeds"])

    def plot(self) -> Figure:
        """Measured and model over one turn, and their difference, at up to three speeds a cam."""
        with libraries_named():
            from cam_rig.measured.real_run.figures import figure
        return notebook(figure(self.speeds, self.loaded.titles))


@checked
def compare_run(
    bag: str | Path,
    scene: str | Path | LoadedScene,
    *,
    topics: str | None = None,
    cam: str | None = None,
    namespace: str | None = None,
    offset_deg: float | None = None,
) -> RunComparison:
    """Drive a scene's model with the cam angle of a recorded run, and find where the two part.

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
    >>> found = cam_rig.compare_run("bags/golden", "quick", cam="tm21")
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
    """The rows of a bag of the rig, and what it lacks."""
    with libraries_named():
        from cam_rig.bag.measured_run import own_namespace, read_pressures, read_states
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
    lost = f"{pairs.lost} ticks have no samples in the bag: they are left out."
    return rows, [lost] if pairs.lost else []


def _measured(
    bag: Path, loaded: LoadedScene, topics: str, cam: str | None, offset_deg: float | None
) -> tuple[list[SpeedDeparture], list[str]]:
    """The rows of a bag of another program, and what was found and done."""
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
