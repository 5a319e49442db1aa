"""One style: what a journal prints, and nothing that a reader would stumble over.

Every command's figures are checked for the same faults where the command is tested (test/cli).
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

import cam_rig
from benchmark.speed import report as work_precision
from benchmark.speed.campaign import CampaignRate
from benchmark.speed.cases import CASES
from benchmark.speed.peers import PEERS
from benchmark.speed.study import CaseResult, Sweep, WorkPrecisionPoint, WorkPrecisionStudy
from cam_rig.dynamics.jump import figures as jump
from cam_rig.dynamics.jump.any_follower import JumpSpeed
from cam_rig.laws import Law
from cam_rig.laws import figures as law
from cam_rig.laws import figures as law_overlay
from cam_rig.laws.catalogue import families
from cam_rig.profile import figures as profile
from cam_rig.profile.check_table import check_cam
from cam_rig.schema import CamConfig, load_rig
from cam_rig.schema.load import config_root
from cam_rig.show.figure import WIDTH, empty, logarithmic, styled, write
from cam_rig.simulation import figures as motion
from cam_rig.simulation import figures as noise
from cam_rig.simulation.sound import SoundLevel
from cam_rig.units import RPM

from ..figure_faults import faults


@pytest.fixture(scope="module")
def drawn() -> dict[str, Figure]:
    """Figures of the library, one of each kind that no command's test writes, and some more."""
    cam = cam_rig.load_cam("poly345")
    curve, rig = cam_rig.build_law(cam), load_rig(config_root() / "rigs" / "paper_table2.yaml")
    run = cam_rig.simulate(curve, rig, model="two_mass", rpm=450, turns=2, sample_rate=4800)
    times = np.linspace(0.0, 360.0, 100)
    forces = [(rpm, times, rpm * np.cos(np.radians(times))) for rpm in (200.0, 300.0)]
    return {
        "motion": motion.motion_figure(run),
        "over the turn": motion.over_turn({"One": forces, "Another": forces}),
        "one cam": jump.figure(JumpSpeed(413.44 * RPM, 5.8, 0.1, curve, rig, 0.5)),
        "turn by turn": noise.turn_by_turn(SoundLevel(200.0, 85.0, 80.0 + np.arange(12.0), 2, "")),
        "law": law.figure(cam, curve),
        "rises": law_overlay.rises_figure(families().values()),
        "bench": work_precision.figure(work_precision.Comparison(_bench())),
    }


def _bench() -> WorkPrecisionStudy:
    """Six cases, every peer, errors over many decades."""
    points = [WorkPrecisionPoint(10.0**-k, 10.0 ** (2 * k - 14), None, 3, None) for k in range(4)]
    sweeps = [Sweep(peer, points) for peer in PEERS]
    results = {key: CaseResult(case(), points[-1], None, sweeps) for key, case in CASES.items()}
    return WorkPrecisionStudy(results, {}, True, 2, 1.0, CampaignRate(2, 100, 25.0))


@pytest.mark.long
def test_no_text_is_cut_or_small_or_on_another(drawn: dict[str, Figure]) -> None:
    """At 170 mm width all type is of 7 points or more, with a true minus and typeset powers."""
    assert {name: found for name, figure in drawn.items() if (found := faults(figure))} == {}


@pytest.mark.variants(1)
@pytest.mark.parametrize("name", ["arcs_straight", "oscillating_conjugate", "gunt_gl110"])
def test_profiles_and_laws_of_every_follower(
    name: str, cams: dict[str, CamConfig], laws: dict[str, Law]
) -> None:
    """Faces, arms, pairs, and a cam with negative lifts of its readings."""
    cam, curve = cams[name], laws[name]
    assert faults(profile.figure(cam, curve, check_cam(cam, curve))) == []
    assert faults(law.figure(cam, curve)) == []


@styled
def _bad() -> Figure:
    out = empty(2.0)
    left, right = out.subplots(1, 2)
    left.set(title="a title that is much too long for the half of a page " * 2)
    left.set_xticks([0.5, 0.51], ["first tick", "second tick"])
    right.set_xlabel("-1 and 1e6", fontsize=6.0)
    right.plot([], [], label="a legend wider than its panel, " * 3)
    right.legend(loc="upper right")
    return out


def test_a_faulty_figure_is_found() -> None:
    """Cut, overlapping, small, and what is not typeset: one line each."""
    found = "\n".join(faults(_bad()))
    for fault in (
        ": cut",
        "'first tick' on 'second tick'",
        ": 6 pt",
        ": not typeset",
        "legend on another",
    ):
        assert fault in found


def test_a_pdf_has_no_type_3_font(drawn: dict[str, Figure], tmp_path: Path) -> None:
    """Journals refuse them: TrueType outlines (type 42) are kept."""
    for name in ("law", "over the turn"):
        write(drawn[name], tmp_path / "a.pdf")
        data = (tmp_path / "a.pdf").read_bytes()
        assert b"/Type3" not in data and b"/FontFile2" in data, name


def test_a_png_has_200_dots_per_inch(drawn: dict[str, Figure], tmp_path: Path) -> None:
    """At the width of the page's text."""
    write(drawn["over the turn"], tmp_path / "a.png")
    assert Image.open(tmp_path / "a.png").width >= 200 * WIDTH - 1.0


def test_an_svg_repeats_and_is_of_lines(tmp_path: Path) -> None:
    """The same identifiers in it each time, and no picture of pixels."""
    for name in "ab":
        write(_bad(), tmp_path / f"{name}.svg")
    one, other = ((tmp_path / f"{name}.svg").read_text().split("<defs>", 1)[1] for name in "ab")
    assert one == other
    assert "<image" not in one


def test_what_matplotlib_is_set_to_stays(drawn: dict[str, Figure]) -> None:
    """The style holds while a figure is drawn or written, and nowhere else."""
    assert drawn and mpl.rcParams["pdf.fonttype"] == 3 and not mpl.rcParams["axes.grid"]


def test_logarithmic_ticks() -> None:
    """At 1, 3, 10 over few decades, at decades over many; powers beyond 1000 are typeset."""
    figure = empty(2.0)
    for top, shown in ((100.0, ["1", "3", "10", "30", "100"]), (1e6, ["1", "100", "10⁴"])):
        axes = figure.add_subplot()
        axes.set(yscale="log", ylim=(1.0, top))
        logarithmic(axes.yaxis)
        words = [axes.yaxis.get_major_formatter()(at) for at in axes.get_yticks() if 1 <= at <= top]
        assert set(shown) <= set(words)
        assert ("3" in words) == (top == 100.0)
        axes.remove()
