"""Headings of tables: quantity, factor and unit, or why a heading is unclear."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cam_rig.schema.headings import QUANTITIES, UNITS, parse_heading

DEGREE, TURN, INCH = math.pi / 180.0, 2.0 * math.pi, 0.0254
LIFTS = {
    1e-3: "Lift in millimeters|lift_mm|s / mm|Hub in mm, Einlass|ValveLiftMM|Stößelweg [mm]|"
    "Elevación (mm)|lift of A mm|Lift in (mm)|Millimeter Hub|alzata (millimetri)|levée millimètres|"
    "sollevamento camma mm",
    1e-2: "lift [cm]|Hub in Zentimeter",
    1e-5: "Hub [1/100 mm]|lift (mm/100)|Levée (centièmes de mm)|Hub in Hundertstel|"
    "divisions of 0.01 mm lift|lift (0,01 mm)",
    1e-6: "Lift x 10^-3 mm|Lift × 10⁻³ mm|lift (µm)|lift 1e-3 mm|Alzata (millesimi)|microns lift",
    INCH: 'lift_in|Lift (in)|lift "|pulgadas alzada|Lift in inches|lift (zoll)|levée en pouces',
    1e-3 * INCH: "Lift (0.001 in)|Lift in thousandths|Tappet lift (thou)|milésimas de pulgada|"
    'Lift (in/1000)|0.001" lift|thousandths of an inch lift|lift 1/1000 inch',
    INCH / 64.0: "Lift in/64|lift (inch/64)|lift 1/64 in",
    2e-4: "Lift mm/5|Lift (mm / 5)|lift 1/5 mm",
}
ANGLES = {
    DEGREE: "Cam deg|Angle (deg)|θ / °|Nockenwinkel in Grad|Ángulo de leva (grados)|angle [°]|"
    "Angle de came (degrés)|encoder angle (deg)|camAngle deg",
    1.0: "theta_rad|angle [rad]",
    TURN: "angle rev|phase [turns]|vueltas|turns [0..1]",
    TURN / 100.0: "cycle [%]|angle (percent)|Winkel in Prozent",
    TURN / 400.0: "angle gon",
    0.1 * DEGREE: "angle deg/10|Angle (1/10 deg)|Winkel [°/10]",
}
CRANK = (
    "Degrees from centerline (crank)|crank_deg|°KW|Grad Kurbelwinkel|deg CA|angle vilebrequin (°)|"
    "ángulo del cigüeñal (grados)|angolo manovella (gradi)|CAD [deg]|angolo albero motore (gradi)"
)
NEUTRAL = ["column 2", "Messuhr", "Dial gauge, intake", "A", "value", ""]
OTHERS = [
    *("lift error mm", "note", "force_N", "time [s]", "temperature", "comment", "foo"),
    *("Durchmesser (in)", "Diameter mm", "Dial indicator 0.001", "Force [N]"),
    *("Temp [°C]", "v (mm/s)"),
]
UNCLEAR = [
    *("lift [foo]", "Lift 2 mm", "Lift x 100 mm", "Lift (x10-3 mm)", "lift [%]", "angle [mm]"),
    *("lift (divisions)", "lift bob mm", "lift (mm*1000)", "Lift*1000 (mm)", "lift [mm] [in]"),
    *("lift in hundredths", "lift per degree (mm/deg)", "Hub mm x 10", "angle ATDC deg"),
    *("Lift per inch", "angolo motore (gradi)", "Lift (mm/s)", "lift in/s", "lift mm/s²"),
    *(
        "Lift mm/0",
        "Lift (mm/10 deg)",
        "Lift (mm) / 5",
        "lift mm s^-1",
        "angle deg/s",
        "Lift (-mm)",
    ),
]


@pytest.mark.parametrize(
    ("quantity", "table"), [("lift", LIFTS), ("angle", ANGLES)], ids=["lift", "angle"]
)
def test_headings_have_a_factor_and_a_unit(quantity, table):
    """Headings of lift or angle in several languages give their factor to SI.

    They contain factors, names of units and other words.
    """
    for factor, texts in table.items():
        for text in texts.split("|"):
            heading = parse_heading(text)
            assert (heading.quantity, heading.unclear, heading.is_crank) == (quantity, "", False), (
                text
            )
            assert heading.factor == pytest.approx(factor, rel=1e-12), text


def test_degrees_of_the_crank_are_recognised():
    """A heading of crank degrees gives an angle that is marked as of the crank."""
    for text in CRANK.split("|"):
        heading = parse_heading(text)
        assert (heading.quantity, heading.is_crank, heading.unclear) == ("angle", True, ""), text
        assert heading.factor == pytest.approx(DEGREE), text


def test_other_quantities_are_not_lifts():
    """A heading of another quantity, such as a radius or speed, is that quantity."""
    for text, quantity in (
        *((text, "other") for text in NEUTRAL),
        *(("radius_mm", "radius"), ("X (in)", "x"), ("y [mm]", "y"), ("encoder counts", "count")),
        *(("Drehzahl [1/min]", "speed"), ("dB(Z)", "level"), ("spring_N/m", "stiffness")),
    ):
        heading = parse_heading(text)
        assert (heading.quantity, heading.unclear) == (quantity, ""), text


def test_headings_of_no_quantity_are_unclear_unless_they_are_neutral():
    """A heading without a known quantity is unclear if it has a unit or foreign word.

    The reason names the foreign quantity first.
    """
    for text in OTHERS:
        assert parse_heading(text).quantity == "other", text
        assert parse_heading(text).unclear, text
    assert parse_heading("lift error mm").unclear.startswith("'error' is neither a word")


def test_unknown_words_factors_and_units_make_a_heading_unclear():
    """A heading with an unknown word, factor or unit is unclear.

    It could change the numbers.
    """
    for text in UNCLEAR:
        assert parse_heading(text).unclear, text


def test_a_unit_of_another_dimension_is_named_with_the_allowed_units():
    assert parse_heading("lift [deg]").unclear == (
        "'deg' is not a unit of length (m, cm, mm, um, in, thou)"
    )


@given(
    st.sampled_from(["lift", "Hub", "levée", "alzada", "alzata"]),
    st.sampled_from(sorted(UNITS["length"])),
    st.sampled_from([1.0, 0.5, 0.1, 0.01, 0.001]),
    st.sampled_from(["{} [{} {}]", "{} ({} {})", "{} / {} {}", "{}_{} {}"]),
)
def test_every_unit_has_its_factor_in_every_form(word, unit, factor, form):
    """A heading of lift with any unit, factor and form gives their product to SI."""
    heading = parse_heading(form.format(word, factor, unit))
    assert heading.unclear == ""
    assert heading.factor == pytest.approx(factor * UNITS["length"][unit], rel=1e-12)


@given(st.text(max_size=40))
def test_any_text_has_a_quantity(text):
    """Any text as a heading gives a known quantity and a positive factor or None."""
    heading = parse_heading(text)
    assert heading.quantity in QUANTITIES
    assert heading.factor is None or heading.factor > 0.0
