"""What the drive and the player share: states go out as the consumers' answers allow."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

from rosgraph_msgs.msg import Clock

from cam_rig.errors import RunError
from cam_rig.live.flow_control import FlowControl
from cam_rig.messages import topics
from cam_rig.messages.codec import stamp_ns
from cam_rig.nodes.common.base import RigNode
from cam_rig.nodes.common.convert import to_cam_state, to_header, to_time
from cam_rig.simulation.schedule import CamState
from cam_rig.units import to_rpm

#: Wall time (s) without an answer after which the states in flight are said again.
SAY_AGAIN = 2.0
#: Who may be waited for, and the stamped topic that shows how far each is.
ACKNOWLEDGES = {
    "follower": topics.FOLLOWER_STATE,
    "microphone": topics.PRESSURE,
    "recorder": topics.RECORDED,
    "law_server": topics.FOLLOWED,
    "viewer": topics.SHOWN,
}


class Pacemaker(RigNode):
    """A node that says what time it is: the only one on /clock and /cam/state."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._moved = self._repeated = time.monotonic()
        #: Rig time (ns) that /clock has come to.
        self.clock_ns = -1
        self._clock_out, self._state_out = map(self.publisher, (topics.CLOCK, topics.CAM_STATE))

    def set_going(self, consumers: list[str], credit: FlowControl) -> None:
        """Begin: listen to the consumers, and turn when all are ready."""
        self._credit, self._awaited = credit, set(consumers)
        for name in consumers:
            self.subscribe(ACKNOWLEDGES[name], self._on_acknowledge(name))
        self.subscribe(topics.READY, self._on_ready)
        self._alarm = self.every(1.0, self._on_alarm)
        self._alarm.cancel()
        self.every(0.1, self._on_timer)
        self.get_logger().info(f"waiting for {', '.join(sorted(self._awaited))}")

    def send_next(self) -> bool:
        """Send the next state, if it may go out; False when it may not."""
        raise NotImplementedError

    def say_again(self) -> None:
        """Send once more what nobody has answered; a flood of others may have swept it away."""

    def next_due(self) -> float:
        """Wall time (s) until the next state is due; zero when it waits for somebody."""
        return 0.0

    def is_done(self) -> bool:
        """Whether nothing is left to do."""
        raise NotImplementedError

    def is_idle(self) -> bool:
        """Whether nobody is waited for."""
        return False

    def stuck(self) -> str:
        """What is missing, in words."""
        raise NotImplementedError

    def turn(self) -> None:
        """Send what may be sent now; nothing before everybody is ready."""
        while not (self._awaited or self.done.done()) and self.send_next():
            pass
        if self.is_done():
            if self.given["report_progress"] and not self.done.done():
                print(json.dumps({"done": True}), flush=True)
            self.finish()
        elif self.is_idle():
            self._moved = time.monotonic()
        elif time.monotonic() - self._moved > self.given["patience"]:
            self.fail(self._stuck_error())
        if (due := self.next_due()) > 0.0:
            self._alarm.timer_period_ns = max(100_000, int(due * 1e9))
            self._alarm.reset()

    def _stuck_error(self) -> RunError:
        patience = self.given["patience"]
        if self._awaited:
            names = ", ".join(sorted(self._awaited))
            return RunError(f"not ready after {patience:g} s: {names}; is it running?")
        return RunError(f"no answer for {patience:g} s after {self.stuck()}; is it running?")

    def publish_state(self, state: CamState, torque: float) -> None:
        """Send a state of the cam, and its time, unless /clock would go back: it is said again."""
        header = to_header(state.time_ns, state.cam)
        if state.time_ns >= self.clock_ns:
            self.clock_ns = state.time_ns
            self._clock_out.publish(Clock(clock=to_time(state.time_ns)))
        self._state_out.publish(to_cam_state(header, state, torque))

    def note_sent(self, state: CamState, tick: int) -> None:
        """Note that a state went out, and tell who started us."""
        self._moved = time.monotonic()
        if self.given["report_progress"]:
            rpm = to_rpm(state.speed)
            print(json.dumps({"tick": tick, "cam": state.cam, "rpm": rpm}), flush=True)

    def _on_alarm(self) -> None:
        self._alarm.cancel()
        self.turn()

    def _on_acknowledge(self, name: str) -> Callable[[Any], None]:
        def acknowledge(message: Any) -> None:
            header = message.header if hasattr(message, "header") else message
            if self._credit.acknowledge(name, stamp_ns(header.stamp)):
                self._moved = time.monotonic()
            self.turn()

        return acknowledge

    def _on_ready(self, message: Any) -> None:
        if message.frame_id in self._awaited:
            self._awaited.discard(message.frame_id)
            self._moved = time.monotonic()
            missing = ", ".join(sorted(self._awaited))
            rest = f"waiting for {missing}" if missing else "all are ready"
            self.get_logger().info(f"{message.frame_id} is ready, {rest}")
            self.turn()

    def _on_timer(self) -> None:
        now = time.monotonic()
        if now - max(self._moved, self._repeated) > SAY_AGAIN:
            self._repeated = now
            self.say_again()
        self.turn()
