"""What the drive and the player share: states go out as the consumers' acknowledgements allow."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64

from cam_rig.errors import RunError
from cam_rig.live.flow_control import FlowControl
from cam_rig.messages import topics
from cam_rig.messages.codec import CAM_JOINTS, stamp_ns
from cam_rig.nodes.convert import ERROR, OK, WARN, Activity, to_header, to_joint_state, to_time
from cam_rig.nodes.rig_node import RigNode, require_one_scene
from cam_rig.nodes.run_end import POLL_S, FinishedRun, have_left, publishers
from cam_rig.runner.node_table import OPTIONAL, WAIT, held_by, in_chain
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, to_rpm

#: Wall time (s) without an answer after which the states in flight are sent again. Each time it is
#: twice as long, up to the second: their number is bounded (`RepeatBudget`).
RESEND_AFTER_S, RESEND_AT_LEAST_S = 2.0, 30.0
#: Wall time (s) without an answer after which a heartbeat says who is waited for.
HELD_AFTER_S = 1.0
#: The nodes that may be waited for, and the stamped topic by which each acknowledges.
ACKNOWLEDGES = {
    "follower": topics.FOLLOWER_STATE,
    "microphone": topics.PRESSURE,
    "recorder": topics.RECORDED,
    "law_server": topics.FOLLOWED,
    "viewer": topics.SHOWN,
}
#: Wall time (s) that consumers which a run can go on without are waited for alone.
OPTIONAL_PATIENCE_S = 15.0


class SpeedReport:
    """The speed now, and a line for each steady one: of a ramp, for where it leads."""

    def __init__(self) -> None:
        #: Of the last state, rpm.
        self.rpm = 0.0
        self._before = self._reported = ("", 0.0)

    def note(self, state: CamState, commanded: bool) -> str:
        """Note a state that went out; what there is to say."""
        self.rpm = to_rpm(state.speed)
        now, before = (state.cam, state.speed), self._before
        self._before = now
        if now == self._reported or (now != before and state.speed > 0.0):
            return ""
        self._reported = now
        how = ", as commanded" if commanded else ""
        return f"turning {state.cam} at {self.rpm:.6g} rpm{how}" if self.rpm else "the cam stands"


class ClockSource(RigNode):
    """The node that makes rig time: the only one on /clock and /cam/state."""

    def __init__(self, name: str) -> None:
        self.speed = SpeedReport()
        super().__init__(name)
        self._moved = self._repeated = time.monotonic()
        #: Rig time (ns) that /clock has come to, and that of the newest state.
        self.clock_ns = self.newest_ns = -1
        self._awaited: set[str] = set()
        # before the states' publisher, so that whoever is discovered by them knows it
        self._factor_out = self.publisher(topics.REAL_TIME_FACTOR)
        self._clock_out, self._state_out = map(self.publisher, (topics.CLOCK, topics.CAM_STATE))

    def listen_for_end(self) -> None:
        """It is this node that says when the run is over."""
        self._finished, self._bag_is_closed = self.publisher(topics.FINISHED), False
        self.subscribe(topics.CLOSED, self._on_closed)

    def begin(self, consumers: list[str], flow: FlowControl) -> None:
        """Subscribe to the consumers' acknowledgements, and turn when all are ready."""
        self._flow, self._awaited = flow, set(consumers)
        self._optional = OPTIONAL & self._awaited
        for name in consumers:
            self.subscribe(ACKNOWLEDGES[name], self._on_acknowledge(name))
        self.subscribe(topics.READY, self._on_ready)
        self._alarm = self.every(1.0, self._on_alarm)
        self._alarm.cancel()
        self.every(0.1, self._on_timer)
        self.get_logger().info(self.activity().words)

    def activity(self) -> Activity:
        """What the node does now."""
        if names := sorted(self._awaited):
            return Activity("waiting", names, f"waiting for {', '.join(names)}")
        behind = self._flow.behind() if time.monotonic() - self._moved > HELD_AFTER_S else []
        if not behind:
            return Activity("turning", (), "turning")
        return Activity("waiting", in_chain(behind), f"waiting for {held_by(behind)}")

    def send_next(self) -> bool:
        """Send the next state, if it may go out; False when it may not."""
        raise NotImplementedError

    @property
    def is_commanded(self) -> bool:
        """Whether the cam turns at another speed than the scene's."""
        return False

    def resend(self) -> None:
        """Send once more what no node has answered; it may be lost to queue overflow."""

    def next_due(self) -> float:
        """Wall time (s) until the next state is due; zero when it waits for a node."""
        return 0.0

    def is_done(self) -> bool:
        """Whether nothing is left to do."""
        raise NotImplementedError

    def is_idle(self) -> bool:
        """Whether no node is waited for."""
        return False

    def stuck(self) -> str:
        """What is missing, in words."""
        raise NotImplementedError

    def turn(self) -> None:
        """Send what may be sent now; nothing before every consumer is ready."""
        if self.done.done():
            return
        while not self._awaited and self.send_next():
            pass
        if self.is_done():
            self._report_progress(done=True)
            self.finish()
        elif self.is_idle():
            self._moved = time.monotonic()
        elif time.monotonic() - self._moved > self.given["patience"]:
            self.fail(self._stuck_error())
        if (due := self.next_due()) > 0.0:
            self._alarm.timer_period_ns = max(100_000, int(due * 1e9))
            self._alarm.reset()

    def drain(self, spin_once: Callable[..., None]) -> None:
        """Take what has arrived but was not taken yet: nothing, where all is acknowledged."""
        if not self.is_done():
            super().drain(spin_once)

    def _on_closed(self, _message: Any) -> None:
        self._bag_is_closed = True

    def conclude(self, spin_once: Callable[..., None]) -> None:
        """Say that the run is over, and how; wait until the recorder has closed its bag or left."""
        level, words = WARN, "stopped"
        if self.failure is not None:
            level, words = ERROR, str(self.failure)
        elif self.is_done():
            level, words = OK, "done"
        run = FinishedRun(level, words, self.ticks, max(0, self.newest_ns))
        self._bag_is_closed, message = False, run.message(self.get_name())
        self.remember_publishers()
        self._finished.publish(message)
        if self.given["at_end"] == WAIT:
            return
        signals, patience = self.interrupts, self.given["patience"]
        deadline = time.monotonic() + patience
        recorder = publishers(self, self.resolve_topic_name(topics.CLOSED.relative))
        while not (self._bag_is_closed or have_left(self, recorder) or self.interrupts > signals):
            if time.monotonic() > deadline:
                words = f"the recorder has not closed its bag within {patience:g} s"
                self.get_logger().warning(words)
                return
            spin_once(timeout_sec=POLL_S)
            self._finished.publish(message)  # one may be lost to queue overflow

    def _stuck_error(self) -> RunError:
        patience = self.given["patience"]
        if self._awaited:
            names = ", ".join(sorted(self._awaited))
            return RunError(f"not ready after {patience:g} s: {names}; is it running?")
        return RunError(f"no answer for {patience:g} s after {self.stuck()}; is it running?")

    def publish_state(self, state: CamState, torque: float) -> None:
        """Send a state of the cam, and its time unless /clock would go back: it is sent again."""
        self.newest_ns = max(self.newest_ns, state.time_ns)
        self.publish_time(state.time_ns)
        joints = {
            name: (angle, state.speed, torque)
            for name, angle in zip(CAM_JOINTS, (state.unwrapped, state.angle), strict=True)
        }
        self._state_out.publish(to_joint_state(to_header(state.time_ns, state.cam), **joints))

    def publish_factor(self, factor: float | None) -> None:
        """Publish rig seconds a wall second; None of a free run."""
        self._factor_out.publish(Float64(data=factor or 0.0))

    def publish_time(self, time_ns: int) -> None:
        """Publish a rig time, unless /clock has come to it."""
        if time_ns > self.clock_ns:
            self.clock_ns = time_ns
            self._clock_out.publish(Clock(clock=to_time(time_ns)))

    def note_sent(self, state: CamState, tick: int) -> None:
        """Note that a state went out, and report it to the runner."""
        self._moved, self.ticks = time.monotonic(), tick
        seconds = state.time_ns / NS
        self._report_progress(tick=tick, cam=state.cam, rpm=to_rpm(state.speed), time=seconds)
        if words := self.speed.note(state, self.is_commanded):
            self.get_logger().info(words)

    def _report_progress(self, **values: Any) -> None:
        """Write a line of JSON into the runner's pipe, if there is one."""
        if self.given["progress_fd"] >= 0:
            with suppress(OSError):  # the runner has ended, and this node is about to
                os.write(self.given["progress_fd"], json.dumps(values).encode() + b"\n")

    def _on_alarm(self) -> None:
        self._alarm.cancel()
        self.turn()

    def _on_acknowledge(self, name: str) -> Callable[[Any], None]:
        def acknowledge(message: Any) -> None:
            header = message.header if hasattr(message, "header") else message
            if self._flow.acknowledge(name, stamp_ns(header.stamp)):
                self._moved = time.monotonic()
            self.turn()

        return acknowledge

    def _on_ready(self, message: Any) -> None:
        name, _, scene = message.data.partition(" ")
        if name in self._awaited:
            require_one_scene(name, scene, self.given.get("scene", ""))
            self._awaited.discard(name)
            self._moved = time.monotonic()
            missing = ", ".join(sorted(self._awaited))
            rest = (
                f"waiting for {missing}" if missing else f"all are ready, {self.activity().words}"
            )
            self.get_logger().info(f"{name} is ready, {rest}")
            self.turn()

    def _on_timer(self) -> None:
        if self.done.done():
            return
        now = time.monotonic()
        pause = min(max(RESEND_AFTER_S, self._repeated - self._moved), RESEND_AT_LEAST_S)
        if now - max(self._moved, self._repeated) > pause:
            self._repeated = now
            self.resend()
        for name in [name for name in self._optional if self._has_left(name, now - self._moved)]:
            self._optional -= {name}
            self._awaited.discard(name)
            self._flow.drop(name)
            self.get_logger().warning(f"{name} does not answer; the run goes on without it")
        self.turn()

    def _has_left(self, name: str, waited: float) -> bool:
        """Whether an optional consumer has ended, or alone has been waited for too long (s)."""
        if name not in self._awaited and not self.count_publishers(ACKNOWLEDGES[name].relative):
            return True
        missing = self._awaited or set(self._flow.behind())
        patience = min(OPTIONAL_PATIENCE_S, 0.5 * self.given["patience"])
        return bool(missing) and missing <= self._optional and waited > patience
