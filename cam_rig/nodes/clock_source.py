"""Base class of drive and player, which publish the states of the cam."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64

from cam_rig.errors import ConfigError, RunError
from cam_rig.live.flow_control import FlowControl
from cam_rig.messages import topics
from cam_rig.messages.codec import CAM_JOINTS, stamp_ns
from cam_rig.nodes.base.diagnostics import ERROR, OK, WARN, Activity
from cam_rig.nodes.base.rig_node import RigNode, progress_text, scene_identity
from cam_rig.nodes.base.run_end import POLL_S, FinishedRun, find_endpoints, have_left
from cam_rig.nodes.convert import to_header, to_joint_state, to_time
from cam_rig.nodes.rig_state import RigState
from cam_rig.runner.node_table import OPTIONAL, WAIT, blocking_text, order_by_chain
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, to_rpm

#: Period (s, wall clock) of the check for missing optional consumers and for a run that waits
#: longer than the parameter progress_timeout.
CHECK_PERIOD_S = 0.1
#: Time (s, wall clock) without progress after which the reported activity names the nodes that are
#: waited for.
WAITING_AFTER_S = 1.0
#: Time (s, wall clock) for which a run waits if only optional consumers do not answer. Then it
#: continues without them. At most half of progress_timeout is waited.
MAX_OPTIONAL_WAIT_S = 15.0
#: Shortest period (ns) of the timer for the next state. rclpy rejects a period of zero.
MIN_TIMER_NS = 100_000
#: Topic with a stamp by which each consumer acknowledges a processed tick, the time between two cam
#: states.
ACKNOWLEDGEMENTS = {
    "follower": topics.FOLLOWER_STATE,
    "microphone": topics.PRESSURE,
    "recorder": topics.RECORDER_ACK,
    "law_server": topics.LAW_SERVER_ACK,
    "viewer": topics.VIEWER_ACK,
}


class SpeedLog:
    """Log lines on cam and speed, one line per steady speed or change of the cam."""

    def __init__(self) -> None:
        self._previous = self._logged = ("", 0.0)  # cam, speed in rad/s

    def update(self, state: CamState, is_commanded: bool) -> str:
        """Return the log line for a published cam state, or an empty string.

        There is a line if the cam or its steady speed has changed.
        """
        rpm = to_rpm(state.speed)
        current, previous = (state.cam, state.speed), self._previous
        self._previous = current
        is_ramping = current != previous and state.speed > 0.0
        if current == self._logged or is_ramping:
            return ""
        self._logged = current
        suffix = ", as commanded" if is_commanded else ""
        return f"turning {state.cam} at {rpm:.6g} rpm{suffix}" if rpm else "cam stopped"


class ClockSource(RigNode):
    """Node that generates rig time: the only publisher of /clock and /cam/state.

    A subclass creates a `FlowControl`, calls `start_flow`, and implements `send_next`, `is_done`
    and `pending_text`. `send_due` publishes all states that may be published now. It is called
    after each acknowledgement, by the timer for the next state of a paced run, and periodically.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._speed_log = SpeedLog()
        #: Rig time (ns) of the last message on /clock, and of the last published cam state.
        self.clock_ns = self.newest_ns = -1
        #: Cam state that was published last, None before the first.
        self.newest: CamState | None = None
        self._progress_at = time.monotonic()
        self._not_ready: set[str] = set()
        #: Names of consumers of the cam states that were connected and have left.
        self._absent: set[str] = set()
        # Created before the publisher of states, because DDS discovers them in this order: a node
        # that receives states also knows the publisher of the real-time factor.
        self._factor_publisher = self.advertise(topics.REAL_TIME_FACTOR)
        self._clock_publisher = self.advertise(topics.CLOCK)
        self._state_publisher = self.advertise(topics.CAM_STATE)

    # To be implemented by drive and player.

    def send_next(self) -> bool:
        """Publish the next cam state and return True, or return False if it must wait."""
        raise NotImplementedError

    def is_done(self) -> bool:
        """Return True if every cam state is published and every tick is acknowledged.

        A tick is the time between two states. The consumers acknowledge it when they have processed
        it.
        """
        raise NotImplementedError

    def pending_text(self) -> str:
        """Return the progress, and the nodes that are waited for, for an error text."""
        raise NotImplementedError

    def time_until_due(self) -> float:
        """Return the time (s, wall clock) until the next cam state is due.

        It is 0 in a free run, which has no real-time factor.
        """
        return 0.0

    def is_idle(self) -> bool:
        """Return True if the node waits for an operator or its pacing, not for a node."""
        return False

    @property
    def is_commanded(self) -> bool:
        """True if the cam turns at an operator's speed instead of that of the scene."""
        return False

    # Publishing of the states, as the acknowledgements of the consumers permit.

    @property
    def in_flight(self) -> int:
        """Number of published ticks that not every consumer has acknowledged."""
        return self._flow.in_flight

    def start_flow(self, consumers: list[str], flow: FlowControl) -> None:
        """Subscribe to the consumers' acknowledgements, and wait until all are ready.

        The states are published from then on.
        """
        self._flow, self._not_ready = flow, set(consumers)
        self._optional = OPTIONAL & self._not_ready
        for name in consumers:
            self.subscribe(
                ACKNOWLEDGEMENTS[name],
                partial(self._on_acknowledge, name),
                partial(self._on_publishers, name),
            )
        self.subscribe(topics.READY, self._on_ready)
        self._due_timer = self.create_wall_timer(1.0, self._on_due)
        self._due_timer.cancel()
        self._rig_state = RigState(self)
        self.create_wall_timer(CHECK_PERIOD_S, self._check_progress)
        self.get_logger().info(self.activity().text)

    def send_due(self) -> None:
        """Publish the cam states that may be published now.

        If no consumer answers for too long, the node fails.
        """
        if self.done.done():
            return
        while not self._not_ready and self.send_next():
            pass
        progress_timeout = self.settings["progress_timeout"]
        if self.is_done():
            self._report_progress(done=True)
            self.finish()
        elif self.is_idle():
            self._progress_at = time.monotonic()
        elif time.monotonic() - self._progress_at > progress_timeout:
            if self._not_ready:
                names = ", ".join(sorted(self._not_ready))
                text = f"not ready after {progress_timeout:g} s: {names}"
            else:
                text = f"no answer for {progress_timeout:g} s after {self.pending_text()}"
            self.fail(RunError(f"{text}; check if the node is running"))
        if (due := self.time_until_due()) > 0.0:
            # rclpy does not provide one-shot timers, so that _on_due cancels the timer
            self._due_timer.timer_period_ns = max(MIN_TIMER_NS, int(due * 1e9))
            self._due_timer.reset()
        self._rig_state.update()

    def _on_due(self) -> None:
        self._due_timer.cancel()
        self.send_due()

    def _on_acknowledge(self, name: str, message: Any) -> None:
        header = message.header if hasattr(message, "header") else message
        if self._flow.acknowledge(name, stamp_ns(header.stamp)):
            self._progress_at = time.monotonic()
        self.send_due()

    def _on_publishers(self, name: str, count: int) -> None:
        """Record if an optional consumer is absent, from the number of its publishers."""
        if count == 0:
            self._absent.add(name)
        else:
            self._absent.discard(name)

    def _on_ready(self, message: Any) -> None:
        name, _, identity = message.data.partition(" ")
        if name not in self._not_ready:
            return
        require_same_scene(name, identity, self.settings.get("scene", ""))
        self._not_ready.discard(name)
        self._progress_at = time.monotonic()
        missing = ", ".join(sorted(self._not_ready))
        text = f"waiting for {missing}" if missing else f"all ready, {self.activity().text}"
        self.get_logger().info(f"{name} is ready, {text}")
        self.send_due()

    def _check_progress(self) -> None:
        """Stop waiting for optional consumers that have left or do not answer."""
        if self.done.done():
            return
        waited = time.monotonic() - self._progress_at
        max_wait = min(MAX_OPTIONAL_WAIT_S, 0.5 * self.settings["progress_timeout"])
        missing = self._not_ready or set(self._flow.behind())
        is_overdue = bool(missing) and missing <= self._optional and waited > max_wait
        for name in list(self._optional):
            has_left = name not in self._not_ready and name in self._absent
            if has_left or is_overdue:
                self._optional -= {name}
                self._not_ready.discard(name)
                self._flow.drop(name)
                self.get_logger().warning(f"{name} does not answer; the run continues without it")
        self.send_due()

    def activity(self) -> Activity:
        """Return the current activity of the node for its heartbeat message."""
        if names := sorted(self._not_ready):
            return Activity("waiting", names, f"waiting for {', '.join(names)}")
        is_waiting = time.monotonic() - self._progress_at > WAITING_AFTER_S
        behind = self._flow.behind() if is_waiting else []
        if not behind:
            return Activity("turning", (), "turning")
        return Activity("waiting", order_by_chain(behind), f"waiting for {blocking_text(behind)}")

    # Published messages.

    def publish_state(self, state: CamState, torque: float) -> None:
        """Publish a cam state, its rig time and the shaft torque (N m)."""
        self.newest_ns = state.time_ns
        self.publish_time(state.time_ns)
        joints = {
            name: (angle, state.speed, torque)
            for name, angle in zip(CAM_JOINTS, (state.unwrapped, state.angle), strict=True)
        }
        header = to_header(state.time_ns, state.cam)
        self._state_publisher.publish(to_joint_state(header, **joints))

    def publish_factor(self, factor: float | None) -> None:
        """Publish the real-time factor of the run, 0 for a free run (as fast as possible)."""
        self._factor_publisher.publish(Float64(data=factor or 0.0))

    def publish_time(self, time_ns: int) -> None:
        """Publish a rig time (ns) on /clock, unless /clock has reached it already."""
        if time_ns > self.clock_ns:
            self.clock_ns = time_ns
            self._clock_publisher.publish(Clock(clock=to_time(time_ns)))

    def report_sent(self, state: CamState, tick: int) -> None:
        """Report a published cam state to the runner, and log a new speed.

        `tick` is the number of ticks (times between two states) up to the state.
        """
        self._progress_at, self.ticks, self.newest = time.monotonic(), tick, state
        seconds = state.time_ns / NS
        self._report_progress(tick=tick, cam=state.cam, rpm=to_rpm(state.speed), time=seconds)
        if text := self._speed_log.update(state, self.is_commanded):
            self.get_logger().info(text)

    def _report_progress(self, **values: Any) -> None:
        """Write a line of JSON into the runner's pipe, if there is a runner."""
        if self.settings["progress_fd"] >= 0:
            with suppress(OSError):  # the runner has ended, and this node is about to end
                os.write(self.settings["progress_fd"], json.dumps(values).encode() + b"\n")

    def summary(self) -> str:
        """Return the text that is logged when the node ends without an error."""
        return progress_text(self.ticks, self.total_ticks, self.is_done())

    # End of the run.

    def monitor_run_end(self) -> None:
        """Create the publisher of /rig/finished: the run ends with this node."""
        self._finished_publisher, self._is_bag_closed = self.advertise(topics.FINISHED), False
        self.subscribe(topics.CLOSED, self._on_closed)

    def _on_closed(self, _message: Any) -> None:
        self._is_bag_closed = True

    def drain(self, spin_once: Callable[..., None]) -> None:
        """Process messages in transit, unless every tick is acknowledged already.

        A tick is the time between two cam states.
        """
        if not self.is_done():
            super().drain(spin_once)

    def conclude(self, spin_once: Callable[..., None]) -> None:
        """Publish the end of the run, and wait until the recorder has closed its bag."""
        level, text = WARN, "stopped"
        if self.failure is not None:
            level, text = ERROR, str(self.failure)
        elif self.is_done():
            level, text = OK, "done"
        run = FinishedRun(level, text, self.ticks, max(0, self.newest_ns))
        self._is_bag_closed = False
        self.remember_endpoints()
        self._finished_publisher.publish(run.to_message(self.get_name()))
        self._rig_state.publish_end(level, text)
        if self.settings["on_finish"] == WAIT:
            return
        signals, progress_timeout = self.interrupts, self.settings["progress_timeout"]
        deadline = time.monotonic() + progress_timeout
        recorder = find_endpoints(self, self.resolve_topic_name(topics.CLOSED.relative))
        while not (self._is_bag_closed or have_left(self, recorder) or self.interrupts > signals):
            if time.monotonic() > deadline:
                text = f"the recorder has not closed its bag within {progress_timeout:g} s"
                self.get_logger().warning(text)
                return
            spin_once(timeout_sec=POLL_S)


def require_same_scene(node: str, identity: str, scene: str) -> None:
    """Raise ConfigError if a node was started with another scene than the drive.

    `identity` is the node's `scene_identity`, `scene` the drive's file. A node without a scene is
    accepted, as are the consumers of a player, whose scene is in the bag.
    """
    expected = scene_identity(scene)
    if not (identity and expected) or identity == expected:
        return
    theirs, ours = identity.partition("#")[0], expected.partition("#")[0]
    other = "another file of that name" if theirs == ours else theirs
    raise ConfigError(
        f"scene must be the same for all nodes, got {ours} for the drive and {other} for {node}; "
        f"start each node with -p scene:={ours}"
    )
