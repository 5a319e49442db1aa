"""Segments that describe no curve: each is told which number, and what is allowed."""

import pytest

HEAD = """
name: wrong
title: wrong
lift: {assumed: 10, unit: mm}
follower: {type: point, base_radius: {assumed: 25, unit: mm}}
segments:
"""
TURN = "span: {assumed: 360, unit: deg}"


def ratio(*numbers):
    return f"{{assumed: {list(numbers)}, unit: '1'}}"


def spline(degree, knots, ordinates):
    shape = f"degree: {degree}, knots: {ratio(*knots)}, ordinates: {ratio(*ordinates)}"
    return f"- {{law: b_spline, {TURN}, {shape}}}"


def polynomial(at, order, value, unit="deg"):
    shape = f"at: {{assumed: {at}, unit: {unit}}}, order: {order}, value: {ratio(*value)}"
    return f"- {{law: polynomial, {TURN}, {shape}}}"


CASES = [
    (spline(3, [0, 0, 0, 1, 1, 1], [0, 1, 0]), "ordinates: are 3; allowed for degree 3: 4 to"),
    (spline(3, [0, 0, 0, 0, 1, 1, 1, 1], [0, 1, 1, 0]), "knots: are 8; allowed for 4 ordinates"),
    (spline(2, [0, 0, 1, 0.5, 2, 2], [0, 0, 1, 0, 0]), "knot 4 is 0.5 after 1; allowed: rising"),
    (spline(2, [0, 0.5, 1, 1], [0, 1, 0]), "knots: 0 stands 1 times; allowed: 2 times"),
    (spline(2, [0, 0, 1, 1, 1, 2, 2], [0] * 6), "1 stands 3 times; allowed: at most 2 times"),
    (spline(0, [0, 1], [0, 1]), "degree: is 0; allowed: greater than or equal to 1"),
    (spline("two", [0, 1], [0, 1]), "degree: is 'two'"),
    (polynomial([0, 360], [0, 0], [0]), "are 2, 2 and 1 numbers; allowed: one of each"),
    (polynomial([0, 361], [0, 0], [0, 0]), "at: is 361 deg; allowed: at most 360 deg"),
    (polynomial([0, 0], [0, 0], [0, 1]), "at: has 0 deg of order 0 twice; allowed: once"),
    (polynomial([0, 360], [0, 2], [0, 1]), "order: is 2; allowed: at most 1, the degree"),
    (polynomial([0, 360], [0, -1], [0, 1]), "order[1]: is -1; allowed: greater than or equal to 0"),
    (polynomial([0, 1], [0, 0], [0, 1], "mm"), "at: has unit 'mm', not an angle; allowed: rad"),
    (polynomial(list(range(22)), [0] * 22, [0] * 22), "22 conditions; allowed: 1 to 21"),
    ("- {law: trigonometric, span: {assumed: 180, unit: deg}, mean: {assumed: 0, unit: '1'}}",
     "span: is 180°; allowed: 360°, this law is a whole turn"),
    (f"- {{law: trigonometric, {TURN}, mean: {{assumed: 0, unit: '1'}}, sine: {ratio(*[0] * 51)}}}",
     "sine: are 51; allowed: at most 50"),
    (f"- {{law: arcs_by_radii, {TURN}, flank: convex, nose_radius: {{assumed: 9, unit: mm}}}}",
     "flank: convex needs flank_radius"),
    (f"- {{law: arcs_by_radii, {TURN}, flank: straight, nose_radius: {{assumed: 9, unit: mm}},"
     " flank_radius: {assumed: 9, unit: mm}}", "flank: straight has no flank_radius"),
    (f"- {{law: arcs_by_radii, {TURN}, flank: round, nose_radius: {{assumed: 9, unit: mm}}}}",
     "flank: is 'round'; allowed: 'convex', 'straight' or 'concave'"),
    (f"- {{law: arcs_by_centres, {TURN}, arcs: [{{}}]}}", "arcs: is [{}]; allowed: at least 2"),
    (f"- {{law: arcs_by_centres, {TURN}, arcs: [{{}}, {{x: {{assumed: 1, unit: mm}}}}]}}",
     "segments[0].arcs[1]: has x; allowed: radius, x and y, or radius alone, or nothing"),
    (f"- {{law: arcs_by_centres, {TURN}, arcs: [{{}}, {{radius: {{assumed: 0, unit: mm}}}}]}}",
     "arcs[1]: radius: is 0; allowed: positive (convex) or negative (concave)"),
    (f"- {{law: table, {TURN}, file: 3, tolerance: {{assumed: 0, unit: mm}}, source: x}}",
     "segments[0].file: is 3"),
]  # fmt: skip


@pytest.mark.parametrize(("segment", "words"), CASES, ids=[words[:40] for _, words in CASES])
def test_wrong_segment(error_of, segment, words):
    """One line with the segment, the key, the value and the limit."""
    message = error_of("cam", HEAD + segment)
    assert message.startswith("segments[0]")
    assert words in message
    assert "allowed" in message or "needs" in message or "has no" in message
