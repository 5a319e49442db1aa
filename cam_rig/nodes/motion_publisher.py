"""Publisher of the follower's motion for RViz, Foxglove and the panel."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import replace
from itertools import groupby
from operator import attrgetter
from threading import Event, Lock, Thread
from typing import NamedTuple

import numpy as np
from std_msgs.msg import Float64

from cam_rig.live.playback import Playback, PlaybackSamples, Tick
from cam_rig.messages import topics
from cam_rig.messages.codec import real_time_factor
from cam_rig.messages.motion import DerivedMessage, MotionMessages
from cam_rig.messages.topics import Topic, motion_depth
from cam_rig.nodes.base.diagnostics import OK, make_diagnostics
from cam_rig.nodes.base.rig_node import RigNode
from cam_rig.units import FloatArray

#: Time (s, wall clock) for which a topic is not published after a slow subscriber has blocked its
#: writer. It limits the lost time, because each attempt to publish blocks for 0.1 s.
SKIP_S = 1.0
#: Period (s, wall clock) at which the delay of the playback behind the drive is reported.
REPORT_PERIOD_S = 1.0
#: Maximum number of instants whose messages are prepared together. One call for 16 instants takes
#: little longer than one call for a single instant.
MAX_BATCH = 16


class Instant(NamedTuple):
    """Messages for one instant of the motion.

    It also has the index of the instant's sample in `samples`.
    """

    samples: PlaybackSamples
    sample_index: int
    messages: list[DerivedMessage]


class MotionPublisher:
    """Publishes the motion within each tick while it has subscribers.

    In a free run the messages of a tick are published together, at `points` instants per turn. In a
    paced run a playback thread publishes them one by one, at `rate` instants per second of wall
    time, so that the computation of the next tick does not delay them. A tick is the time between
    two cam states.

    Threads: `publish`, `close` and the callbacks run on the thread of the executor, `_play` and the
    methods that it calls on the playback thread. `_lock` protects `_playback`, which both threads
    use. It is always released before a publish call. `_skipped_until` is read by both threads and
    written per topic in one assignment, which needs no lock.
    """

    def __init__(self, node: RigNode, motion: MotionMessages, points: int, rate: float) -> None:
        self._node, self._motion, self._period = node, motion, 1.0 / rate
        depth = motion_depth(points)
        self._publishers = {
            topic: node.advertise(replace(topic, depth=depth)) for topic in motion.topics
        }
        self._skipped_until = dict.fromkeys(motion.topics, 0.0)
        self._factor: float | None = None
        self._playback = Playback(motion.sample_rate)
        self._lock = Lock()
        self._closed = Event()
        self._thread = Thread(target=self._play, daemon=True)
        self._report_publisher = node.advertise(replace(topics.DIAGNOSTICS, depth=1))
        self._reported_ns = -1
        node.subscribe(topics.REAL_TIME_FACTOR, self._on_factor)
        node.create_wall_timer(REPORT_PERIOD_S, self._report)

    def publish(self, tick: Tick, received_at: float) -> None:
        """Publish the motion of a finished tick, the time between two cam states.

        Its last state was received at `received_at` (s, monotonic clock).
        """
        wanted = self._subscribed_topics()
        # A drive publishes its real-time factor at once. A bag played by ros2 bag play may not
        # have a publisher of it, and is shown like a free run.
        name = topics.REAL_TIME_FACTOR.relative
        is_factor_pending = self._factor is None and self._node.count_publishers(name) > 0
        if not wanted or is_factor_pending:
            return
        if not self._factor:
            self._publish(self._motion.of_tick(*tick, wanted), wanted, is_paced=False)
            return
        with self._lock:
            self._playback.add(tick, self._factor, received_at, time.monotonic())
        if not self._thread.is_alive():
            self._thread.start()

    def close(self) -> None:
        """Stop the thread that plays back the motion of the follower."""
        self._closed.set()
        if self._thread.is_alive():
            self._thread.join()

    def _on_factor(self, message: Float64) -> None:
        self._factor = real_time_factor(message.data)
        if not self._factor:
            with self._lock:
                self._playback.clear()

    def _play(self) -> None:
        """Publish the messages of one instant per period until closed (playback thread).

        The instants are prepared in batches. A batch becomes invalid when a tick is added, because
        the playback position then changes; `Playback.version` counts these changes.
        """
        due, batch, version = time.monotonic(), deque[Instant](), -1
        offsets: FloatArray = self._period * np.arange(MAX_BATCH, dtype=np.float64)
        while not self._closed.wait(max(0.0, due - time.monotonic())):
            with self._lock:
                is_used_up = not batch or version != self._playback.version
                version = self._playback.version
                samples = self._playback.samples_at(due + offsets) if is_used_up else None
            if is_used_up:
                batch = deque(self._prepare(samples) if samples is not None else ())
            instant = None
            while (
                batch
                and batch[0].samples.wall_times[batch[0].sample_index] < due + 0.5 * self._period
            ):
                instant = batch.popleft()
            if instant is not None:
                with self._lock:
                    self._playback.record_shown(instant.samples, instant.sample_index)
                self._publish(instant.messages, self._responsive_topics(), is_paced=True)
            missed_periods = (time.monotonic() - due) // self._period
            due += self._period * (1.0 + missed_periods)

    def _prepare(self, samples: PlaybackSamples) -> list[Instant]:
        """Return the messages of the subscribed topics for samples of the motion.

        They are grouped by instant.
        """
        messages = self._motion.of_tick(*samples.tick, self._subscribed_topics(), samples.indices)
        groups = groupby(messages, attrgetter("time_ns"))
        return [Instant(samples, index, list(group)) for index, (_, group) in enumerate(groups)]

    def _responsive_topics(self) -> set[Topic]:
        """Return the topics without a slow subscriber.

        A topic whose subscriber has blocked the writer is skipped for some time (see `SKIP_S`).
        """
        now = time.monotonic()
        return {topic for topic, until in self._skipped_until.items() if until <= now}

    def _subscribed_topics(self) -> set[Topic]:
        return {
            topic
            for topic in self._responsive_topics()
            if self._publishers[topic].get_subscription_count() > 0
        }

    def _publish(self, messages: list[DerivedMessage], wanted: set[Topic], is_paced: bool) -> None:
        """Publish messages of the `wanted` topics.

        A blocked topic is skipped for the rest of the tick, or for `SKIP_S` in a paced run. A tick
        is the time between two cam states.
        """
        for topic, _, cdr in messages:
            if topic not in wanted or self._publishers[topic].try_publish(cdr):
                continue
            wanted.discard(topic)
            if is_paced:
                self._skipped_until[topic] = time.monotonic() + SKIP_S
            infos = self._node.get_subscriptions_info_by_topic(topic.relative)
            nodes = {f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos}
            duration = f"{SKIP_S:g} s" if is_paced else "a tick"
            self._node.get_logger().warning(
                f"{topic.name}: skipped for {duration} because a subscriber does not keep up; "
                f"subscribers: {', '.join(sorted(nodes))}",
                throttle_duration_sec=10.0,
            )

    def _report(self) -> None:
        """Publish the delay of the playback behind the drive.

        Nothing is published unless a new sample was displayed.
        """
        with self._lock:
            lag, time_ns = self._playback.lag, self._playback.shown_ns
        if time_ns == self._reported_ns:
            return
        self._reported_ns = time_ns
        values = {"lag_s": f"{lag:.3g}", "rate_hz": f"{1.0 / self._period:g}"}
        text = f"shown {lag:.3f} s behind the drive"
        message = make_diagnostics(time_ns, topics.SHOWN_MOTION, OK, text, values)
        self._report_publisher.publish(message)
