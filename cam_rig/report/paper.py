"""What the paper's report is made of: its files, and the studies that several sections share."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from cam_rig.dynamics import TwoMassParameters
from cam_rig.laws import Law
from cam_rig.laws.cam import CamSet, open_cam_set
from cam_rig.laws.segments import NAMED_RISES
from cam_rig.paper.contact.comparison import open_form_closed
from cam_rig.paper.factorial.design import Bench, FactorialConfig, open_factorial
from cam_rig.paper.factorial.study import FactorialResult, run_factorial
from cam_rig.paper.jump.comparison import JumpResult, find_jumps, references
from cam_rig.paper.noise.study import NoiseStudyResult, study_noise
from cam_rig.paper.readings.study import ReadingsResult, read_all
from cam_rig.paper.vibration.study import VIBRATION_RPM, VibrationResult, measure
from cam_rig.report.sections import Recorded, read_recorded
from cam_rig.schema import (
    CamConfig,
    Library,
    PublishedTables,
    RigConfig,
    TableReadings,
    load_readings,
    load_rig,
    load_tables,
)
from cam_rig.show.looks import in_words
from cam_rig.simulation.scene import LoadedScene, open_scene

#: Cams of the contact study besides the paper's: other kinds of follower.
CONTACT_CAMS = ("flat", "oscillating_flat", "point")

#: Cams that move their follower both ways.
FORM_CLOSED = ("constant_breadth", "constant_diameter", "conjugate", "oscillating_conjugate")


@dataclass(frozen=True)
class Sources:
    """Every file a report starts from, read and checked before anything runs.

    ``stiff`` is the rig of the noise study, whose stem is the paper's Table 1; ``touching`` the
    cams of the contact study, ``form_closed`` those that move their follower both ways.
    """

    cam_set: CamSet
    loaded: LoadedScene
    tables: PublishedTables
    factorial: FactorialConfig
    stiff: RigConfig
    recorded: Recorded | None
    readings: TableReadings
    touching: CamSet
    form_closed: list[tuple[CamConfig, Law]]


def open_sources(scene: Path, rig: Path, factorial: str, bag: Path | None) -> Sources:
    """Read every file of a report.

    Parameters
    ----------
    scene : of the noise study; the other files are found beside it, or shipped
    rig : file of the rig of the jump speeds
    factorial : name of the factorial study
    bag : a recording of the scene to compare with
    """
    library = Library.beside(scene)
    tables = load_tables(library.path("published/tables", "paper"))
    loaded = open_scene(scene)
    cams = [library.path("cams", cam) for cam in tables.table_2_jump]
    cam_set = open_cam_set(cams, rig)
    TwoMassParameters.from_rig(cam_set.rig)  # refused now rather than later
    config = open_factorial(library.path("factorials", factorial))
    return Sources(
        cam_set=cam_set,
        loaded=loaded,
        tables=tables,
        factorial=config,
        stiff=load_rig(library.path("rigs", config.noise_rig)),
        recorded=None if bag is None else read_recorded(bag, loaded),
        readings=load_readings(library.path("published/readings", "table2")),
        touching=open_cam_set(
            [*cams, *(library.path("cams", cam) for cam in CONTACT_CAMS)],
            rig,
        ),
        form_closed=open_form_closed(library.path("cams", cam) for cam in FORM_CLOSED),
    )


class Paper:
    """What several sections are made of; the two long studies run in processes of a pool."""

    def __init__(self, sources: Sources, pool: Executor) -> None:
        self.sources, self.cam_set, self.loaded = sources, sources.cam_set, sources.loaded
        self.parameters = TwoMassParameters.from_rig(self.cam_set.rig)
        self._noise = pool.submit(study_noise, self.loaded, self.cam_set.rig)
        self._factorial = pool.submit(_factorial, sources)

    @cached_property
    def jumps(self) -> JumpResult:
        """Jump speeds beside the paper's."""
        return find_jumps(self.cam_set, references(self.cam_set, self.sources.tables))

    @cached_property
    def readings(self) -> ReadingsResult:
        """Every reading of Table 2."""
        known = self.sources
        return read_all(known.readings, self.cam_set.cams, known.tables.table_2_jump)

    @cached_property
    def vibration(self) -> VibrationResult:
        """On the rig of the jump speeds."""
        return measure(self.cam_set, VIBRATION_RPM)

    @cached_property
    def stiff_vibration(self) -> VibrationResult:
        """On the stem of Table 1."""
        stiff = CamSet(self.cam_set.cams, self.cam_set.laws, self.sources.stiff)
        return measure(stiff, VIBRATION_RPM)

    @property
    def noise(self) -> NoiseStudyResult:
        """The noise study, once it is there."""
        return self._noise.result()

    @property
    def factorial(self) -> FactorialResult:
        """Continuity or slopes, once it is there."""
        return self._factorial.result()

    @property
    def stems(self) -> tuple[float, float]:
        """Stiffness (N/m) of the stem on the rig of the jump speeds, and of that of Table 1."""
        rigs = self.cam_set.rig, self.sources.stiff
        soft, stiff = (rig.need("stem_stiffness", "the report").si for rig in rigs)
        return soft, stiff

    @property
    def proposed(self) -> str:
        """What the paper's own cam is called."""
        return self.cam_set.titles[self.sources.factorial.proposed]

    @property
    def titles(self) -> dict[str, str]:
        """What is called otherwise than by its name: rises, the readings of Table 2, cams."""
        rises = {name: in_words(name) for name in NAMED_RISES}
        readings = {name: name.replace("_", " ") for name in self.sources.readings.readings}
        return rises | readings | self.cam_set.titles | self.loaded.titles


def _factorial(sources: Sources) -> FactorialResult:
    bench = Bench.of(sources.factorial, sources.cam_set.rig, sources.stiff)
    return run_factorial(sources.factorial, bench, sources.cam_set.laws)
