"""Drive node: turns the cam at the pace of the slowest consumer."""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray

from cam_rig.dynamics.kinetostatic import shaft_torque
from cam_rig.errors import RefusedError, RunError
from cam_rig.live.drive import DriveProgram
from cam_rig.live.flow_control import MIN_PACE_WINDOW_S, PACE_WINDOW_S, LostTime
from cam_rig.live.law_server import require_own_law
from cam_rig.messages import topics
from cam_rig.messages.codec import CAM_JOINTS, array_of, decode_law
from cam_rig.nodes.base.diagnostics import ERROR, OK, WARN, Activity, Diagnostics
from cam_rig.nodes.base.rig_node import RigNode
from cam_rig.nodes.clock_source import ClockSource
from cam_rig.runner.node_table import blocking_text, order_by_chain
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import CamState
from cam_rig.units import RPM

#: Rate (Hz, wall clock) of /clock in a paced run. A busy machine reaches about 100 Hz.
CLOCK_HZ = 125.0
#: Period (s, wall clock) at which a paced run that waits counts the node that it waits for.
WAIT_SAMPLE_S = 0.1
#: Name of the law server's node in the drive's namespace.
LAW_SERVER = "law_server"


class DriveControls:
    """Operator commands: the services of the drive, its live parameters and /cam/rpm."""

    def __init__(self, node: CamDrive) -> None:
        self._node, self._program = node, node.program
        self._joint_velocity: float | None = None  # rad/s, last command of a controller
        node.parameter_table.add_check("rpm", lambda rpm: self._program.require_speed(rpm * RPM))
        node.add_post_set_parameters_callback(self._on_parameters)
        node.subscribe(topics.CAM_RPM, self._on_rpm)
        node.subscribe(topics.JOINT_COMMANDS, self._on_joint_commands)
        for action in (self.start, self.stop, self.reset, self.emergency_stop):
            node.create_trigger(action.__name__, action)

    def start(self) -> str:
        """Start or resume the rotation of the cam."""
        if self._program.halted:
            raise RunError("the emergency stop is active; call reset, then start")
        self._program.run(True)
        self._node.send_due()
        return "the cam turns"

    def stop(self) -> str:
        """Stop the cam after the current tick.

        Rig time stops with the cam. A tick is the time between two cam states.
        """
        self._program.run(False)
        return f"stopped after {self._program.sent} states"

    def reset(self) -> str:
        """Stop the cam, and continue with the start of the scene at the next `start`.

        Rig time and the cam angle θ are not reset.
        """
        self._program.reset()
        self._node.set_parameters([Parameter("rpm", value=0.0)])
        return "at the beginning of the scene"

    def emergency_stop(self) -> str:
        """Stop the cam at the end of the current tick, until a reset.

        A tick is the time between two cam states.
        """
        if (state := self._program.halt()) is not None:
            self._node.send(state)
        return "the cam is stopped; to continue, call reset, then start"

    def _on_parameters(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == "rpm":
                self._program.command(parameter.value * RPM)
            elif parameter.name == "pacing":
                self._node.set_pacing(parameter.value)

    def _on_rpm(self, message: Float64) -> None:
        self._set_rpm(float(message.data), topics.CAM_RPM.name)

    def _set_rpm(self, rpm: float, topic: str) -> None:
        (result,) = self._node.set_parameters([Parameter("rpm", value=rpm)])
        if not result.successful:
            raise RefusedError(f"{topic}: {result.reason}")

    def _on_joint_commands(self, message: JointState) -> None:
        """Apply a new velocity (rad/s) of the joint ``cam``, where 0 stops the cam.

        A message without this joint is for other robots. A controller repeats its command at each
        of its cycles. An unchanged velocity is therefore ignored, so that it does not cancel the
        command of an operator.
        """
        topic, joint = topics.JOINT_COMMANDS.name, CAM_JOINTS[0]
        if joint not in message.name:
            return
        if len(message.velocity) != len(message.name):
            raise RefusedError(f"{topic}: velocity must have one value per joint")
        velocity = message.velocity[message.name.index(joint)]
        if velocity == self._joint_velocity:
            return
        if velocity == 0.0:
            self._program.run(False)
        elif self._program.halted:
            raise RefusedError(f"{topic}: the emergency stop is active; call reset")
        else:
            self._program.require_speed(velocity)
            self._set_rpm(velocity / RPM, topic)
            self.start()
        self._joint_velocity = velocity


class LawServerClient:
    """Parameter client of the law server, which mounts cams.

    Parameters
    ----------
    node : RigNode
        The drive.
    on_refused : callable
        Called with a cam and the reason if the law server refuses a requested cam.
    """

    def __init__(self, node: RigNode, on_refused: Callable[[str, str], None]) -> None:
        self._node, self._on_refused = node, on_refused
        self._client = AsyncParameterClient(node, LAW_SERVER)

    def request(self, cam: str) -> bool:
        """Request that the law server mounts a cam, and return True.

        Returns False if the law server is not available yet.
        """
        if not self._client.services_are_ready():
            return False

        def on_reply(future: Future) -> None:
            response = future.result()
            if response is not None and not response.results[0].successful:
                self._on_refused(cam, response.results[0].reason)

        self._client.set_parameters([Parameter("cam", value=cam)]).add_done_callback(on_reply)
        return True

    def watch(self, expected: Callable[[str], bool], on_mounted: Callable[[str], None]) -> None:
        """Call `on_mounted` with each cam that the law server mounts from now on.

        Any program can publish a parameter event. An event for a cam that is not `expected` counts
        only if the law server confirms it.
        """
        server = f"{self._node.get_namespace().rstrip('/')}/{LAW_SERVER}"

        def on_event(event: ParameterEvent) -> None:
            if event.node != server:
                return
            for parameter in event.changed_parameters:
                if parameter.name == "cam":
                    cam = str(parameter_value_to_python(parameter.value))
                    if expected(cam):
                        on_mounted(cam)
                    else:
                        self._confirm(cam, on_mounted)

        self._node.subscribe(topics.PARAMETER_EVENTS, on_event)

    def _confirm(self, cam: str, on_mounted: Callable[[str], None]) -> None:
        def on_reply(future: Future) -> None:
            response = future.result()
            values = [] if response is None else [value.string_value for value in response.values]
            if values == [cam]:
                on_mounted(cam)
            else:
                text = f"{topics.PARAMETER_EVENTS.name}: cam {cam!r} is not mounted; event ignored"
                self._node.reject(RefusedError(text))

        if self._client.services_are_ready():
            self._client.get_parameters(["cam"]).add_done_callback(on_reply)


class CamDrive(ClockSource):
    """Publishes /cam/state and /clock, and requests each cam from the law server."""

    def __init__(self) -> None:
        super().__init__("cam_drive")
        self._loaded = open_scene(Path(self.settings["scene"]))
        self._pace = Diagnostics(self.advertise(topics.DIAGNOSTICS), topics.PACE)
        self._lost_time = LostTime(time.monotonic())
        self.create_wall_timer(WAIT_SAMPLE_S, self._check_pace)
        self._clock_timer = self.create_wall_timer(1.0 / CLOCK_HZ, self._publish_clock)
        consumers = [*self.settings["consumers"], LAW_SERVER]
        server = LawServerClient(self, self._on_refused)
        self.program = DriveProgram(self._loaded.scene, consumers, server.request)
        self.total_ticks = self.program.ticks
        self.program.running = self.settings["autostart"] and self.runs_before == 0
        self.program.command(self.settings["rpm"] * RPM)
        self.set_pacing(self.settings["pacing"])
        self.subscribe(topics.LAW_COEFFICIENTS, self._on_law)
        self._controls = DriveControls(self)
        self._simulation = None
        if find_spec("simulation_interfaces") is not None:  # an optional ROS package
            control = import_module("cam_rig.nodes.simulation_control")
            self._simulation = control.SimulationControl(self, self._controls)
        server.watch(self.program.expects, self.program.on_mounted)
        self.start_flow(consumers, self.program.flow)

    def set_pacing(self, pacing: str) -> None:
        """Set the pacing from the next cam state on: free, real_time, or such as 20x."""
        self.program.pacing.set(pacing)
        self._lost_time = LostTime(time.monotonic())
        factor = self.program.pacing.factor
        self.publish_factor(factor)
        if factor is None:
            self._clock_timer.cancel()
        else:
            self._clock_timer.reset()

    def send_due(self) -> None:
        """Publish all cam states that may be published now.

        A waiting request for steps is continued.
        """
        super().send_due()
        if self._simulation is not None:
            self._simulation.update()

    def send_next(self) -> bool:
        """Publish the next cam state and return True, or return False if it must wait."""
        if (state := self.program.take(time.monotonic())) is None:
            return False
        self.send(state)
        return True

    def send(self, state: CamState) -> None:
        """Publish a cam state and its diagnostics, and report it to the runner."""
        level, text = OK, "turning" if state.speed else "stands"
        if self.program.halted and state.speed == 0.0:
            level, text = ERROR, "emergency stop"
        self.diagnostics.report(state.time_ns, level, text)
        pacing = self.program.pacing
        self._lost_time.add(pacing.late)
        if pacing.late:
            self._pace.report(state.time_ns, WARN, "lagging", {"late_s": f"{pacing.late:.3g}"})
        elif pacing.factor is not None:
            self._pace.report(state.time_ns, OK, "on time")
        law = self.program.laws[state.cam]
        torque = shaft_torque(law, self._loaded.follower, state.angle, state.speed)
        self.publish_state(state, torque)
        if pacing.factor is not None:
            self._clock_timer.reset()  # /clock needs the timer only if states are farther apart
        self.report_sent(state, self.program.sent - 1)

    def _check_pace(self) -> None:
        """Count the waits of a paced run by node, and warn if the run is too slow.

        A paced run has a real-time factor. The count shows which node delays it.
        """
        flow = self.program.flow
        if self._not_ready:
            self._lost_time = LostTime(time.monotonic())
        elif not flow.may_send() and self.time_until_due() == 0.0:
            self._lost_time.count_wait(order_by_chain(flow.behind())[0])
        self._warn_if_slow(PACE_WINDOW_S)

    def _warn_if_slow(self, window: float) -> None:
        factor = self.program.pacing.factor
        if factor and (text := self._lost_time.text(factor, time.monotonic(), window)):
            self.get_logger().warning(text)

    def conclude(self, spin_once: Callable[..., None]) -> None:
        """Publish the end of the run, and warn if the last seconds were too slow."""
        self._warn_if_slow(MIN_PACE_WINDOW_S)
        if self._simulation is not None:
            self._simulation.update()  # answers a waiting request
        super().conclude(spin_once)

    def _publish_clock(self) -> None:
        """Publish a rig time on /clock between two cam states of a paced run."""
        time_ns = self.program.time_ns(time.monotonic())
        if time_ns is not None and not self.done.done():
            self.publish_time(time_ns)

    def _on_refused(self, cam: str, reason: str) -> None:
        self.program.on_refused(cam)
        self.reject(RefusedError(f"the law server does not mount cam {cam!r}: {reason}"))

    def _on_law(self, message: Float64MultiArray) -> None:
        law = decode_law(*array_of(message))
        require_own_law(self._loaded, law)
        self.program.laws[law.name] = law
        self.send_due()

    def time_until_due(self) -> float:
        """Return the time (s, wall clock) until the next cam state is due.

        It is 0 in a free run, which has no real-time factor.
        """
        return self.program.wait(time.monotonic())

    def is_done(self) -> bool:
        """Return True if every cam state is published and every tick is acknowledged.

        A tick is the time between two states. The consumers acknowledge it when they have processed
        it.
        """
        return self.program.done

    def is_idle(self) -> bool:
        """Return True if the cam is stopped, or the next cam state is not due yet."""
        is_stopped = not self.program.running and self.program.flow.in_flight == 0
        return is_stopped or self.time_until_due() > 0.0

    @property
    def is_commanded(self) -> bool:
        """True if the cam turns at an operator's speed instead of that of the scene."""
        return self.program.schedule.state.speed is not None

    def activity(self) -> Activity:
        """Return the current activity of the drive for its heartbeat message."""
        if self.program.halted:
            return Activity("emergency", (), "emergency stop, waiting for ~/reset")
        if self._not_ready or self.program.running or self.program.flow.in_flight:
            return super().activity()
        return Activity("stopped", (), "stopped, waiting for ~/start")

    def pending_text(self) -> str:
        """Return the progress, and the nodes that the drive waits for, for an error text."""
        program = self.program
        behind = blocking_text(program.flow.behind() or [LAW_SERVER])
        return f"{program.sent} of {program.ticks + 1} states from: {behind}"
