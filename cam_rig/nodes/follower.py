"""The follower: takes the cam's states, publishes the follower's motion between them."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from threading import Event, Lock, Thread
from typing import NamedTuple

import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray

from cam_rig.dynamics import Block, FollowerState
from cam_rig.errors import DynamicsError
from cam_rig.live.law_server import require_own_law
from cam_rig.live.playback import Playback, Shown, Tick
from cam_rig.live.queues import FollowerQueue
from cam_rig.live.state_validation import Admission
from cam_rig.messages import topics
from cam_rig.messages.codec import (
    array_of,
    cam_state_of,
    decode_law,
    encode_block,
    real_time_factor,
)
from cam_rig.messages.motion import OF_FOLLOWER, DerivedMessage, MotionMessages
from cam_rig.messages.topics import Topic, motion_depth
from cam_rig.nodes.convert import (
    OK,
    WARN,
    ResendBuffer,
    to_array,
    to_diagnosis,
    to_header,
    to_joint_state,
)
from cam_rig.nodes.rig_node import RigNode
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import CamState
from cam_rig.simulation.simulate import FollowerSimulator
from cam_rig.units import FloatArray, to_rpm

# The motion for people: evenly in wall time at a run's own pace, else a tick at once.

#: Wall time (s) for which a topic is left out that a subscriber holds up: each try takes 0.1 s.
LEFT_OUT_S = 1.0
#: Wall time (s) between two reports of how far the motion is behind the drive.
REPORT_S = 1.0
#: Instants of a tick, at most, whose messages are made at once, in little more time than one.
AT_ONCE = 16


class _Instant(NamedTuple):
    """What is to be published at one time, and its place in what was looked up ahead."""

    shown: Shown
    place: int
    messages: list[DerivedMessage]


class MotionPublisher:
    """Publishes a tick's instants while somebody subscribes; who joins later sees the next tick.

    Of a paced run a thread publishes them one by one, so that the work on the next tick holds none
    up; of a free one they go out with the tick. ``points`` a turn are those of a free run, ``rate``
    a wall second those of a paced one.
    """

    def __init__(self, node: RigNode, motion: MotionMessages, points: int, rate: float) -> None:
        self._node, self._motion, self._period = node, motion, 1.0 / rate
        depth = motion_depth(points)
        self._out = {t: node.publisher(replace(t, depth=depth)) for t in motion.topics}
        self._left_out = dict.fromkeys(motion.topics, 0.0)
        self._playback = Playback(motion.sample_rate)
        self._factor: float | None = None
        self._lock, self._ended = Lock(), Event()
        self._thread = Thread(target=self._show, daemon=True)
        self._reports = node.publisher(replace(topics.DIAGNOSTICS, depth=1))
        self._reported_ns = -1
        node.subscribe(topics.REAL_TIME_FACTOR, self._on_factor)
        node.every(REPORT_S, self._report)

    def publish(self, tick: Tick, came: float) -> None:
        """Publish a finished tick, whose last state came at a wall time (s)."""
        topic = topics.REAL_TIME_FACTOR.relative
        # a drive tells its pace at once; where a bag is played by others there is none that does
        is_early = self._factor is None and self._node.count_publishers(topic)
        if not (wanted := self._wanted()) or is_early:
            return
        if not self._factor:
            self._send(self._motion.moved(*tick, wanted), wanted)
            return
        with self._lock:
            self._playback.add(tick, self._factor, came, time.monotonic())
        if not self._thread.is_alive():
            self._thread.start()

    def close(self) -> None:
        """Publish nothing more."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()

    def _on_factor(self, message: Float64) -> None:
        self._factor = real_time_factor(message.data)
        if not self._factor:
            with self._lock:
                self._playback.clear()

    def _show(self) -> None:
        """Publish what is to be seen at each period's end, until closed."""
        due, batch, version = time.monotonic(), deque[_Instant](), -1
        periods: FloatArray = self._period * np.arange(AT_ONCE, dtype=np.float64)
        while not self._ended.wait(max(0.0, due - time.monotonic())):
            with self._lock:
                is_over = not batch or version != self._playback.version
                version = self._playback.version
                ahead = self._playback.ahead(due + periods) if is_over else None
            if is_over:
                batch = deque(self._made(ahead) if ahead is not None else ())
            instant = None
            while batch and batch[0].shown.walls[batch[0].place] < due + 0.5 * self._period:
                instant = batch.popleft()
            if instant is not None:
                with self._lock:
                    self._playback.note_shown(instant.shown, instant.place)
                self._send(instant.messages, self._free(), is_alone=True)
            missed = (time.monotonic() - due) // self._period
            due += self._period * (1.0 + missed)

    def _made(self, shown: Shown) -> Iterator[_Instant]:
        messages = self._motion.moved(*shown.tick, self._wanted(), shown.samples)
        for place, (_, found) in enumerate(groupby(messages, attrgetter("time_ns"))):
            yield _Instant(shown, place, list(found))

    def _wanted(self) -> set[Topic]:
        return {topic for topic in self._free() if self._out[topic].get_subscription_count() > 0}

    def _free(self) -> set[Topic]:
        now = time.monotonic()
        return {topic for topic, until in self._left_out.items() if until <= now}

    def _send(
        self, messages: list[DerivedMessage], wanted: set[Topic], is_alone: bool = False
    ) -> None:
        """Publish the messages of a tick, or those of one instant that ``is_alone``."""
        for topic, _, cdr in messages:
            if topic in wanted and not self._out[topic].offer(cdr):
                wanted.discard(topic)  # the rest of this tick would be held up as well
                if is_alone:
                    self._left_out[topic] = time.monotonic() + LEFT_OUT_S
                self._say_who_holds(topic, f"{LEFT_OUT_S:g} s" if is_alone else "a tick")

    def _report(self) -> None:
        """Say how far what is shown is behind the drive, while it moves."""
        with self._lock:
            lag, time_ns = self._playback.lag, self._playback.shown_ns
        if time_ns == self._reported_ns:
            return
        self._reported_ns = time_ns
        values = {"lag_s": f"{lag:.3g}", "rate_hz": f"{1.0 / self._period:g}"}
        words = f"shown {lag:.3f} s behind the drive"
        self._reports.publish(to_diagnosis(time_ns, topics.SHOWN_MOTION, OK, words, values))

    def _say_who_holds(self, topic: Topic, how_long: str) -> None:
        infos = self._node.get_subscriptions_info_by_topic(topic.relative)
        nodes = {f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos}
        words = f"{topic.name}: left out for {how_long}, as one of its subscribers does not keep up"
        words += f": {', '.join(sorted(nodes))}"
        self._node.get_logger().warning(words, throttle_duration_sec=10.0)


class Follower(RigNode):
    """Publishes /follower/samples and /follower/state for each tick, and its motion for people."""

    waits_for = ("cam_drive", "law_server")

    def __init__(self) -> None:
        super().__init__("follower")
        self._loaded = open_scene(Path(self.given["scene"]))
        simulator = FollowerSimulator.of(self._loaded)
        simulator.laws.clear()  # the law that the law server publishes counts, not the file's
        predecessor = next(iter(self.restore()), None)
        self._ticks = FollowerQueue(simulator, self._loaded.scene, predecessor)
        self.save(self._ticks.checkpoint, -1)  # to go back to before the first tick
        out = (topics.FOLLOWER_SAMPLES, topics.FOLLOWER_STATE)
        self._out, self._sent = [self.publisher(topic) for topic in out], ResendBuffer()
        points = self.given["points_per_turn"] or self._loaded.scene.points_per_turn
        motion, rate = MotionMessages(self._loaded, points, OF_FOLLOWER), self.given["motion_rate"]
        self._motion, self._came = MotionPublisher(self, motion, points, rate), 0.0
        self.subscribe(topics.LAW_COEFFICIENTS, self._on_law)
        self.subscribe(topics.CAM_STATE, self._on_state)
        self.get_logger().info(self.activity().words)

    def _on_law(self, message: Float64MultiArray) -> None:
        law = decode_law(*array_of(message))
        require_own_law(self._loaded, law)
        self._ticks.add_law(law)
        self._turn()

    def _on_state(self, message: JointState) -> None:
        state, self._came = cam_state_of(message), time.monotonic()
        if self._ticks.add_state(state) is Admission.SEEN:
            self._sent.resend(state.time_ns)
        self._turn()

    def _turn(self) -> None:
        try:
            for start, end, state, block in self._ticks.complete():
                self.ticks += 1
                self._motion.publish(Tick(start, end, block.rows), self._came)
                self._publish(end, state, block)
                self.save(self._ticks.checkpoint, end.time_ns)
        except DynamicsError as error:
            self.fail(error)

    def _publish(self, end: CamState, state: FollowerState, block: Block) -> None:
        lost = bool(block.events) or not state.in_contact
        values = {"rpm": f"{to_rpm(block.interval.speed):.6g}"}
        words = "contact lost" if lost else "in contact"
        self.health.report(end.time_ns, WARN if lost else OK, words, values)
        header = to_header(end.time_ns, "follower")
        motion = (state.displacement, state.velocity, state.contact_force)
        messages = (
            to_array(*encode_block(block.rows)),
            to_joint_state(header, follower=motion),
        )
        self._sent.publish(end.time_ns, list(zip(self._out, messages, strict=True)))

    def close(self) -> None:
        """End with what is shown."""
        self._motion.close()
