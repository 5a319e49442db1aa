"""JavaScript core of the drawing board, compared with the Python package in a browser.

The core computes law, contour, contact force, jump speed, lift-offs and landings. Laws, rigs and
speeds are random.
"""

import math

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.dynamics.kinetostatic import loss_intervals
from cam_rig.errors import CamRigError
from cam_rig.laws import build_law
from cam_rig.laws.bernstein import EPS
from cam_rig.panel.board.drawable import with_base_radius
from cam_rig.panel.board.drawn_law import DrawnLaw
from cam_rig.panel.board.evaluation import evaluate_fast
from cam_rig.panel.board.figures import find_rise, law_figures
from cam_rig.panel.export.page import follower_sizes
from cam_rig.panel.server import STATIC
from cam_rig.profile.contact import Motion
from cam_rig.profile.disc import Contour, discs
from cam_rig.units import RPM, TURN

from ..conftest import CAM_NAMES

pytestmark = pytest.mark.slow
#: Tolerance relative to the natural scale of a result: its largest value over the turn, the size of
#: the cam, or one turn. Python and JavaScript differ in the order of sums and in exp, sin and cos.
RTOL = 1e-12
#: Host under which the browser reads the modules from the folder of static files.
HOST = "http://core.test"
#: Number of points of a turn at which laws are compared, and of a contour.
POINTS, CONTOUR_POINTS = 720, 360
#: Number of turns of a run from rest.
TURNS = 4
#: Relative change of the cam speed that shows how a run amplifies errors.
PROBE = 1e-9
#: Amplification of errors above which events are not compared. Rebounds amplify without limit.
MAX_AMPLIFICATION = 1e5
CORE = """async ([law, ordinates, cam, rig, speeds, turns]) => {
  const load = (name) => import(`/core/${name}.js`);
  const { Law, pieceOrdinates, readPieces } = await load("law");
  const { contours } = await load("contour");
  const { evaluateFast } = await load("results");
  const { jumpSpeed } = await load("jump_speed");
  const { lossIntervals } = await load("force");
  const { ContactRun } = await load("contact_run");
  const bytes = Uint8Array.from(atob(law.matrices), (letter) => letter.charCodeAt(0));
  const pieces = readPieces(law, new Float64Array(bytes.buffer));
  const drawn = new Law(law.name, law.breaks, pieceOrdinates(pieces, law.degree, ordinates));
  const attempt = (compute) => {
    try {
      return compute();
    } catch (error) {
      return `${error.constructor.name}: ${error.message}`;
    }
  };
  return {
    motion: drawn.sample(720).map((curve) => [...curve]),
    contours: attempt(() => contours(cam.follower, drawn)),
    fast: evaluateFast(cam, drawn, rig),
    jump: attempt(() => jumpSpeed(drawn, rig)),
    losses: speeds.map((speed) => lossIntervals(drawn, rig, speed)),
    runs: speeds.map((speed) => attempt(() => new ContactRun(drawn, rig, speed, turns).events)),
  };
}"""


@pytest.fixture(scope="module")
def core(chromium):
    """Function that evaluates the core in a page without a server."""
    page = chromium.new_context().new_page()

    def respond(route):
        path = route.request.url.removeprefix(HOST + "/")
        if not path:
            return route.fulfill(body="<!doctype html>", content_type="text/html")
        body = (STATIC / path).read_text("utf-8")
        return route.fulfill(body=body, content_type="text/javascript")

    page.route("**/*", respond)
    page.goto(HOST)
    yield lambda *arguments: page.evaluate(CORE, list(arguments))
    page.context.close()


class Case:
    """Random law of a cam with random follower and speeds, and the results of the core."""

    def __init__(self, core, name, seed):
        rng = np.random.default_rng([seed, CAM_NAMES.index(name)])
        file_cam = cam_rig.load_cam(name)
        drawn, rig = DrawnLaw.of(file_cam), cam_rig.load_rig("paper_table2")
        ordinates, free = drawn.ordinates.copy(), [handle.index for handle in drawn.handles]
        ordinates[free] += 0.02 * rng.uniform() * rng.standard_normal(len(free))
        self.law = drawn.law(ordinates, name)
        base = rng.choice([1.0, rng.uniform(0.2, 2.0)]) * file_cam.follower.base_radius.si
        self.cam = with_base_radius(file_cam, 1e3 * base, name)
        self.rise = find_rise(file_cam, build_law(file_cam))
        changes = {
            "mass": 1.3 * 10.0 ** rng.uniform(-1.0, 1.0),
            "spring_stiffness": 4030.0 * 10.0 ** rng.uniform(-1.0, 1.0),
            "damping": rng.choice([0.0, 8.642, 8.642 * 10.0 ** rng.uniform(-1.0, 2.0)]),
            "preload": rng.choice([0.0, 30.6 * 10.0 ** rng.uniform(-1.0, 1.0)]),
            "restitution": rng.choice([0.0, rng.uniform(0.0, 0.9)]),
        }
        self.rig = rig.replace(**{key: float(value) for key, value in changes.items()})
        self.mass = FollowerParameters.from_rig(self.rig)
        jump = 0.0 if self.law.velocity_jumps else rigid_jump_speed(self.law, self.mass)
        jump = jump / RPM if 1.0 * RPM < jump < math.inf else 100.0
        self.rpm = [jump * factor for factor in (0.99, 1.02, rng.uniform(1.0, 2.0), 10.0)]
        names = ("mass", "damping", "spring_stiffness", "preload", "restitution")
        follower = {name: getattr(self.mass, name) for name in names}
        data = drawn.page_data | {"name": name}
        sizes = follower_sizes(file_cam, self.law) | {
            "base_radius": self.cam.follower.base_radius.si
        }
        static = {"follower": sizes, "picture": {}, "rise": self.rise and vars(self.rise)}
        speeds = [rpm * RPM for rpm in self.rpm]
        self.js = core(data, ordinates.tolist(), static, follower, speeds, TURNS)

    def at_joints(self, points):
        """Return equally spaced angles (rad). An angle just before a joint is moved to it."""
        angles = np.linspace(0.0, TURN, points, endpoint=False)
        nearest = self.law.breaks[np.abs(angles[:, None] - self.law.breaks).argmin(axis=1)]
        return np.where((angles < nearest) & (nearest < angles + 1e-9), nearest, angles)

    def scale(self, order):
        """Return the natural scale of a derivative of the law, m/rad^order.

        It is the largest ordinate. In short pieces the rounding of s, in the bound of
        `cam_rig.laws.law`, is larger than 1e-12 of it.
        """
        largest = np.abs(self.law.derivative_ordinates(order)).max()
        rate = 2.0 * self.law.degree / self.law.spans.min()
        return max(largest, EPS / RTOL * np.abs(self.law.ordinates).max() * rate**order)


def assert_close(actual, expected, scale):
    assert np.abs(np.array(actual) - expected).max() <= RTOL * scale


CASES = pytest.mark.parametrize("name", CAM_NAMES)


@pytest.mark.variants(10)
@CASES
@pytest.mark.parametrize("seed", range(3))
def test_law_contour_and_jump_speed_are_those_of_the_package(core, name, seed):
    """s to s''', contour, pitch curve, undercut, pressure angle and jump speed agree to 1e-12.

    The ranges with a negative force do too. A refusal has the message of the package.
    """
    case = Case(core, name, seed)
    for order, curve in enumerate(case.js["motion"]):
        assert_close(curve, case.law(case.at_joints(POINTS), order), case.scale(order))
    try:
        jump = rigid_jump_speed(case.law, case.mass)
    except CamRigError as error:
        assert case.js["jump"] == f"RefusedError: {error}"
    else:
        assert case.js["jump"] == pytest.approx(jump, rel=RTOL)
    for rpm, losses in zip(case.rpm, case.js["losses"], strict=True):
        ranges = loss_intervals(case.law, case.mass, rpm * RPM)
        assert len(losses) == len(ranges)
        for actual, angles in zip(losses, ranges, strict=True):
            assert actual == pytest.approx(angles, abs=root_atol(case, angles, rpm * RPM))
    angles = np.linspace(0.0, TURN, CONTOUR_POINTS, endpoint=False)
    curves = (case.law(case.at_joints(CONTOUR_POINTS), order) for order in range(3))
    motion = Motion(angles, *curves)
    try:
        plates = discs(case.cam.follower, case.law)
    except CamRigError as error:
        assert case.js["contours"] == f"RefusedError: {error}"
        return
    for disc, actual in zip(plates, case.js["contours"], strict=True):
        contour = Contour.of(disc, motion)
        size = np.abs(contour.points).max()
        assert_close(actual["points"], contour.points, size)
        assert (actual["pitch"] is None) == (contour.pitch is None)
        if contour.pitch is not None:
            assert_close(actual["pitch"], contour.pitch, size)
        assert_close(actual["rate"], contour.rate, max(size, np.abs(contour.rate).max()))
        assert_close(actual["pressure"], np.abs(contour.pressure), 1.0)


def root_atol(case, angles, speed):
    """Return the tolerance (rad) of angles at which the force crosses zero.

    It is the tolerance of the force, divided by its slope at the angles.
    """
    weights = [case.mass.spring_stiffness, case.mass.damping * speed, case.mass.mass * speed**2]
    size = np.dot(weights, case.law.bounds) + case.mass.preload
    slope = sum(w * np.abs(case.law(np.array(angles), k + 1)) for k, w in enumerate(weights))
    return RTOL * max(TURN, size / max(slope.min(), 1e-300))


@pytest.mark.variants(10)
@CASES
@pytest.mark.parametrize("seed", range(3))
def test_fast_results_are_those_of_the_server(core, name, seed):
    """Faults, warnings, pressure angle, follower, peaks and continuity are those of the server."""
    case = Case(core, name, seed)
    expected = evaluate_fast(case.cam, case.law, case.rig)
    actual = case.js["fast"]
    for key in ("faults", "warnings", "jump_rigid", "pressure"):
        assert_same(actual[key], expected[key])
    for disc, message in zip(actual["discs"], expected["discs"], strict=True):
        assert np.allclose(disc["points"], np.array(message["points"]), rtol=0, atol=6e-5)
        assert (disc["undercut"], disc["steep"]) == (message["undercut"], message["steep"])
    assert (actual["follower"] is None) == (expected["follower"] is None)
    for key, value in (actual["follower"] or {}).items():
        assert value == pytest.approx(expected["follower"][key], rel=RTOL, abs=6e-5)
    figures, message = actual["figures"], law_figures(case.law, case.rise)
    assert figures["continuity"] == message["continuity"]
    for order, (peak, other) in enumerate(zip(figures["peaks"], message["peaks"], strict=True), 1):
        for end in ("largest", "least"):
            assert abs(peak[end]["value"] - other[end]["value"]) <= RTOL * case.scale(order)
        assert_same(peak["coefficient"], other["coefficient"])


def assert_same(actual, expected):
    """Assert that values of a message are equal, numbers to nine digits."""
    if isinstance(expected, dict):
        assert actual.keys() == expected.keys()
        for key, value in expected.items():
            assert_same(actual[key], value)
    elif isinstance(expected, list):
        for pair in zip(actual, expected, strict=True):
            assert_same(*pair)
    else:
        is_number = isinstance(expected, float)
        assert actual == (pytest.approx(expected, rel=1e-9, abs=1e-9) if is_number else expected)


@pytest.mark.variants(12)
@CASES
@pytest.mark.parametrize("seed", range(3))
def test_lift_offs_and_landings_are_those_of_the_package(core, name, seed):
    """Angles of lift-offs and landings agree to 1e-12 of a turn, impulses to 1e-12 of m v.

    v is the largest change of the cam's velocity in a turn. An error grows in flights and rebounds.
    The tolerance grows by the same factor, which is that of a small change of the speed, and by the
    rounding of s'' in short pieces.
    """
    case, compared = Case(core, name, seed), 0
    for rpm, events in zip(case.rpm, case.js["runs"], strict=True):
        expected, probe = (
            cam_rig.simulate(case.law, case.rig, rpm=speed, turns=TURNS).events
            for speed in (rpm, rpm * (1.0 + PROBE))
        )
        speed = rpm * RPM
        momentum = case.mass.mass * speed * case.law.bounds[2] * TURN
        amplification = 1.0
        law_rounding = case.scale(2) / np.abs(case.law.motion[2]).max()
        for i, event in enumerate(expected):
            if i >= len(probe) or probe[i].kind != event.kind:
                break
            change = abs(probe[i].angle - event.angle) / TURN
            impulse = abs(probe[i].impulse - event.impulse) / momentum
            amplification = max(amplification, change / PROBE, impulse / PROBE)
            if amplification > MAX_AMPLIFICATION:
                break
            actual = events[i]
            assert actual["isLanding"] == (event.kind == "landing")
            tolerance = RTOL * amplification * law_rounding
            assert abs(actual["angle"] - event.angle) <= tolerance * TURN
            assert abs(actual["impulse"] - event.impulse) <= tolerance * momentum
            compared += 1
        else:
            assert len(events) == len(expected)
    assert compared
