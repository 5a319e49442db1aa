"""Paced run: motion and clock are published at a constant rate of wall-clock time."""

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
    """Subscriber that records the arrival of each motion, clock and state message.

    Another thread wakes at the same rate, for comparison: `wake_times` are its wall-clock times,
    which show the timing that this machine is capable of at present.
    """

    def __init__(self, user, rate):
        self.user, self.rate, self.ended = user, rate, threading.Event()
        self.received = {topic: [] for topic in (*MOTION, topics.CLOCK, topics.CAM_STATE)}
        self.lags, self.wake_times = [], []
        for topic, arrivals in self.received.items():
            user.node.create_subscription(
                message_class(topic), topic.name, self._recording(arrivals), 10_000, raw=True
            )
        kind = message_class(topics.DIAGNOSTICS)
        user.node.create_subscription(kind, topics.DIAGNOSTICS.name, self._on_diagnostics, 1000)

    def _recording(self, arrivals):
        return lambda cdr: arrivals.append((time.monotonic(), bytes(cdr)))

    def _on_diagnostics(self, message):
        for status in message.status:
            if status.name == topics.SHOWN_MOTION:
                self.lags.append(float(next(v.value for v in status.values if v.key == "lag_s")))

    def has_discovered(self, topic):
        self.user.spin(0.02)
        return self.user.node.count_publishers(topic.name) > 0

    @contextmanager
    def watching(self):
        threads = [threading.Thread(target=target) for target in (self._spin, self._wake)]
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
            self.wake_times.append(time.monotonic())
            due += (1.0 + (self.wake_times[-1] - due) * self.rate // 1.0) / self.rate

    def times(self, topic):
        """Return wall-clock times of arrival (s) and rig times (s) of a topic's messages."""
        rows = [(wall, stamp_of(cdr)) for wall, cdr in self.received[topic]]
        wall, stamps = np.array(rows).T
        return wall, stamps * 1e-9

    def lateness(self, factor):
        """Return the largest delay (s, wall clock) that this machine caused.

        It is the sum of the largest delay of a thread's wake-up and that of the arrival of a cam
        state. `factor` is the real-time factor.
        """
        wall, drive = self.times(topics.CAM_STATE)
        wake_delay = np.diff(self.wake_times).max() - 1.0 / self.rate
        return wake_delay + max(0.0, (np.diff(wall) - np.diff(drive) / factor).max())

    def assert_even(self, topic, rate, late, other_gap=np.inf):
        """Assert that messages of a topic arrive at `rate` per second of wall-clock time.

        The median of the gaps between two messages is 0.5 to 1.5 periods, and 90 % are at most 1.5
        periods. The upper limits increase by the delay `late` (s) of the machine. The lower limit
        is half of `other_gap` (s) if messages are also published with another, shorter gap.
        """
        gaps, period = np.diff(self.times(topic)[0]), 1.0 / rate
        assert np.quantile(gaps, 0.9) <= 1.5 * period + late, topic.name
        assert np.median(gaps) <= 1.5 * period + late, topic.name
        assert np.median(gaps) >= 0.5 * min(period, other_gap), topic.name


@pytest.mark.parametrize(
    ("factor", "rate"), [(2.0, 50.0), pytest.param(0.5, 100.0, marks=pytest.mark.long)]
)
def test_a_paced_run_has_constant_rates_and_the_bag_of_a_free_run(
    user, short_scene, undisturbed, tmp_path, factor, rate
):
    """In a paced run motion and /clock are published at a constant wall-clock rate.

    The motion is at most one tick (interval between two cam states) and 50 ms behind the drive, and
    its values are samples of the bag. /clock advances between the states. The bag equals that of a
    free run.
    """
    bag, watcher = tmp_path / "bag", Watcher(user, rate)
    nodes = patient(short_scene, bag, autostart=False, pacing=f"{factor}x")
    nodes["follower"]["visualization_rate"] = rate
    with OneProcess(nodes) as run:
        for topic in watcher.received:
            wait_until(lambda topic=topic: watcher.has_discovered(topic))
        user.call("/cam_drive/start")
        with watcher.watching():
            for _ in run.progress():
                pass
    assert payloads_of(bag) == undisturbed
    late, (drive_wall, drive) = watcher.lateness(factor), watcher.times(topics.CAM_STATE)
    for topic in MOTION[:2]:  # the stamp of markers is not at the start of the message
        watcher.assert_even(topic, rate, late)
        assert (np.diff(watcher.times(topic)[1]) > 0.0).all()
    wall, stamps = watcher.times(topics.JOINT_STATES)
    inside = (wall > drive_wall[0]) & (wall < drive_wall[-1])
    lag = (np.interp(wall[inside], drive_wall, drive) - stamps[inside]) / factor
    assert np.quantile(lag, 0.99) <= np.diff(drive).max() / factor + 0.05 + late
    assert watcher.lags and all(lag > 0.0 for lag in watcher.lags)
    clock = watcher.times(topics.CLOCK)[1]
    assert (np.diff(clock) > 0.0).all() and len(clock) > 1.5 * len(drive)
    watcher.assert_even(topics.CLOCK, 125.0, late, np.median(np.diff(drive_wall)))
    states = [cam_state_of(m).time_ns for _, _, m in messages(bag, (topics.CAM_STATE,))]
    assert set(states) <= {stamp_of(cdr) for _, cdr in watcher.received[topics.CLOCK]}
    rows = np.concatenate([tick.rows for tick in read_ticks(bag)], axis=1)
    for _, cdr in watcher.received[topics.JOINT_STATES]:
        message, stamp = read_message(topics.JOINT_STATES, cdr)[0], stamp_of(cdr) * 1e-9
        sample = np.abs(rows[0] - stamp).argmin()
        values = message.position[1], message.velocity[1], message.effort[1]
        assert abs(rows[0, sample] - stamp) < 2e-9 and values == tuple(rows[[1, 2, 4], sample])
