"""A run at its own pace, as people see it: the motion and the clock come evenly in wall time."""

import threading
import time
from contextlib import contextmanager

import numpy as np
import pytest

from cam_rig.bag.reader import messages, read_ticks
from cam_rig.messages import topics
from cam_rig.messages.codec import cam_state_of
from cam_rig.messages.serialization import read_message, stamp_of
from cam_rig.nodes.convert import message_class
from cam_rig.runner.graph import Graph

pytestmark = pytest.mark.ros
MOTION = (topics.JOINT_STATES, topics.FOLLOWER_CONTACT, topics.FOLLOWER_MARKERS)
SCENE = """
name: one_speed
title: One speed
cams: [tm21]
rig: tm21
model: one_mass
sample_rate: {{assumed: 12, unit: kHz, source: "a test"}}
program:
  speeds: {{assumed: [{rpm}], unit: rpm, source: "a test"}}
  turns: {{assumed: {turns}, unit: turns, source: "a test"}}
  settle_turns: {{assumed: 1, unit: turns, source: "a test"}}
  ticks_per_turn: {ticks}
published: tm21_noise
"""


class Watcher:
    """Somebody who notes the wall time of each message's arrival, as a thread beside the test.

    ``control`` are the wall times at which another thread woke that wants to at the same rate: how
    even anything can be on this machine now.
    """

    def __init__(self, user, rate):
        self.user, self.rate, self.ended = user, rate, threading.Event()
        self.heard = {topic: [] for topic in (*MOTION, topics.CLOCK, topics.CAM_STATE)}
        self.lags, self.control = [], []
        for topic, heard in self.heard.items():
            user.node.create_subscription(
                message_class(topic), topic.name, self._noting(heard), 10_000, raw=True
            )
        about = message_class(topics.DIAGNOSTICS)
        user.node.create_subscription(about, topics.DIAGNOSTICS.name, self._on_diagnostics, 1000)

    def _noting(self, heard):
        return lambda cdr: heard.append((time.monotonic(), bytes(cdr)))

    def _on_diagnostics(self, message):
        for status in message.status:
            if status.name == topics.SHOWN_MOTION:
                self.lags.append(float(next(v.value for v in status.values if v.key == "lag_s")))

    def sees(self, topic):
        self.user.spin(0.02)
        return self.user.node.count_publishers(topic.name) > 0

    @contextmanager
    def watching(self):
        threads = [threading.Thread(target=act) for act in (self._spin, self._wake)]
        for thread in threads:
            thread.start()
        try:
            yield
        finally:
            self.ended.set()
            for thread in threads:
                thread.join(timeout=60)

    def _spin(self):
        while not self.ended.is_set():
            self.user.spin(0.05)

    def _wake(self):
        due = time.monotonic()
        while not self.ended.wait(max(0.0, due - time.monotonic())):
            self.control.append(time.monotonic())
            due += (1.0 + (self.control[-1] - due) * self.rate // 1.0) / self.rate

    def times(self, topic):
        """Wall time of arrival and rig time (s) of a topic's messages."""
        found = [(wall, stamp_of(cdr)) for wall, cdr in self.heard[topic]]
        wall, stamps = np.array(found).T
        return wall, stamps * 1e-9

    def lateness(self, factor):
        """Wall time (s) by which this machine was late: another thread to wake, a state to come."""
        wall, drive = self.times(topics.CAM_STATE)
        woke = np.diff(self.control).max() - 1.0 / self.rate
        return woke + max(0.0, (np.diff(wall) - np.diff(drive) / factor).max())

    def assert_even(self, topic, rate, late, other_gap=np.inf):
        """Nine gaps of ten are no longer than 1.5 periods, but for what the machine was late (s);
        as a rule they are a period, not those of messages that come all at once, or as long as the
        gap (s) of what it comes with as well."""
        gaps, period = np.diff(self.times(topic)[0]), 1.0 / rate
        assert np.quantile(gaps, 0.9) <= 1.5 * period + late, topic.name
        assert np.median(gaps) <= 1.5 * period + late, topic.name
        assert np.median(gaps) >= 0.5 * min(period, other_gap), topic.name


def print_seen(seen, rpm, ticks, factor, lag, advance):
    """A row of what was measured, shown by ``pytest -s``."""
    parts = [f"{rpm} rpm, {ticks} ticks, {factor}x"]
    for topic, longest in ((topics.JOINT_STATES, 0.015), (topics.CLOCK, 0.015)):
        gaps = np.diff(seen.times(topic)[0])
        parts.append(f"{1.0 / gaps.mean():.1f} Hz, {100.0 * np.mean(gaps <= longest):.2f} %")
    woke = np.diff(seen.control)
    parts.append(f"{100.0 * np.mean(woke <= 0.015):.2f} %")
    parts.append(f"{1e3 * np.quantile(lag, 0.99):.0f} ms")
    parts.append(f"{100.0 * np.mean(np.abs(advance - 1.0) <= 0.05):.1f} %")
    parts.append(f"{100.0 * np.std(advance):.1f} %")
    print("|", " | ".join(parts), "|")


def watch(user, rig, wait_for, running, rate=100.0, seconds=None):
    """Watch a run that stands to its end, or for a wall time (s)."""
    watcher = Watcher(user, rate)
    with running as run:
        for topic in watcher.heard:
            wait_for(lambda topic=topic: watcher.sees(topic))
        user.call("/cam_drive/start")
        begin = time.monotonic()
        with watcher.watching():
            for _ in run.progress():
                if seconds is not None and time.monotonic() - begin > seconds:
                    break
    return watcher


def paced(rig, scene, bag, pacing, rate):
    """The nodes of a run that stands, to turn at a pace."""
    nodes = rig.live(scene, bag, autostart=False, pacing=pacing)
    nodes["follower"]["motion_rate"] = rate
    return nodes


def test_a_paced_run_is_seen_evenly_and_recorded_as_any(
    user, rig, wait_for, short_scene, undisturbed, tmp_path
):
    """At 2x the motion comes 50 times a second, samples of the bag; this is the free run's."""
    bag = tmp_path / "bag"
    here = rig.here(paced(rig, short_scene, bag, "2x", 50.0))
    seen = watch(user, rig, wait_for, here, rate=50.0)
    assert rig.payloads(bag) == undisturbed
    rows = np.concatenate([tick.rows for tick in read_ticks(bag)], axis=1)
    for topic in MOTION[:2]:  # markers bear their stamp within
        seen.assert_even(topic, 50.0, seen.lateness(2.0))
        assert (np.diff(seen.times(topic)[1]) > 0.0).all()
    clock = seen.times(topics.CLOCK)[1]
    assert (np.diff(clock) > 0.0).all()
    states = [cam_state_of(m).time_ns for _, _, m in messages(bag, (topics.CAM_STATE,))]
    assert set(states) <= {stamp_of(cdr) for _, cdr in seen.heard[topics.CLOCK]}
    assert len(clock) > 1.5 * len(states)  # it goes on between them
    for _, cdr in seen.heard[topics.JOINT_STATES]:
        message, stamp = read_message(topics.JOINT_STATES, cdr)[0], stamp_of(cdr) * 1e-9
        sample = np.abs(rows[0] - stamp).argmin()
        assert abs(rows[0, sample] - stamp) < 2e-9
        assert (message.position[1], message.velocity[1], message.effort[1]) == tuple(
            rows[[1, 2, 4], sample]
        )
    assert seen.lags and all(lag > 0.0 for lag in seen.lags)


@pytest.mark.long
@pytest.mark.parametrize("factor", [0.25, 1.0, 4.0])
@pytest.mark.parametrize(("rpm", "ticks"), [(20, 1), (220, 1), (220, 12), (2000, 1), (2000, 72)])
def test_any_speed_is_seen_evenly(forked, user, rig, wait_for, tmp_path, rpm, ticks, factor):
    """A message a period, at most a turn and 50 ms behind the drive, and what the machine adds;
    twenty times a second the newest angle has advanced by what the speed says."""
    (tmp_path / "scenes").mkdir()
    scene, seconds = tmp_path / "scenes" / "one_speed.yaml", 10.0 + 2.0 * 60.0 / rpm / factor
    turns = int(seconds * factor * rpm / 60.0) + 3
    scene.write_text(SCENE.format(rpm=rpm, turns=turns, ticks=ticks), encoding="utf-8")
    graph = Graph(paced(rig, scene, tmp_path / "bag", f"{factor}x", 100.0))
    seen = watch(user, rig, wait_for, graph, seconds=seconds)
    late = seen.lateness(factor)
    for topic in MOTION[:2]:
        seen.assert_even(topic, 100.0, late)
    wall, stamps = seen.times(topics.JOINT_STATES)
    drive_wall, drive = seen.times(topics.CAM_STATE)
    seen.assert_even(topics.CLOCK, 125.0, late, np.median(np.diff(drive_wall)))
    inside = (wall > drive_wall[0]) & (wall < drive_wall[-1])
    lag = (np.interp(wall[inside], drive_wall, drive) - stamps[inside]) / factor
    assert np.quantile(lag, 0.99) <= 60.0 / rpm / factor + 0.05 + late
    frames = np.arange(wall[0] + 1.0, wall[-1] - 0.01, 0.05) + 0.001 * np.arange(10)[:, np.newaxis]
    newest = stamps[np.searchsorted(wall, frames) - 1]  # pictures that begin at any moment
    advance = np.diff(newest) / 0.05 / factor
    print_seen(seen, rpm, ticks, factor, lag, advance)
    assert np.mean(np.abs(advance - 1.0) * 0.05 <= 0.05 * 0.05 + 0.01 + late) > 0.95
