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

from .conftest import OneProcess, patient, payloads_of, wait_until

pytestmark = pytest.mark.ros
MOTION = (topics.JOINT_STATES, topics.FOLLOWER_CONTACT, topics.FOLLOWER_MARKERS)


class Watcher:
    """Somebody who notes the wall time of each message's arrival, as a thread beside the test.
    ``control`` are the wall times at which another thread woke that wants to at the same rate: how
    even anything can be on this machine now."""

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


@pytest.mark.parametrize(
    ("factor", "rate"), [(2.0, 50.0), pytest.param(0.5, 100.0, marks=pytest.mark.long)]
)
def test_a_paced_run_is_seen_evenly_and_recorded_as_any(
    user, short_scene, undisturbed, tmp_path, factor, rate
):
    """The motion comes so many times a second, at most a tick and 50 ms behind the drive, samples
    of the bag; this is the free run's. /clock goes on between the states."""
    bag, seen = tmp_path / "bag", Watcher(user, rate)
    nodes = patient(short_scene, bag, autostart=False, pacing=f"{factor}x")
    nodes["follower"]["motion_rate"] = rate
    with OneProcess(nodes) as run:
        for topic in seen.heard:
            wait_until(lambda topic=topic: seen.sees(topic))
        user.call("/cam_drive/start")
        with seen.watching():
            for _ in run.progress():
                pass
    assert payloads_of(bag) == undisturbed
    late, (drive_wall, drive) = seen.lateness(factor), seen.times(topics.CAM_STATE)
    for topic in MOTION[:2]:  # markers bear their stamp within
        seen.assert_even(topic, rate, late)
        assert (np.diff(seen.times(topic)[1]) > 0.0).all()
    wall, stamps = seen.times(topics.JOINT_STATES)
    inside = (wall > drive_wall[0]) & (wall < drive_wall[-1])
    lag = (np.interp(wall[inside], drive_wall, drive) - stamps[inside]) / factor
    assert np.quantile(lag, 0.99) <= np.diff(drive).max() / factor + 0.05 + late
    assert seen.lags and all(lag > 0.0 for lag in seen.lags)
    clock = seen.times(topics.CLOCK)[1]
    assert (np.diff(clock) > 0.0).all() and len(clock) > 1.5 * len(drive)
    seen.assert_even(topics.CLOCK, 125.0, late, np.median(np.diff(drive_wall)))
    states = [cam_state_of(m).time_ns for _, _, m in messages(bag, (topics.CAM_STATE,))]
    assert set(states) <= {stamp_of(cdr) for _, cdr in seen.heard[topics.CLOCK]}
    rows = np.concatenate([tick.rows for tick in read_ticks(bag)], axis=1)
    for _, cdr in seen.heard[topics.JOINT_STATES]:
        message, stamp = read_message(topics.JOINT_STATES, cdr)[0], stamp_of(cdr) * 1e-9
        sample = np.abs(rows[0] - stamp).argmin()
        shown = message.position[1], message.velocity[1], message.effort[1]
        assert abs(rows[0, sample] - stamp) < 2e-9 and shown == tuple(rows[[1, 2, 4], sample])
