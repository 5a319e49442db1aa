"""Tests of the design sheet: its numbers, its remarks, and its page in print."""

import json
import math

import pytest

from cam_rig.report.command import page_made
from cam_rig.report.document import fill, render
from cam_rig.report.scene import SECTIONS, SceneStudies
from cam_rig.simulation.scene import load_scene

from ..conftest import scene_data

CAM = """
name: feeder
title: Press feeder
lift: {given: 24, unit: mm, source: order}
follower:
  type: roller
  base_radius: {given: 40, unit: mm, source: drawing}
  roller_radius: {given: 11, unit: mm, source: catalogue}
segments:
  - {law: dwell, span: {given: 40, unit: deg, source: press}}
  - {law: poly345, to: 1, span: {given: 110, unit: deg, source: press}}
  - {law: dwell, span: {given: 60, unit: deg, source: press}}
  - {law: poly4567, to: 0, span: {given: 150, unit: deg, source: press}}
"""
CONTACT = """
contact:
  face_width: {given: 14, unit: mm, source: drawing}
  youngs_modulus: {given: 206, unit: GPa, source: steel}
"""
RIG = """
name: press
title: Press slide
follower:
  mass: {given: 2.4, unit: kg, source: weighed}
  spring_stiffness: {given: 6.5, unit: N/mm, source: catalogue}
  damping: {assumed: 12, unit: N*s/m, source: free choice}
  preload: {given: 90, unit: N, source: drawing}
"""


@pytest.fixture
def studies(tmp_path):
    """Function that returns the studies of a press feeder at a speed, with a text added."""

    def of(rpm=180, cam=CAM, rig=RIG):
        scene = scene_data(
            name="feeder", cams=["feeder"], rig="press", model="kinetostatic", speeds=[120, rpm]
        )
        for folder, name, text in (
            ("cams", "feeder", cam),
            ("rigs", "press", rig),
            ("scenes", "feeder", json.dumps(scene)),
        ):
            (tmp_path / folder).mkdir(exist_ok=True)
            (tmp_path / folder / f"{name}.yaml").write_text(text, encoding="utf-8")
        return SceneStudies(load_scene(tmp_path / "scenes" / "feeder.yaml"), None)

    return of


def sheet_of(studies):
    """Return the only design sheet of the studies."""
    (sheet,) = SECTIONS[0].find(studies).values["sheets"].values()
    return sheet


def rows(table):
    """Return the rows of a table by their first cell."""
    return {row[0]: row[1:] for row in table.rows}


def test_peaks_are_those_of_the_formulas(studies):
    """Peaks at the working speed are those of the 3-4-5 rise, and of force and torque."""
    sheet = sheet_of(studies())
    assert sheet.rpm == pytest.approx(180.0)
    speed, rise, lift = 180.0 * math.pi / 30.0, math.radians(110.0), 0.024
    peaks = rows(sheet.tables["peaks"])
    assert peaks["velocity v [m/s]"][0] == pytest.approx(1.875 * lift * speed / rise)
    steepest = 10.0 / math.sqrt(3.0) * lift * (speed / rise) ** 2
    assert peaks["acceleration a [m/s²]"][0] == pytest.approx(steepest)
    assert peaks["jerk j [m/s³]"][0] == pytest.approx(60.0 * lift * (speed / rise) ** 3)
    assert peaks["contact force F [N]"][:4] == pytest.approx((90.0 + 6500.0 * lift, 150, 90, 0))
    row = next(row for row in studies().run.by_speed if row.rpm == 180.0)
    torque = peaks["torque F s′ [N·m]"]
    assert torque[0] == pytest.approx(row.peak_torque, rel=1e-4)
    assert torque[2] == pytest.approx(row.min_torque, rel=1e-4)


def test_results_and_origins(studies):
    """Margin, spring force and sizes follow from the files. A star marks assumed numbers."""
    sheet = sheet_of(studies())
    results, given = rows(sheet.tables["results"]), rows(sheet.tables["given"])
    assert results["margin, jump / working"][0] == pytest.approx(sheet.jump_rpm / 180.0)
    assert results["largest diameter"][0] == pytest.approx(2.0 * (40.0 + 24.0))
    assert results["largest diameter"][-1] == "computed"
    required, available = (
        results[f"spring force {name}"][0] for name in ("required", "available there")
    )
    assert results["spring force required"][-1] == "computed *"
    assert given["damping"] == (12.0, "N·s/m", "assumed")
    # at the jump speed the required force is the available force
    at_jump = sheet_of(studies(rpm=round(sheet.jump_rpm, 6)))
    results = rows(at_jump.tables["results"])
    force = results["spring force required"][0], results["spring force available there"][0]
    assert required < 0.2 * available
    assert at_jump.turn[1].min_force == pytest.approx(0.0, abs=1e-3) and force[0] < force[1] + 1.0
    certain = sheet_of(studies(rig=RIG.replace("assumed: 12", "given: 12")))
    assert rows(certain.tables["results"])["jump speed"][-1] == "computed"
    assert not certain.tables["results"].notes


def test_hertz_pressure_needs_width_and_material(studies):
    """Hertz pressure is on the sheet only if the cam file has face width and modulus."""
    without = sheet_of(studies())
    assert "Hertz pressure" not in rows(without.tables["results"])
    assert without.remarks == [
        "No Hertz pressure: contact.face_width, contact.youngs_modulus are not in the file of the "
        "cam."
    ]
    stated = sheet_of(studies(cam=CAM + CONTACT))
    assert 100.0 < rows(stated.tables["results"])["Hertz pressure"][0] < 1000.0
    assert rows(stated.tables["peaks"])["velocity v [m/s]"][-1] == "computed"  # without a star
    sure = sheet_of(studies(cam=CAM + CONTACT, rig=RIG.replace("assumed: 12", "given: 12")))
    results = rows(sure.tables["results"])  # the ratio of Poisson is assumed
    assert (results["Hertz pressure"][-1], results["jump speed"][-1]) == ("computed *", "computed")
    assert stated.remarks == [] and "face width" in rows(stated.tables["given"])


def test_remarks_on_lost_contact_and_failed_checks(studies):
    """A working speed above the jump speed, and a failed check, are remarks on the sheet."""
    fast = sheet_of(studies(rpm=600, cam=CAM + CONTACT))
    assert fast.remarks == [
        "The working speed is above the jump speed: the follower leaves the cam."
    ]
    small = CAM.replace("given: 40, unit: mm", "given: 4, unit: mm")
    remarks = sheet_of(studies(cam=small)).remarks
    assert remarks[0].startswith("Failed check: pressure angle is")


def test_sections_without_numbers_are_left_out(studies):
    """Vibration and sound of a rig of four numbers are left out, each with a line and a reason."""
    source = studies()
    contents = fill(SECTIONS, source, False)
    made = page_made("feeder.yaml", {"--out": "a.md"}, "B")
    page = render("md", "A page", made, contents, source)
    assert "Sound: Sound level left out: rig press has no radiation." in page
    assert "Residual vibration: rig press: follower.stem_stiffness: is missing" in page
    for heading in ("Residual vibration", "Sound"):
        assert f" {heading}\n" not in page
    assert "- Revision: B" in page and "feeder.dxf" in page and "--revision B" in made.command
    assert "paper" not in page


@pytest.mark.slow
def test_sheet_is_one_page_in_print(studies, chromium):
    """The sheet of a cam with Hertz pressure fits on the text of an A4 page, 180 mm × 271 mm."""
    source = studies(cam=CAM + CONTACT)
    contents = fill(SECTIONS[:2], source, True)
    made = page_made("feeder.yaml", {"--out": "a.html"})
    page = chromium.new_context(viewport={"width": 680, "height": 1024}).new_page()
    page.emulate_media(media="print")
    page.set_content(render("html", "A page", made, contents, source))
    assert page.evaluate("document.querySelector('.sheet').offsetHeight") < 271.0 / 25.4 * 96.0
    assert not page.locator("header").is_visible()
    assert page.pdf(prefer_css_page_size=True).count(b"/Type /Page\n") == 2
