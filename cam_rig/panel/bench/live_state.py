"""State of the bench that its pages display: node reports, set-up, noted readings."""

from __future__ import annotations

import csv
import io
import math
from collections import deque
from copy import copy
from dataclasses import asdict, dataclass, field, fields
from typing import Any

import numpy as np

from cam_rig.acoustics import RadiationParameters, SoundSource, level_db
from cam_rig.acoustics.pressure import pressure_pa
from cam_rig.acoustics.sound_level_meter import TIME_WEIGHTINGS
from cam_rig.dynamics import Samples
from cam_rig.errors import RefusedError
from cam_rig.files import spreadsheet_text
from cam_rig.live.flow_control import MAX_TICKS_IN_FLIGHT
from cam_rig.messages.topics import HEARTBEAT, PACE
from cam_rig.nodes.parameters import LIVE
from cam_rig.panel.bench.runner import Setup
from cam_rig.units import NS, TURN, FloatArray

# Sound-level meter of the bench: speed and level of each tick, and the mean level at a steady
# speed.

#: Shortest rig time (s) over which a noted level is averaged. The time is rounded up to whole
#: turns.
MEAN_S = 1.0
#: Shortest time at the present speed before the averaged turns, in time constants of the
#: sound-level meter. After 8 time constants the earlier reading has decayed by 35 dB.
SETTLING_TIME_CONSTANTS = 8.0
#: Largest relative difference of two speeds (rpm) that count as equal (rounding).
SPEED_RTOL = 1e-6
#: Largest number of ticks whose sound levels are stored: those of 1.1 min at 300 rpm and 12 ticks
#: per turn.
MAX_TICKS = 4096
#: Largest number of readings that a bench notes. The limit bounds the memory.
MAX_READINGS = 10_000


@dataclass(frozen=True)
class LevelOfTick:
    """Sound level of one tick: end time (ns of rig time), cam speed (rpm), level (dB)."""

    time_ns: int
    rpm: float
    level: float


@dataclass(frozen=True)
class NotedReading:
    """Reading that a person has noted: mean sound level at a steady speed, and set-up."""

    cam: str
    model: str
    rpm: float
    level_db: float
    weighting: str
    contact: str
    added_mass_kg: float
    spring_stiffness_n_m: float
    preload_n: float


class Meter:
    """Meter that computes a steady mean of the sound level from the last ticks."""

    def __init__(self) -> None:
        self._speeds: deque[tuple[int, float]] = deque(maxlen=MAX_TICKS)
        self._ticks: deque[LevelOfTick] = deque(maxlen=MAX_TICKS)

    def add_speed(self, time_ns: int, rpm: float) -> None:
        """Add the cam speed (rpm) that applies from a rig time (ns) on."""
        self._speeds.append((time_ns, rpm))

    def add_level(self, time_ns: int, level: float) -> None:
        """Add the sound level (dB) of the tick that ends at a rig time (ns)."""
        newest_first = reversed(self._speeds)
        rpm = next((rpm for start_ns, rpm in newest_first if start_ns < time_ns), None)
        if rpm is not None:
            self._ticks.append(LevelOfTick(time_ns, rpm, level))

    def clear(self) -> None:
        """Discard all levels of the meter, because the cam or the weighting has changed."""
        self._ticks.clear()

    @property
    def latest(self) -> LevelOfTick | None:
        """Latest tick with its level, None before the first tick."""
        return self._ticks[-1] if self._ticks else None

    def steady_mean(self, time_constant: float) -> tuple[float, float, int]:
        """Return the mean sound level of the last whole turns at a steady speed.

        Parameters
        ----------
        time_constant : float
            Time constant of the meter's time weighting, s.

        Returns
        -------
        tuple
            Speed (rpm), mean-square level (dB), and rig time (ns) of the first averaged turn.

        Raises
        ------
        RefusedError
            If the cam is stopped, or if the speed has changed too recently.
        """
        last = self.latest
        if last is None or last.rpm == 0.0:
            raise RefusedError("reading: the cam is stopped; allowed: while it turns")
        steady_ticks = [last]
        for tick in list(self._ticks)[-2::-1]:
            if abs(tick.rpm - last.rpm) > SPEED_RTOL * last.rpm:
                break
            steady_ticks.append(tick)
        duration = (last.time_ns - steady_ticks[-1].time_ns) / NS
        # The level varies within a turn, so the mean is taken over whole turns.
        mean_duration = math.ceil(MEAN_S * last.rpm / 60.0) * 60.0 / last.rpm
        min_duration = max(mean_duration, SETTLING_TIME_CONSTANTS * time_constant) + mean_duration
        if duration < min_duration:
            raise RefusedError(
                f"reading: {last.rpm:.5g} rpm for {duration:.1f} s of rig time; allowed: after "
                f"{min_duration:.1f} s"
            )
        window_ns = (1 - 1e-6) * mean_duration * NS
        levels = [t.level for t in steady_ticks if last.time_ns - t.time_ns < window_ns]
        mean_square = float((pressure_pa(np.array(levels)) ** 2).mean())
        return (
            last.rpm,
            float(level_db(math.sqrt(mean_square))),
            last.time_ns - round(mean_duration * NS),
        )


def to_csv(readings: list[NotedReading]) -> str:
    """Return the readings as CSV, one row per reading."""
    out = io.StringIO()
    writer = csv.DictWriter(out, [f.name for f in fields(NotedReading)], lineterminator="\n")
    writer.writeheader()
    for reading in readings:
        writer.writerow({key: spreadsheet_text(value) for key, value in asdict(reading).items()})
    return out.getvalue()


#: State of the drive while the cam turns.
TURNING = "turning"
#: State of the drive after a stop.
STOPPED = "stopped"
#: State of the drive after an emergency stop.
EMERGENCY = "emergency"
#: Contact state of the follower in a tick in which it left the cam.
LOST = "contact lost"
#: Contact state of the follower in a tick without loss of contact.
IN_CONTACT = "in contact"
#: Level of a diagnostic message without a fault, as in diagnostic_msgs.
OK = 0
#: Level of a diagnostic message with an error, as in diagnostic_msgs.
ERROR = 2

#: Number of the newest lines of the node graph's log that are shown.
MAX_LINES = 6


@dataclass
class LiveState:
    """State of the bench that its browser pages display.

    Each field is sent to the pages under its name.
    """

    setup: Setup
    #: State of the node graph: off, starting, running, ended or failed.
    graph: str = "off"
    #: Reason of a failure of the graph, empty without a failure.
    failure: str = ""
    #: ROS domain of the nodes.
    domain: int = 0
    #: State of the drive: turning, stopped or emergency.
    drive: str = STOPPED
    #: Names of the nodes for whose messages the drive waits, as text.
    waits_for: str = ""
    #: Parameter values by node.
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    #: Latest cam state: time_ns, cam, rpm and angle.
    state: dict[str, Any] = field(default_factory=dict)
    #: Contact state of the latest tick, `LOST` or `IN_CONTACT`, empty if unknown.
    contact: str = ""
    #: True if the run is slower than its real-time factor requires.
    is_late: bool = False
    #: Paths of the bags that were kept.
    kept_bags: list[str] = field(default_factory=list)
    #: Newest lines that the node graph has logged, at most `MAX_LINES`.
    log: list[str] = field(default_factory=list)
    readings: list[NotedReading] = field(default_factory=list)
    #: Address of the page that shows the rig in Rerun, empty without such a page.
    rerun_address: str = ""
    #: Number of reports of the follower that contact was lost.
    contact_losses: int = 0

    def __post_init__(self) -> None:
        self.meter = Meter()
        #: Rig time (ns) of the last loss of contact, -1 before the first.
        self._lost_ns = -1
        self._ticks_in_flight = 0

    def on_runner_event(self, event: dict[str, Any]) -> None:
        """Update the state of the bench from an event of its runner.

        The runner starts, monitors and ends the nodes. An event contains the keys to update, such
        as ``graph`` or ``log``.
        """
        if "graph" in event:
            self.graph, self.failure = event["graph"], event.get("failure", "")
            self.domain = event.get("domain", self.domain)
            if self.graph == "starting":
                self.drive, self.state, self.parameters = STOPPED, {}, {}
                self.contact, self.is_late, self.waits_for, self.meter = "", False, "", Meter()
                self._lost_ns, self._ticks_in_flight = -1, 0
        self.rerun_address = event.get("rerun_address", self.rerun_address)
        if "kept_bag" in event:
            self.kept_bags.append(event["kept_bag"])
        if "log" in event:
            self.log = [*self.log, event["log"]][-MAX_LINES:]

    def on_node_message(self, message: dict[str, Any]) -> bool:
        """Update the state of the bench from a message of the panel's node.

        Returns True if pages must be notified at once. A tick that changes only the level can wait.
        """
        before = self._urgent_values()
        if "state" in message:
            if message["state"]["cam"] != self.state.get("cam"):
                self.meter.clear()
            self.state, self.graph, self.waits_for = message["state"], "running", ""
            self.meter.add_speed(self.state["time_ns"], self.state["rpm"])
            self._ticks_in_flight -= 1
            if self.drive != EMERGENCY and self._ticks_in_flight < 0:
                self.drive = TURNING
        elif "level" in message:
            self.meter.add_level(message["time_ns"], message["level"])
        elif "health" in message:
            self._on_diagnostics(*message["health"])
        elif "values" in message:
            node, values = message["node"], message["values"]
            if node == "microphone" and values != self.parameters.get(node):
                self.meter.clear()
            self.parameters.setdefault(node, {}).update(values)
        return "values" in message or self._urgent_values() != before

    def _urgent_values(self) -> tuple[Any, ...]:
        """Return the values whose change is sent to the pages at once."""
        turning = self.state.get("cam"), self.state.get("rpm")
        return self.graph, self.drive, self.waits_for, self.contact, self.is_late, turning

    def on_service(self, service: str) -> None:
        """Update the state of the drive after a service was called.

        After a stop only the ticks in flight may still arrive.
        """
        if service == "start":
            self.drive, self._ticks_in_flight = TURNING, 0
        elif service == "stop":
            self.drive, self._ticks_in_flight = STOPPED, MAX_TICKS_IN_FLIGHT + 1

    def _on_diagnostics(self, node: str, level: int, values: dict[str, str]) -> None:
        if node == f"cam_drive{HEARTBEAT}":
            self.graph = "running" if self.graph == "starting" else self.graph
            self.waits_for = values["waits_for"]
            self.drive = self.drive if values["state"] == "waiting" else values["state"]
        elif node == "cam_drive":
            self.drive = EMERGENCY if level == ERROR else TURNING
        elif node == "follower":
            contact = IN_CONTACT if level == OK else LOST
            self.contact_losses += contact == LOST
            if LOST in (contact, self.contact):  # contact was lost until this report
                self._lost_ns = int(self.state.get("time_ns", 0))
            self.contact = contact
        elif node == PACE:
            self.is_late = level != OK

    def mounted_cam_and_speed(self) -> dict[str, Any]:
        """Return the present cam and speed (rpm) for the next set-up, if they are known."""
        rpm = self.parameters.get("cam_drive", {}).get("rpm", 0.0)
        cam = self.parameters.get("law_server", {}).get("cam", "")
        current = {"cam": cam or self.state.get("cam"), "rpm": rpm or self.state.get("rpm")}
        return {key: value for key, value in current.items() if value}

    def node_settings(self) -> dict[str, dict[str, Any]]:
        """Return the parameters of each node that can be set during a run, by node.

        They are applied to the nodes of the next set-up. Cam and speed are left out, because they
        are part of the set-up.
        """
        return {
            node: {key: values[key] for key in live if key in values and key not in ("cam", "rpm")}
            for node, live in LIVE.items()
            if (values := self.parameters.get(node))
        }

    def note(self) -> NotedReading:
        """Note the mean level at the present speed, and return the reading.

        Raises RefusedError if the cam is stopped, if the speed is not steady, or if `MAX_READINGS`
        are noted.
        """
        if len(self.readings) >= MAX_READINGS:
            raise RefusedError(f"reading: limit of {MAX_READINGS} reached; clear them first")
        weightings = self.parameters.get("microphone", {})
        if self.drive != TURNING:
            raise RefusedError("reading: the cam is stopped; allowed: while it turns")
        time_weighting = weightings.get("time_weighting", "F")
        rpm, level, start_ns = self.meter.steady_mean(TIME_WEIGHTINGS[time_weighting])
        lost = self.contact == LOST or self._lost_ns >= start_ns
        reading = NotedReading(
            cam=self.state["cam"],
            model=self.setup.model,
            rpm=round(rpm, 6),
            level_db=round(level, 3),
            weighting=f"L{weightings.get('frequency_weighting', '?')}{time_weighting}",
            contact=LOST if lost else self.contact,
            added_mass_kg=self.setup.added_mass,
            spring_stiffness_n_m=self.setup.spring_stiffness,
            preload_n=self.setup.preload,
        )
        self.readings.append(reading)
        return reading

    def page_data(self) -> dict[str, Any]:
        """Return a snapshot of the bench's state for a page.

        Later changes of the state do not affect the snapshot. The readings are `NotedReading`
        objects.
        """
        tick = self.meter.latest
        level = round(tick.level, 1) if tick and self.drive == TURNING else None
        data = {f.name: copy(getattr(self, f.name)) for f in fields(self)}
        data["parameters"] = {node: dict(values) for node, values in self.parameters.items()}
        state = {key: value for key, value in self.state.items() if key in ("cam", "rpm")}
        return data | {"setup": vars(self.setup), "state": state, "level": level}


# The sound of the rig, rendered from the samples of each tick while a page listens.

#: Smallest sample rate of the sound that is sent to a browser, Hz.
MIN_RATE_HZ = 16_000
#: Sound pressure (Pa) that is sent to a page as the sample value 1.
FULL_SCALE_PA = 20.0


class PageSound:
    """Renderer of the contact force of each tick as sound for a page.

    A sample is a 32-bit float. The value 1 corresponds to `FULL_SCALE_PA`.
    """

    def __init__(self, radiation: RadiationParameters, sample_rate: int) -> None:
        self._source = SoundSource(radiation, sample_rate, MIN_RATE_HZ)
        #: Sample rate of the page's sound, Hz.
        self.rate = self._source.rate

    def render(self, rows: FloatArray, rpm: float) -> bytes:
        """Return the sound of a tick's samples at a cam speed (rpm), as float32 bytes."""
        block = Samples(rows)
        pressure = self._source.pressure(block.force, block.impulse, rpm * TURN / 60.0)
        return bytes(np.asarray(pressure / FULL_SCALE_PA, dtype="<f4").tobytes())
