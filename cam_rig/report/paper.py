"""What the paper's report is made of: its files, and the studies that several sections share."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import replace
from functools import cached_property
from pathlib import Path

from cam_rig.dynamics import TwoMassParameters
from cam_rig.laws.cam import open_cam_set
from cam_rig.laws.segments import NAMED_RISES
from cam_rig.paper.contact.comparison import open_form_closed
from cam_rig.paper.factorial.design import Bench, open_factorial
from cam_rig.paper.factorial.study import FactorialResult, run_factorial
from cam_rig.paper.jump.comparison import JumpResult, find_jumps, references
from cam_rig.paper.noise.study import NoiseStudyResult, study_noise
from cam_rig.paper.readings.study import ReadingsResult, read_all
from cam_rig.paper.vibration.study import VIBRATION_RPM, VibrationResult, measure
from cam_rig.report.sections import read_recorded
from cam_rig.schema import Library, load_readings, load_rig, load_tables
from cam_rig.show.looks import in_words
from cam_rig.simulation.scene import open_scene

#: Cams of the contact study besides the paper's: other kinds of follower.
CONTACT_CAMS = ("flat", "oscillating_flat", "point")
#: Cams that move their follower both ways.
FORM_CLOSED = ("constant_breadth", "constant_diameter", "conjugate", "oscillating_conjugate")


class Paper:
    """Every file of the page, read and checked before anything runs, and what sections share.

    ``rig`` is that of the jump speeds, ``stiff`` that of the noise study, whose stem is the paper's
    Table 1; ``touching`` are the cams of the contact study, ``form_closed`` those that move their
    follower both ways. Other files than ``scene`` and ``rig`` are found beside it, or shipped.
    """

    def __init__(self, scene: Path, rig: Path, factorial: str, bag: Path | None) -> None:
        library = Library.beside(scene)
        self.tables = load_tables(library.path("published/tables", "paper"))
        self.loaded = open_scene(scene)
        cams = [library.path("cams", cam) for cam in self.tables.table_2_jump]
        self.cam_set = open_cam_set(cams, rig)
        self.parameters = TwoMassParameters.from_rig(self.cam_set.rig)
        self.asked = open_factorial(library.path("factorials", factorial))
        self.stiff = load_rig(library.path("rigs", self.asked.noise_rig))
        self.recorded = None if bag is None else read_recorded(bag, self.loaded)
        self.table_readings = load_readings(library.path("published/readings", "table2"))
        others = [library.path("cams", cam) for cam in CONTACT_CAMS]
        self.touching = open_cam_set([*cams, *others], rig)
        self.form_closed = open_form_closed(library.path("cams", cam) for cam in FORM_CLOSED)

    def begin(self, pool: Executor) -> None:
        """Begin the two long studies in the processes of a pool."""
        self._noise = pool.submit(study_noise, self.loaded, self.cam_set.rig)
        bench = Bench.of(self.asked, self.cam_set.rig, self.stiff)
        self._factorial = pool.submit(run_factorial, self.asked, bench, self.cam_set.laws)

    @cached_property
    def jumps(self) -> JumpResult:
        """Jump speeds beside the paper's."""
        return find_jumps(self.cam_set, references(self.cam_set, self.tables))

    @cached_property
    def readings(self) -> ReadingsResult:
        """Every reading of Table 2."""
        return read_all(self.table_readings, self.cam_set.cams, self.tables.table_2_jump)

    @cached_property
    def vibration(self) -> VibrationResult:
        """On the rig of the jump speeds."""
        return measure(self.cam_set, VIBRATION_RPM)

    @cached_property
    def stiff_vibration(self) -> VibrationResult:
        """On the stem of Table 1."""
        return measure(replace(self.cam_set, rig=self.stiff), VIBRATION_RPM)

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
        rigs = self.cam_set.rig, self.stiff
        soft, stiff = (rig.need("stem_stiffness", "the report").si for rig in rigs)
        return soft, stiff

    @property
    def proposed(self) -> str:
        """What the paper's own cam is called."""
        return self.cam_set.titles[self.asked.proposed]

    @property
    def titles(self) -> dict[str, str]:
        """What is called otherwise than by its name: rises, the readings of Table 2, cams."""
        rises = {name: in_words(name) for name in NAMED_RISES}
        readings = {name: name.replace("_", " ") for name in self.table_readings.readings}
        return rises | readings | self.cam_set.titles | self.loaded.titles
