"""The bench with its nodes: pages steer them, others too, and what is recorded is what was done."""

from __future__ import annotations

import json
import os
import signal
import time
from itertools import pairwise
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from sensor_msgs.msg import JointState

import cam_rig
from cam_rig.bag.files import is_unclosed
from cam_rig.bag.reader import read_scene, read_ticks
from cam_rig.testing.client import RigClient
from cam_rig.units import NS

from ..asking import ask
from .conftest import WAIT_S, RunningPanel

pytestmark = [pytest.mark.ros, pytest.mark.slow]


def wait_until(condition):
    """Poll until something is true."""
    end = time.monotonic() + WAIT_S
    while not condition():
        assert time.monotonic() < end, "it did not come true"
        time.sleep(0.05)


def contiguous(bag: Path) -> float:
    """The rig time (s) that a bag has samples of, each tick beginning where the last one ended."""
    ticks = [tick.interval for tick in read_ticks(bag)]
    assert all(one.stop_ns == other.start_ns for one, other in pairwise(ticks))
    return (ticks[-1].stop_ns - ticks[0].start_ns) / NS


def is_alive(pid: int) -> bool:
    """Whether there is a process that has not ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.long
def test_a_page_turns_the_rig_and_so_does_anybody_else(
    running_panel: RunningPanel, ros_domain: int
) -> None:
    """Speed, cam and weighting are the nodes' own parameters: what is set outside is shown."""
    with running_panel.page() as page:
        live = page.running()
        assert (live["drive"], live["domain"], live["holds"]) == ("stopped", ros_domain, True)
        page.do("call", value="start")
        page.do("set", name="rpm", value=320)
        page.turning(320.0)
        with RigClient(ros_domain) as outside:
            outside.set_parameter("cam_drive", "rpm", 410.0)
            page.until(lambda live: live["values"]["cam_drive"]["rpm"] == 410.0)
            outside.set_parameter("microphone", "frequency_weighting", "A")
            page.until(lambda live: live["values"]["microphone"]["frequency_weighting"] == "A")
        page.do("set", name="cam", value="cycloidal")
        page.until(lambda live: live["state"]["cam"] == "cycloidal" and live["level"])
        page.do("call", value="stop")
        page.until(lambda live: live["drive"] == "stopped")
        answer = page.ask("set", name="cam", value="no_such")
        assert not answer["success"]
        assert "no_such" in answer["words"]


@pytest.mark.long
def test_a_noted_level_is_the_exact_one(running_panel: RunningPanel) -> None:
    """To what the sample rate of the bench and the background leave of the mean of a second."""
    cam, rig = cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2")
    with running_panel.page() as page:
        page.running()
        page.do("set", name="rpm", value=350)
        page.do("call", value="start")
        page.do("listen", value=True)
        while not (answer := page.ask("note"))["success"]:
            assert "allowed" in answer["words"]
            time.sleep(0.2)
        page.until(lambda _: len(page.sound) > 4 * 8000)
    noted = answer["noted"]
    law = cam_rig.build_law(cam)
    motion = cam_rig.simulate(law, rig, model="two_mass", rpm=350.0, turns=12)
    assert noted["level_db"] == pytest.approx(cam_rig.sound_level(motion).level_db, abs=0.2)
    sound = np.frombuffer(page.sound[: len(page.sound) // 4 * 4], "<f4")
    assert np.isfinite(sound).all()
    assert 0.0 < np.abs(sound).max() < 1.0
    (row,) = running_panel.get("/bench/readings.csv").decode().splitlines()[1:]
    assert row.startswith("poly345,two_mass,350.0,")


@pytest.mark.long
def test_another_set_up_is_another_run_and_its_bag_is_kept(running_panel: RunningPanel) -> None:
    """The kept bag holds the chosen numbers and every tick up to where it was closed."""
    with running_panel.page() as page:
        page.running()
        page.do("set", name="time_weighting", value="S")
        page.do("set_up", value={"model": "one_mass", "preload": 55, "added_mass": 0.2})
        page.until(lambda live: live["graph"] == "starting")
        live = page.running()
        assert live["setup"]["preload"] == 55.0
        assert live["values"]["microphone"]["time_weighting"] == "S"
        refused = page.ask("keep")
        assert "nothing is recorded yet" in refused["words"]
        page.do("set", name="rpm", value=400)
        page.do("call", value="start")
        page.until(lambda live: live["state"].get("time_ns", 0) > 1e9)
        page.do("keep")
        bag = Path(page.until(lambda live: live["kept"])["kept"][0])
        page.running()
    loaded = read_scene(bag)
    assert loaded.rig.follower.preload.si == 55.0
    assert loaded.scene.model == "one_mass"
    assert contiguous(bag) > 1.0
    assert running_panel.end(signal.SIGINT) == 128 + signal.SIGINT
    assert list(running_panel.out.iterdir()) == [bag]


def test_a_killed_node_is_named_and_one_command_starts_it_again(
    running_panel: RunningPanel,
) -> None:
    """The others wait for it; the run goes on with the tick it had come to."""
    with running_panel.page() as page:
        page.running()
        page.do("call", value="start")
        page.until(lambda live: live["level"])
        os.kill(running_panel.nodes()["follower"], signal.SIGKILL)
        ended = page.until(lambda live: live["ended"])["ended"]
        assert "follower was ended by signal 9" in ended["follower"]
        assert not page.ask("start_again", value="microphone")["success"]
        before = page.live["state"]["time_ns"]
        page.do("start_again", value="follower")
        page.until(lambda live: not live["ended"] and live["state"]["time_ns"] > before + 1e9)
        page.do("keep")
        bag = Path(page.until(lambda live: live["kept"])["kept"][0])
    assert contiguous(bag) > 1.0


def test_one_page_holds_the_controls(running_panel: RunningPanel) -> None:
    """Another one sees, may stop in an emergency, and may take over; then the first is refused."""
    with running_panel.page() as first, running_panel.page() as second:
        first.running()
        assert second.running()["holds"] is False
        refused = second.ask("set", name="rpm", value=100)
        assert refused["words"] == ("another page holds the controls; allowed: after taking over")
        for wrong in ({"do": "keep"}, {"do": "clear"}, {"do": "set", "name": "rpm"}):
            assert not second.ask(**wrong, value="emergency_stop")["success"]
        first.do("call", value="start")
        second.until(lambda live: live["level"])
        second.do("call", value="emergency_stop")
        first.until(lambda live: live["drive"] == "emergency")
        second.do("take_over")
        second.do("call", value="reset")
        second.do("call", value="start")
        second.until(lambda live: live["drive"] == "turning")
        assert not first.ask("call", value="stop")["success"]
        second.socket.close()
        first.until(lambda live: live["holds"])
        first.do("call", value="stop")


@pytest.mark.long
def test_a_reload_finds_the_bench_as_it_is(running_panel: RunningPanel) -> None:
    """The nodes are the server's and not the page's: they turn on, and readings stay."""
    with running_panel.page() as page:
        page.running()
        page.do("set", name="rpm", value=275)
        page.do("call", value="start")
        page.turning(275.0)
    with running_panel.page() as page:
        live = page.until(lambda live: live["state"])
        assert live["drive"] == "turning"
        assert live["holds"] is True
        assert live["values"]["cam_drive"]["rpm"] == 275.0


def test_nothing_stays_of_a_panel_that_is_killed(running_panel: RunningPanel) -> None:
    """Its nodes end by themselves, and the bag is closed."""
    with running_panel.page() as page:
        page.running()
        page.do("call", value="start")
        page.until(lambda live: live["state"].get("time_ns", 0) > 2e9)
        nodes = running_panel.nodes()
        assert len(nodes) == 6
        running_panel.end(signal.SIGKILL)
    wait_until(lambda: not any(map(is_alive, nodes.values())))
    (bag,) = running_panel.out.iterdir()
    assert not is_unclosed(bag)
    assert contiguous(bag) > 1.0


NONSENSE = ("", "[]", "{", '{"do": 1}', '{"do": "set"}', '{"do": "set_up", "value": [1]}')


def test_nonsense_is_refused_and_changes_nothing(running_panel: RunningPanel) -> None:
    """A message that is none is answered; one that is too long closes its own page alone."""
    with running_panel.page() as page:
        setup = page.running()["setup"]
        for text in NONSENSE:
            page.socket.send(text)
            answer = page.answer(None)
            assert not answer["success"]
            assert "allowed" in answer["words"]
        with running_panel.page() as other:
            other.socket.send("x" * 70_000)
            page.do("listen", value=False)
        assert page.running()["setup"] == setup


@pytest.mark.long
@pytest.mark.parametrize("wait", [0.1, 0.4, 1.0])
def test_a_signal_while_the_rig_is_set_up_ends_the_panel(
    running_panel: RunningPanel, wait: float
) -> None:
    """Whether it comes while nodes are ended, or while the next ones begin."""
    with running_panel.page() as page:
        page.running()
        page.do("set_up", value={"preload": 40})
        time.sleep(wait)  # the promise holds for any; these are where it did not
        nodes = running_panel.nodes()
        assert running_panel.end(signal.SIGINT) == 128 + signal.SIGINT
    wait_until(lambda: not any(map(is_alive, nodes.values())))


@pytest.mark.long
def test_what_is_drawn_is_put_on_the_bench(running_panel: RunningPanel) -> None:
    """The law that turns is the one of the handles; drawn again, it is another cam."""
    host = urlsplit(running_panel.address).netloc
    headers = {"Cookie": running_panel.cookie, "Origin": f"http://{host}"}
    board = json.loads(running_panel.get("/board"))
    ordinates = list(board["ordinates"])
    ordinates[board["handles"][10]["index"]] += 0.01
    body = json.dumps({"ordinates": ordinates})
    with running_panel.page() as page:
        page.running()
        page.do("call", value="start")
        for name in ("drawn_1", "drawn_2"):
            status, _, answer = ask(running_panel.address, "/bench/mount", "POST", body, **headers)
            assert (status, json.loads(answer)) == (200, {"cam": name})
            page.until(lambda live, name=name: live["state"].get("cam") == name)
        page.until(lambda live: live["state"]["time_ns"] > 2e9)
        page.do("keep")
        bag = Path(page.until(lambda live: live["kept"])["kept"][0])
    law = read_ticks(bag)
    lifts = {tick.cam: tick.lift.max() for tick in law}
    assert set(lifts) == {"poly345", "drawn_1", "drawn_2"}
    wrong = json.dumps({"ordinates": [0.0]})
    status, _, answer = ask(running_panel.address, "/bench/mount", "POST", wrong, **headers)
    assert status == 409
    assert "ordinates: allowed" in json.loads(answer)["words"]


@pytest.mark.long
def test_a_run_that_fails_leaves_its_bag(running_panel: RunningPanel, ros_domain: int) -> None:
    """A second publisher on a topic of the rig ends it; what was recorded is named, and stays."""
    with running_panel.page() as page:
        page.running()
        page.do("call", value="start")
        page.until(lambda live: live["state"].get("time_ns", 0) > 1e9)
        with RigClient(ros_domain) as outside:
            outside.node.create_publisher(JointState, "/cam/state", 1)
            live = page.until(lambda live: live["graph"] == "failed")
        assert "/cam/state" in live["words"]
        (bag,) = map(Path, page.until(lambda live: live["kept"])["kept"])
        page.do("set_up", value={})
        page.until(lambda live: live["graph"] == "starting")
        page.running()
    assert contiguous(bag) > 0.5
