"""The bench with its ROS nodes: control by pages and other programs, and its bags."""

import json
import signal
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from sensor_msgs.msg import JointState

import cam_rig
from cam_rig.bag.files import is_unclosed
from cam_rig.bag.reader import read_scene, read_ticks
from cam_rig.dynamics.jump.any_follower import find_jump, follower_of
from cam_rig.testing.client import RigClient
from cam_rig.testing.running_rig import isolated_domain
from cam_rig.units import NS, RPM

from ..processes import is_running, until
from .conftest import BrowserPage, in_browser, panel_process

pytestmark = [pytest.mark.ros, pytest.mark.slow]


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    """Panel and its ROS domain, shared by the tests of this file."""
    out = tmp_path_factory.mktemp("bench") / "out"
    with isolated_domain() as domain, panel_process(out) as panel:
        yield panel, domain


@pytest.fixture
def running_panel(ros_domain, tmp_path):
    """Panel for a single test."""
    with panel_process(tmp_path / "out") as panel:
        yield panel


def contiguous(bag):
    """Return the duration (s) of a bag, and check that its ticks have no gap."""
    ticks = [tick.interval for tick in read_ticks(bag)]
    assert all(tick.stop_ns == following.start_ns for tick, following in pairwise(ticks))
    return (ticks[-1].stop_ns - ticks[0].start_ns) / NS


def test_one_page_has_the_controls(shared):
    """Of several pages only the one with the controls can operate the rig.

    Another page may request an emergency stop or take over the controls. A bag is kept on request,
    and a new run follows.
    """
    with shared[0].page() as first, shared[0].page() as second:
        first.running()
        assert second.running()["has_controls"] is False
        error = second.request("set", name="rpm", value=100)
        assert error["message"] == "another page has the controls; take over first"
        for wrong in ({"do": "keep"}, {"do": "clear"}, {"do": "set", "name": "rpm"}):
            assert not second.request(**wrong, value="emergency_stop")["success"]
        first.do("call", value="start")
        second.until(lambda live: live["level"])
        second.do("call", value="emergency_stop")
        first.until(lambda live: live["drive"] == "emergency")
        second.do("take_over")
        second.do("call", value="reset")
        second.do("call", value="start")
        second.until(lambda live: live["drive"] == "turning")
        assert not first.request("call", value="stop")["success"]
        second.socket.close()
        first.until(lambda live: live["has_controls"])
        first.do("call", value="stop")
        bag = first.keep()
        first.running()
    assert not is_unclosed(bag)


def test_a_watching_page_receives_every_tick_and_another_none(shared):
    """A page that watches the motion receives the samples of all ticks without a gap.

    They have the commanded speed. A page that does not watch receives no samples.
    """
    panel, _ = shared
    with panel.page() as page, panel.page() as other:
        page.running()
        page.until(lambda live: live["has_controls"])
        page.do("watch", value=True)
        page.do("set", name="rpm", value=250)
        page.do("call", value="start")
        page.turning(250.0)
        page.motion.clear()
        page.until(lambda _: len(page.motion) > 40)
        starts, steps, rows = zip(*page.motion, strict=True)
        ends = [b + s * r.shape[1] for b, s, r in zip(starts, steps, rows, strict=True)]
        assert starts[1:] == pytest.approx(ends[:-1], abs=1.01 * max(steps))
        angles = np.unwrap(np.concatenate([row[0] for row in rows[5:]]))
        times = np.concatenate(
            [b + s * np.arange(r.shape[1]) for b, s, r in zip(starts, steps, rows, strict=True)][5:]
        )
        assert np.ptp(angles - 250.0 * RPM * times) < 1e-3
        page.do("watch", value=False)
        page.do("set", name="rpm", value=200)
        other.request("note")
        assert other.motion == []


class BenchInBrowser(BrowserPage):
    """Page of the bench in a browser."""

    def open_bench(self, panel):
        """Open the bench and wait until its nodes run."""
        self.open(panel.address, "/bench")
        self.until(lambda: self.page.locator("#emergency").is_enabled())

    def start_cam(self):
        """Start the cam if it is stopped."""
        if self.page.locator("#start").is_enabled():
            self.page.locator("#start").focus()
            self.page.keyboard.press("Enter")

    def set_speed(self, rpm):
        """Enter a speed (rpm) and wait until the cam turns at it."""
        self.enter("rpm", rpm)
        self.until(lambda: self.text("speed") == str(rpm))

    def note(self, rpm):
        """Press the button that notes a level. Return True if it is at this speed (rpm)."""
        self.page.locator("#note").click()
        self.page.wait_for_timeout(200)
        return f" {rpm} rpm, " in self.text("noted") and "dB" in self.text("noted")

    def knob_rpm(self):
        """Return the speed (rpm) that the knob displays."""
        return float(self.page.locator("#knob").get_attribute("aria-valuenow") or "nan")


def test_the_knob_sets_and_follows_the_speed(chromium, shared):
    """The knob sets the speed by keys and by pointer.

    It also displays a speed that another program sets by ROS parameter.
    """
    panel, domain = shared
    with in_browser(chromium, BenchInBrowser) as bench:
        bench.open_bench(panel)
        bench.start_cam()
        bench.until(lambda: bench.text("speed") == "200")
        knob = bench.page.locator("#knob")
        knob.focus()
        for key in ("PageUp", "PageUp", "ArrowUp"):
            bench.page.keyboard.press(key)
        bench.until(lambda: bench.text("speed") == "221")
        assert bench.page.locator("#rpm").input_value() == "221"
        box = knob.bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        bench.page.mouse.move(x, y - 50)
        bench.page.mouse.down()
        bench.page.mouse.move(x + 50, y, steps=8)
        bench.page.mouse.up()
        bench.until(lambda: bench.knob_rpm() > 400.0)  # a third of its logarithmic scale
        bench.until(lambda: bench.text("speed") == f"{bench.knob_rpm():.0f}")
        with RigClient(domain) as outside:
            outside.set_parameter("cam_drive", "rpm", 333.0)
        rpm_field = bench.page.locator("#rpm")
        bench.until(lambda: bench.knob_rpm() == 333.0 and rpm_field.input_value() == "333")


#: Script that counts changes of controls and of the rig's picture in three seconds.
CHANGES = """() => new Promise((done) => {
  const found = { controls: [], turned: 0 };
  const canvas = document.querySelector("#rig canvas");
  let before = canvas.toDataURL();
  const looks = setInterval(() => {
    const now = canvas.toDataURL();
    found.turned += now !== before;
    before = now;
  }, 300);
  const seen = new MutationObserver((all) => all.forEach(({ target, attributeName }) => {
    if (target.matches("#knob, #knob *, button, input, select")) {
      found.controls.push(`${target.id} ${attributeName}`);
    }
  }));
  seen.observe(document.body, { attributes: true, subtree: true });
  setTimeout(() => { seen.disconnect(); clearInterval(looks); done(found); }, 3000);
})"""


def test_controls_do_not_change_while_the_cam_turns(chromium, shared):
    """While the cam turns, the page changes no attribute of a control.

    If it rewrote them with every message, the browser would compute the layout each time.
    """
    panel, _ = shared
    with in_browser(chromium, BenchInBrowser) as bench:
        bench.open_bench(panel)
        bench.start_cam()
        bench.set_speed(300)
        bench.page.locator("#rpm").blur()
        changes = bench.page.evaluate(CHANGES)
        assert changes["controls"] == []
        assert changes["turned"] > 3


def test_a_killed_panel_leaves_no_process_and_a_closed_bag(shared):
    """After a panel is killed, its nodes end and its bag is complete."""
    panel, _ = shared
    with panel.page() as page:
        page.running()
        kept = {Path(bag) for bag in page.until(lambda live: live["has_controls"])["kept_bags"]}
        page.turned(1.5)
        nodes = panel.nodes()
        assert len(nodes) == 6
        panel.end(signal.SIGKILL)
    until(lambda: not any(map(is_running, nodes.values())))
    (bag,) = set(panel.out.iterdir()) - kept
    assert not is_unclosed(bag)
    assert contiguous(bag) > 1.0


@pytest.mark.long
def test_a_page_and_another_program_control_the_rig(running_panel, ros_domain):
    """A page and another program can both set parameters of the nodes.

    The page displays values set elsewhere. The cam keeps turning while the page is reloaded.
    """
    with running_panel.page() as page:
        live = page.running()
        assert (live["drive"], live["domain"], live["has_controls"]) == (
            "stopped",
            ros_domain,
            True,
        )
        page.do("call", value="start")
        page.do("set", name="rpm", value=320)
        page.turning(320.0)
        with RigClient(ros_domain) as outside:
            outside.set_parameter("cam_drive", "rpm", 410.0)
            page.until(lambda live: live["parameters"]["cam_drive"]["rpm"] == 410.0)
            outside.set_parameter("microphone", "frequency_weighting", "A")
            page.until(lambda live: live["parameters"]["microphone"]["frequency_weighting"] == "A")
    with running_panel.page() as page:
        live = page.until(lambda live: live["state"])
        assert (live["drive"], live["has_controls"]) == ("turning", True)
        assert live["parameters"]["cam_drive"]["rpm"] == 410.0
        page.do("set", name="pacing", value="2x")
        page.do("set", name="cam", value="cycloidal")
        page.until(lambda live: live["state"]["cam"] == "cycloidal" and live["level"])
        page.do("call", value="stop")
        page.until(lambda live: live["drive"] == "stopped")
        answer = page.request("set", name="cam", value="no_such")
        assert not answer["success"] and "no_such" in answer["message"]


@pytest.mark.long
def test_a_noted_level_is_that_of_the_exact_model(running_panel):
    """A level noted on the bench agrees with the exact model within 0.2 dB.

    The difference is due to sample rate and background of the bench.
    """
    cam, rig = cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2")
    with running_panel.page() as page:
        page.running()
        page.do("set", name="rpm", value=350)
        page.do("call", value="start")
        page.do("listen", value=True)
        while not (answer := page.request("note"))["success"]:
            assert "allowed" in answer["message"]
            time.sleep(0.2)
        page.until(lambda _: len(page.sound) > 4 * 8000)
    noted = answer["reading"]
    law = cam_rig.build_law(cam)
    motion = cam_rig.simulate(law, rig, model="two_mass", rpm=350.0, turns=12)
    assert noted["level_db"] == pytest.approx(cam_rig.sound_level(motion).level_db, abs=0.2)
    sound = np.frombuffer(page.sound[: len(page.sound) // 4 * 4], "<f4")
    assert np.isfinite(sound).all() and 0.0 < np.abs(sound).max() < 1.0
    (row,) = running_panel.get("/bench/readings.csv").decode().splitlines()[1:]
    assert row.startswith("poly345,two_mass,350.0,")


@pytest.mark.long
def test_another_set_up_starts_another_run_and_a_bag_can_be_kept(running_panel):
    """A new set-up starts a new run, whose kept bag contains its parameters.

    The bag has every tick up to the end of the run. The selected time weighting is kept.
    """
    with running_panel.page() as page:
        page.running()
        page.do("set", name="time_weighting", value="S")
        page.do("set_up", value={"model": "one_mass", "preload": 55, "added_mass": 0.2})
        page.until(lambda live: live["graph"] == "starting")
        live = page.running()
        assert live["setup"]["preload"] == 55.0
        assert live["parameters"]["microphone"]["time_weighting"] == "S"
        error = page.request("keep")
        assert "nothing is recorded yet" in error["message"]
        page.do("set", name="rpm", value=400)
        page.turned(1.0)
        bag = page.keep()
        page.running()
    loaded = read_scene(bag)
    assert loaded.rig.follower.preload.si == 55.0 and loaded.scene.model == "one_mass"
    assert contiguous(bag) > 1.0
    assert running_panel.end(signal.SIGINT) == 128 + signal.SIGINT
    assert list(running_panel.out.iterdir()) == [bag]


@pytest.mark.long
@pytest.mark.parametrize("wait", [0.1, 0.4, 1.0])
def test_a_signal_while_the_rig_is_set_up_ends_the_panel(running_panel, wait):
    """SIGINT ends panel and nodes, also while a new set-up starts or ends nodes."""
    with running_panel.page() as page:
        page.running()
        page.do("set_up", value={"preload": 40})
        time.sleep(wait)  # these times once failed
        nodes = running_panel.nodes()
        assert running_panel.end(signal.SIGINT) == 128 + signal.SIGINT
    until(lambda: not any(map(is_running, nodes.values())))


@pytest.mark.long
def test_a_drawn_law_is_mounted_on_the_bench(running_panel):
    """A law from the drawing board can be used on the running bench.

    Each time it is mounted it gets a new cam name.
    """
    board = json.loads(running_panel.get("/board"))
    ordinates = list(board["ordinates"])
    ordinates[board["handles"][10]["index"]] += 0.01
    with running_panel.page() as page:
        page.running()
        page.do("call", value="start")
        for name in ("drawn_1", "drawn_2"):
            answer = running_panel.send("/bench/mount", {"ordinates": ordinates})
            assert answer == (200, {"cam": name})
            page.until(lambda live, name=name: live["state"].get("cam") == name)
        page.wait_for_rig_time(2.0)
        bag = page.keep()
    assert {tick.cam for tick in read_ticks(bag)} == {"poly345", "drawn_1", "drawn_2"}


@pytest.mark.long
def test_a_run_that_fails_leaves_its_bag(running_panel, ros_domain):
    """A run that fails is reported with the reason, and its bag is kept.

    The reason here is a second publisher on /cam/state. A new set-up starts the next run.
    """
    with running_panel.page() as page:
        page.running()
        page.turned(1.0)
        with RigClient(ros_domain) as outside:
            outside.node.create_publisher(JointState, "/cam/state", 1)
            live = page.until(lambda live: live["graph"] == "failed")
        assert "/cam/state" in live["failure"]
        (bag,) = map(Path, page.until(lambda live: live["kept_bags"])["kept_bags"])
        page.do("set_up", value={})
        page.until(lambda live: live["graph"] == "starting")
        page.running()
    assert contiguous(bag) > 0.5


@pytest.mark.long
def test_noted_levels_are_drawn(chromium, running_panel):
    """Noted levels are drawn over the speed, with filled markers if contact was lost.

    The CSV file of the readings has the same information.
    """
    law, rig = cam_rig.build_law(cam_rig.load_cam("poly345")), cam_rig.load_rig("paper_table2")
    jump = find_jump(law, follower_of(rig), None).rpm  # the bench's first model
    with in_browser(chromium, BenchInBrowser) as bench:
        bench.open_bench(running_panel)
        bench.page.locator("#start").click()
        for rpm in (round(0.8 * jump), round(1.3 * jump)):
            bench.set_speed(rpm)
            bench.until(lambda rpm=rpm: bench.note(rpm))
        full = bench.page.evaluate(
            """() => [...document.querySelectorAll("#noise .point")]
              .map((one) => getComputedStyle(one)).map(({ fill, stroke }) => fill === stroke)"""
        )
        assert (full[0], full[-1]) == (False, True)
        bench.until(lambda: bench.text("contact") == "contact lost")
        rows = running_panel.get("/bench/readings.csv").decode().splitlines()
        contact = [row.split(",")[5] for row in rows[1:]]
        assert (contact[0], contact[-1]) == ("in contact", "contact lost")
        assert len(contact) == len(full)
