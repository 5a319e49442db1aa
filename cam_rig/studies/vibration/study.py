"""Vibration of cams in steady state (figs. 4-6 and 9 of the paper), and what it claims of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import ClassVar

from cam_rig.arguments import checked
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics import vibration as steady
from cam_rig.dynamics.jump.any_follower import contact_lost_speed
from cam_rig.dynamics.torsional.model import from_rig as shaft_of
from cam_rig.dynamics.vibration import SteadyVibration, require_speeds
from cam_rig.laws.cam import CamSet
from cam_rig.schema.load import one_scene
from cam_rig.show.result import NULL_PROGRESS, Column, Footnote, Progress, Records, Result
from cam_rig.simulation.asked import (
    Cams,
    Rig,
    Speeds,
    asked_cams,
    asked_speeds,
    listed,
    scene_speeds,
)
from cam_rig.units import RPM

#: The cam that the paper proposes, and its two polynomials by degree.
PROPOSED, LOWER, HIGHER = "bezier15", "poly345", "poly4567"
#: What residual vibration may be measured by; the paper does not say which.
RESIDUAL = {"residual_amplitude": "residual amplitude", "peak_to_peak": "peak to peak"}
#: Speeds of the vibration tables, rpm: the first of the paper's laws jumps at 389 rpm.
VIBRATION_RPM = (200.0, 250.0, 300.0, 350.0)


@dataclass(frozen=True)
class Row:
    """A cam at a speed; the model, which keeps contact, holds to ``contact_lost_rpm``."""

    cam: str
    rpm: float
    measured: SteadyVibration
    contact_lost_rpm: float

    @property
    def contact_lost(self) -> bool:
        """Whether the follower would have left the cam."""
        return self.contact_lost_rpm < self.rpm


@dataclass(frozen=True)
class Claim:
    """A claim of the paper, and in how many of the speeds at which all keep contact it holds."""

    rig: str
    claim: str
    source: str
    holds: int
    cases: int
    measure: str = ""


CLAIMS = (
    Column("claim"),
    Column("source", heading="in the paper"),
    Column("measure", heading="measured by"),
    Column("rig"),
    Column("holds", cell=lambda x: f"{x.holds}/{x.cases}", doc="cases in which it holds"),
    Column("cases", doc="speeds at which every follower keeps contact", hidden=True),
)


@dataclass(frozen=True, repr=False)
class VibrationResult(Result):
    """Every cam at every speed, each speed (rpm) once, and the paper's claims of them."""

    schema = "cam_rig.vibration.1"
    plot_function = "cam_rig.studies.vibration.figures:figure"
    columns: ClassVar = {
        "vibration": (
            Column("cam"),
            Column("rpm", "rpm", "g"),
            Column("residual_amplitude", "µm", ".3g", of="measured.residual_amplitude"),
            Column("peak_to_peak", "µm", ".3g", of="measured.peak_to_peak"),
            Column("peak_acceleration", "m/s²", ".1f", of="measured.acceleration"),
            Column("law_acceleration", "m/s²", ".1f", "of the law", "measured.rigid_acceleration"),
            Column("twist", "°", ".4f", of="measured.twist"),
            Column("fluctuation", "%", ".2f", "flywheel", "measured.fluctuation"),
            Column("low_dwell", of="measured.window.dwell", hidden=True),
            Column("contact_lost", hidden=True),
            Column("contact_lost_rpm", "rpm", doc="the jump speed", hidden=True),
        ),
        "claims": CLAIMS,
    }
    notes = (
        Footnote(
            "No low dwell: read within 31.25° of the lowest lift, where the follower still moves.",
            lambda row: not row.measured.window.dwell,
            "*",
        ),
        Footnote(
            "Contact is lost below this speed; the model holds the follower on.",
            lambda row: row.contact_lost,
            "†",
        ),
        Footnote(
            "Flywheel: (fastest − slowest)/mean speed, driven by a constant torque.",
            lambda row: row.measured.fluctuation is not None,
        ),
    )

    cam_set: CamSet
    rows: tuple[Row, ...]

    @property
    def rpm(self) -> tuple[float, ...]:
        """The speeds."""
        return tuple(dict.fromkeys(row.rpm for row in self.rows))

    def at(self, rpm: float) -> dict[str, SteadyVibration]:
        """The measures at one of the speeds, by cam."""
        return {row.cam: row.measured for row in self.rows if row.rpm == rpm}

    @property
    def in_contact(self) -> list[float]:
        """The speeds at which all followers are on their cams."""
        lost = {row.rpm for row in self.rows if row.contact_lost}
        return [rpm for rpm in self.rpm if rpm not in lost]

    @property
    def claims(self) -> list[Claim]:
        """The paper's claims of vibration, at every speed at which all followers are on."""
        return list(_claims(self))

    def tables(self) -> list[Records]:
        """``vibration``, a row a cam and speed, and ``claims``."""
        caption = f"Steady-state vibration at {{rpm:g}} rpm, rig {self.cam_set.rig.name}"
        found = self.table("vibration", caption, self.rows, *self.notes, group_by="rpm")
        return [found, claims_table(self.claims, self.rpm)]

    def summary(self) -> list[str]:
        """At how many speeds no claim can be tested."""
        lost = len(self.rpm) - len(self.in_contact)
        words = f"contact is lost at {lost} of {len(self.rpm)} speeds: no claim is tested there"
        return [words] if lost else []


def claims_table(claims: Iterable[Claim], rpm: tuple[float, ...]) -> Records:
    """Claims tested at so many speeds (rpm), a row for each measure and rig."""
    speeds = ", ".join(f"{speed:g}" for speed in rpm)
    notes = (
        f"Cases: those of {speeds} rpm at which every follower keeps contact.",
        "The paper does not say how residual vibration is measured.",
    )
    return Records("claims", "The paper's claims, tested", CLAIMS, tuple(claims), notes)


@checked
def vibration(
    cams: Cams = None,
    rig: Rig = None,
    rpm: Speeds | None = None,
    *,
    progress: Progress = NULL_PROGRESS,
) -> VibrationResult:
    """Residual vibration in the low dwell, peak acceleration and twist of the shaft, settled.

    Eq. 5 and eq. 10 of the paper; the residual amplitude is of the free vibration that a law's
    joints excite.

    The command is ``cam-rig vibration``.

    Parameters
    ----------
    cams : a name, a path or a cam, or several; or one scene. None: the paper's Table 2
    rig : a name, a path or a rig; None: the scene's, or the only one beside the cams, else
        ``paper_table2``
    rpm : one or more, rpm; None: four of the scene's, or 200 to 350 rpm
    progress : told how far it is

    Raises
    ------
    ConfigError : an unknown cam, rig or scene, a rig without a stem, or a speed that is none

    Examples
    --------
    >>> import cam_rig
    >>> found = cam_rig.vibration(["poly345", "cycloidal"], rig="tm21", rpm=300)
    >>> found.to_pandas().cam.tolist()
    ['poly345', 'cycloidal']
    """
    cam_set, scene = asked_cams(cams, rig), one_scene(listed(cams))
    if rpm is None:
        rpm = VIBRATION_RPM if scene is None else scene_speeds(scene, len(VIBRATION_RPM))
    return measure(cam_set, asked_speeds(rpm), progress)


#: What is said to need a stem that the rig file leaves out.
BY = "the vibration of a mass on its stem"


def measure(
    cam_set: CamSet, rpm: Iterable[float], progress: Progress = NULL_PROGRESS
) -> VibrationResult:
    """Measure every cam at every speed (rpm), each speed once; twist where the rig has a shaft."""
    follower, rpm = FollowerParameters.on_stem(cam_set.rig, BY), list(dict.fromkeys(rpm))
    require_speeds(follower, rpm)
    shaft = None if cam_set.rig.shaft is None else shaft_of(cam_set.rig)
    rows: list[Row] = []
    for cam in progress.track(cam_set.laws):
        law = cam_set.laws[cam]
        lost = contact_lost_speed(law, cam_set.rig) / RPM
        rows += [
            Row(cam, one, steady.vibration(law, follower, shaft, one * RPM), lost) for one in rpm
        ]
    return VibrationResult(cam_set, tuple(rows))


Test = Callable[[dict[str, SteadyVibration]], bool]


def _claims(found: VibrationResult) -> Iterable[Claim]:
    cases = [found.at(rpm) for rpm in found.in_contact]

    def tested(claim: str, source: str, test: Test, measure: str = "") -> Claim:
        rig = found.cam_set.rig.name
        return Claim(rig, claim, source, sum(map(test, cases)), len(cases), measure)

    def least(measure: str) -> Test:
        return lambda at: min(at, key=lambda cam: getattr(at[cam], measure)) == PROPOSED

    def less(measure: str) -> Test:
        return lambda at: bool(getattr(at[HIGHER], measure) < getattr(at[LOWER], measure))

    cams = {row.cam for row in found.rows}
    if PROPOSED in cams:
        words = "Bézier 15 has the least peak acceleration"
        yield tested(words, "fig. 6", least("acceleration"))
        words = "Bézier 15 has the least residual vibration"
        for key, measure in RESIDUAL.items():
            yield tested(words, "fig. 5", least(key), measure)
        if all(row.measured.twist is not None for row in found.rows):
            yield tested("Bézier 15 has the least twist of the shaft", "fig. 9", least("twist"))
    if {LOWER, HIGHER} <= cams:
        words = "the polynomial of higher degree has less residual vibration"
        for key, measure in RESIDUAL.items():
            yield tested(words, "conclusions", less(key), measure)
