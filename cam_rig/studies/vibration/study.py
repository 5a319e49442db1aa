"""Vibration of cams in steady state, and tests of the paper's claims (figs. 4-6 and 9)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from cam_rig.arguments import check_arguments
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics import vibration as steady
from cam_rig.dynamics.jump.any_follower import find_contact_loss_speed
from cam_rig.dynamics.torsional.model import from_rig as shaft_of
from cam_rig.dynamics.vibration import SteadyVibration, require_speeds
from cam_rig.laws.cam import CamSet
from cam_rig.schema.load import find_scene
from cam_rig.show.result import (
    NULL_PROGRESS,
    Column,
    Footnote,
    Progress,
    Records,
    Result,
    subject_line,
)
from cam_rig.simulation.inputs import (
    Cams,
    Rig,
    Speeds,
    resolve_cams,
    resolve_speeds,
    scene_speeds,
    to_cam_list,
)
from cam_rig.units import RPM, FloatArray

#: Name of the cam with the law that the paper proposes.
PROPOSED = "bezier15"
#: Name of the cam with the paper's polynomial law of lower degree.
LOWER = "poly345"
#: Name of the cam with the paper's polynomial law of higher degree.
HIGHER = "poly4567"
#: Displayed names of the two measures of residual vibration, by field of `SteadyVibration`. The
#: claims are tested with both, because the paper does not state which one it uses.
RESIDUAL = {"residual_amplitude": "residual amplitude", "peak_to_peak": "peak to peak"}
#: Default cam speeds, rpm. They are below the lowest jump speed of the paper's laws, 389 rpm.
VIBRATION_RPM = (200.0, 250.0, 300.0, 350.0)


@dataclass(frozen=True)
class Row:
    """Vibration of a cam at one speed.

    ``measured`` are the measures of the vibration. The model keeps contact, so it is valid only
    below the speed ``contact_lost_rpm`` at which the follower loses contact.
    """

    cam: str
    rpm: float
    measured: SteadyVibration
    contact_lost_rpm: float

    @property
    def contact_lost(self) -> bool:
        """True if the follower would lose contact at a lower speed than that of the row."""
        return self.contact_lost_rpm < self.rpm


@dataclass(frozen=True)
class Claim:
    """Claim of the paper, and the result of its test.

    It is tested at the ``cases`` speeds at which all followers keep contact, and is true at
    ``holds`` of them. ``source`` is its place in the paper. ``measure`` is the measure of residual
    vibration, empty for other quantities.
    """

    rig: str
    claim: str
    source: str
    holds: int
    cases: int
    measure: str = ""


@dataclass(frozen=True)
class SweepRow:
    """Residual amplitudes (m) of a cam over the speeds (rpm) of a sweep."""

    cam: str
    speeds: FloatArray
    amplitudes: FloatArray


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
    """Vibration of every cam at every speed, and tests of the paper's claims.

    ``rows`` has one element per cam and speed.
    """

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
        "sweep": (
            Column("cam"),
            Column("smallest", "µm", ".3g", of=lambda row: row.amplitudes.min()),
            Column(
                "quietest_rpm", "rpm", ".5g", "at", lambda row: row.speeds[row.amplitudes.argmin()]
            ),
            Column("largest", "µm", ".3g", of=lambda row: row.amplitudes.max()),
            Column(
                "loudest_rpm", "rpm", ".5g", "at", lambda row: row.speeds[row.amplitudes.argmax()]
            ),
            Column("speeds", hidden=True, doc="speeds of the sweep, rpm"),
            Column("amplitudes", "µm", hidden=True, doc="residual amplitudes at the speeds"),
        ),
    }
    notes = (
        Footnote(
            "No low dwell: measured within 31.25° of the lowest lift, where the follower moves.",
            lambda row: not row.measured.window.dwell,
            "*",
        ),
        Footnote(
            "Contact is lost below this speed; the model keeps the follower on the cam.",
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
    sweep: tuple[SweepRow, ...] = ()

    @property
    def subject(self) -> str:
        """Cams, rig and models: that of the stem, and with a shaft that of torsion."""
        rig = self.cam_set.rig
        model = "elastic_stem" if rig.shaft is None else "elastic_stem and torsional"
        return subject_line(self.cam_set.laws, rig.name, model)

    @property
    def rpm(self) -> tuple[float, ...]:
        """Distinct cam speeds in rpm."""
        return tuple(dict.fromkeys(row.rpm for row in self.rows))

    def at(self, rpm: float) -> dict[str, SteadyVibration]:
        """Return the vibration at one of the speeds of the result, by cam."""
        return {row.cam: row.measured for row in self.rows if row.rpm == rpm}

    @property
    def in_contact(self) -> list[float]:
        """Cam speeds in rpm at which all followers keep contact."""
        lost = {row.rpm for row in self.rows if row.contact_lost}
        return [rpm for rpm in self.rpm if rpm not in lost]

    @property
    def claims(self) -> list[Claim]:
        """Claims of the paper, each tested at the speeds with contact of all followers."""
        return list(_claims(self))

    def tables(self) -> list[Records]:
        """Return ``vibration``, with one row per cam and speed, ``claims``, and ``sweep``."""
        caption = f"Steady-state vibration at {{rpm:g}} rpm, rig {self.cam_set.rig.name}"
        table = self.table("vibration", caption, self.rows, *self.notes, group_by="rpm")
        caption = "Residual amplitude over the speeds of the sweep"
        sweep = [self.table("sweep", caption, self.sweep)] if self.sweep else []
        return [table, claims_table(self.claims, self.rpm), *sweep]

    def summary(self) -> list[str]:
        """Return a sentence with the number of speeds at which no claim is tested.

        It is empty if all followers keep contact at all speeds.
        """
        lost = len(self.rpm) - len(self.in_contact)
        text = f"contact is lost at {lost} of {len(self.rpm)} speeds: no claim is tested there"
        return [text] if lost else []


def claims_table(claims: Iterable[Claim], rpm: tuple[float, ...]) -> Records:
    """Return the table of tested claims, with one row per claim, measure and rig.

    ``rpm`` are the cam speeds, which a note lists.
    """
    speeds = ", ".join(f"{speed:g}" for speed in rpm)
    notes = (
        f"Cases: those of {speeds} rpm at which every follower keeps contact.",
        "The paper does not state how residual vibration is measured.",
    )
    return Records("claims", "The paper's claims, tested", CLAIMS, tuple(claims), notes)


@check_arguments
def vibration(
    cams: Cams = None,
    rig: Rig = None,
    rpm: Speeds | None = None,
    sweep: Speeds | None = None,
    *,
    progress: Progress = NULL_PROGRESS,
) -> VibrationResult:
    """Measure residual vibration, peak acceleration and twist in steady state.

    The models are eq. 5 and eq. 10 of the paper. The residual amplitude is that of the free
    vibration in the low dwell, which the joints of a law excite. The command is
    ``cam-rig vibration``.

    Parameters
    ----------
    cams : str, Path, Cam or sequence
        Cams as names, paths or results of `load_cam`, or one scene (default: the cams of the
        paper's Table 2).
    rig : str, Path or Rig
        Rig with a stem (default: that of the scene, or the only rig next to the cams, else
        ``paper_table2``).
    rpm : float or sequence
        Speeds in rpm (default: four speeds of the scene, or 200, 250, 300 and 350 rpm).
    sweep : float or sequence, optional
        Speeds in rpm of the residual amplitude over the speed, which the figure then shows
        (default: no sweep).
    progress : Progress
        Receiver of the progress.

    Returns
    -------
    VibrationResult
        Measures of every cam at every speed, and the paper's claims.

    Raises
    ------
    ConfigError
        A cam, rig or scene is unknown, the rig has a rigid stem, or a speed is out of range.

    Examples
    --------
    >>> import cam_rig
    >>> result = cam_rig.vibration(["poly345", "cycloidal"], rig="tm21", rpm=300)
    >>> result.to_pandas().cam.tolist()
    ['poly345', 'cycloidal']
    """
    cam_set, scene = resolve_cams(cams, rig), find_scene(to_cam_list(cams))
    if rpm is None:
        rpm = VIBRATION_RPM if scene is None else scene_speeds(scene, len(VIBRATION_RPM))
    result = measure(cam_set, resolve_speeds(rpm), progress)
    return result if sweep is None else replace(result, sweep=sweep_rows(cam_set, sweep))


def sweep_rows(cam_set: CamSet, rpm: Speeds) -> tuple[SweepRow, ...]:
    """Return the residual amplitudes of all cams over speeds in rpm."""
    follower, speeds = (
        FollowerParameters.on_stem(cam_set.rig, BY),
        np.array(resolve_speeds(rpm, "sweep")),
    )
    require_speeds(follower, speeds.tolist())
    return tuple(
        SweepRow(cam, speeds, steady.residual_vibration(law, follower, speeds * RPM))
        for cam, law in cam_set.laws.items()
    )


#: Name of the computation of this study in the error message for a rig without a stem.
BY = "the vibration of a mass on its stem"


def measure(
    cam_set: CamSet, rpm: Iterable[float], progress: Progress = NULL_PROGRESS
) -> VibrationResult:
    """Compute the vibration of every cam at every speed (rpm).

    Repeated speeds are computed once. The twist is included if the rig has a shaft.
    """
    follower, rpm = FollowerParameters.on_stem(cam_set.rig, BY), list(dict.fromkeys(rpm))
    require_speeds(follower, rpm)
    shaft = None if cam_set.rig.shaft is None else shaft_of(cam_set.rig)
    rows: list[Row] = []
    for cam in progress.track(cam_set.laws):
        law = cam_set.laws[cam]
        lost = find_contact_loss_speed(law, cam_set.rig) / RPM
        for speed in rpm:
            measured = steady.vibration(law, follower, shaft, speed * RPM)
            rows.append(Row(cam, speed, measured, lost))
    return VibrationResult(cam_set, tuple(rows))


ClaimTest = Callable[[dict[str, SteadyVibration]], bool]


def _claims(result: VibrationResult) -> Iterable[Claim]:
    """Yield the claims of the paper that the cams of the result can test."""
    cases = [result.at(rpm) for rpm in result.in_contact]

    def count(claim: str, source: str, test: ClaimTest, measure: str = "") -> Claim:
        rig = result.cam_set.rig.name
        return Claim(rig, claim, source, sum(map(test, cases)), len(cases), measure)

    def is_lowest(measure: str) -> ClaimTest:
        return lambda cams: min(cams, key=lambda cam: getattr(cams[cam], measure)) == PROPOSED

    def is_lower(measure: str) -> ClaimTest:
        return lambda cams: bool(getattr(cams[HIGHER], measure) < getattr(cams[LOWER], measure))

    cams = {row.cam for row in result.rows}
    if PROPOSED in cams:
        claim = "Bézier 15 has the least peak acceleration"
        yield count(claim, "fig. 6", is_lowest("acceleration"))
        claim = "Bézier 15 has the least residual vibration"
        for key, measure in RESIDUAL.items():
            yield count(claim, "fig. 5", is_lowest(key), measure)
        if all(row.measured.twist is not None for row in result.rows):
            yield count("Bézier 15 has the least twist of the shaft", "fig. 9", is_lowest("twist"))
    if {LOWER, HIGHER} <= cams:
        claim = "the polynomial of higher degree has less residual vibration"
        for key, measure in RESIDUAL.items():
            yield count(claim, "conclusions", is_lower(key), measure)
