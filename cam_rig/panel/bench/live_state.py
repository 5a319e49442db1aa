"""What the bench's pages are shown: what the nodes say, the set-up, the readings noted so far."""

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

# What the bench reads: speed and level tick by tick, and a level that may be noted.

#: Rig time (s) over which a noted level is the mean, or somewhat more, as it is of whole turns.
MEAN_S = 1.0
#: What must have passed at that speed before: so many times the meter's time constant, by which
#: what it read before has fallen by 35 dB.
SETTLED = 8.0
#: Speeds (rpm) are the same when they differ by no more than this part.
SAME_SPEED = 1e-6
#: Ticks that are kept.
MAX_TICKS = 4096
#: Readings that a bench notes, at most.
MAX_READINGS = 10_000


@dataclass(frozen=True)
class LevelOfTick:
    """One tick: when it ended (ns of rig time), how fast the cam turned (rpm), the level (dB)."""

    time_ns: int
    rpm: float
    level: float


@dataclass(frozen=True)
class NotedReading:
    """A reading as a person notes it: the mean level at a steady speed, and the set-up."""

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
    """Speeds and levels as they come, of which the last second can be noted."""

    def __init__(self) -> None:
        self._speeds: deque[tuple[int, float]] = deque(maxlen=MAX_TICKS)
        self._ticks: deque[LevelOfTick] = deque(maxlen=MAX_TICKS)

    def state(self, time_ns: int, rpm: float) -> None:
        """The cam turns at a speed from a rig time on."""
        self._speeds.append((time_ns, rpm))

    def level(self, time_ns: int, level: float) -> None:
        """The level of the tick that ends at a rig time."""
        newest_first = reversed(self._speeds)
        rpm = next((rpm for start, rpm in newest_first if start < time_ns), None)
        if rpm is not None:
            self._ticks.append(LevelOfTick(time_ns, rpm, level))

    def forget(self) -> None:
        """What was read is of something else: another cam, or another weighting."""
        self._ticks.clear()

    @property
    def latest(self) -> LevelOfTick | None:
        """The newest tick."""
        return self._ticks[-1] if self._ticks else None

    def steady(self, time_constant: float) -> tuple[float, float, int]:
        """Speed (rpm), mean-square level (dB) of the last whole turns, and when they began (ns)."""
        last = self.latest
        if last is None or last.rpm == 0.0:
            raise RefusedError("reading: nothing turns; allowed: start, and wait some seconds")
        same = [last]
        for tick in list(self._ticks)[-2::-1]:
            if abs(tick.rpm - last.rpm) > SAME_SPEED * last.rpm:
                break
            same.append(tick)
        span = (last.time_ns - same[-1].time_ns) / NS
        # Whole turns: the level swings within one.
        needed = math.ceil(MEAN_S * last.rpm / 60.0) * 60.0 / last.rpm
        settled = max(needed, SETTLED * time_constant) + needed
        if span < settled:
            raise RefusedError(
                f"reading: {last.rpm:.5g} rpm for {span:.1f} s of rig time; allowed: after "
                f"{settled:.1f} s"
            )
        levels = [t.level for t in same if last.time_ns - t.time_ns < (1 - 1e-6) * needed * NS]
        square = float((pressure_pa(np.array(levels)) ** 2).mean())
        return last.rpm, float(level_db(math.sqrt(square))), last.time_ns - round(needed * NS)


def to_csv(readings: list[NotedReading]) -> str:
    """Return the readings as CSV, one row each."""
    out = io.StringIO()
    writer = csv.DictWriter(out, [f.name for f in fields(NotedReading)], lineterminator="\n")
    writer.writeheader()
    for reading in readings:
        writer.writerow({key: spreadsheet_text(value) for key, value in asdict(reading).items()})
    return out.getvalue()


#: Of a drive that was stopped; of a follower.
STOPPED, EMERGENCY, LOST, IN_CONTACT = "stopped", "emergency", "contact lost", "in contact"
#: Levels of a diagnosis.
OK, ERROR = 0, 2

#: Lines of the graph's log that are shown.
MAX_LINES = 6


@dataclass
class LiveState:
    """The bench as its pages see it; each of these is what a page is told by that name."""

    setup: Setup
    #: off, starting, running, ended or failed.
    graph: str = "off"
    #: Why it failed.
    words: str = ""
    domain: int = 0
    #: Whether the cam is driven: turning, stopped, or emergency.
    drive: str = "stopped"
    #: Nodes that the drive waits for.
    waits_for: str = ""
    values: dict[str, dict[str, Any]] = field(default_factory=dict)
    state: dict[str, Any] = field(default_factory=dict)
    contact: str = ""
    late: str = ""
    kept: list[str] = field(default_factory=list)
    log: list[str] = field(default_factory=list)
    readings: list[NotedReading] = field(default_factory=list)
    #: Address of the page that shows the rig in Rerun.
    screen: str = ""
    #: Ticks in which contact was lost, as far as they were told apart.
    losses: int = 0

    def __post_init__(self) -> None:
        self.meter = Meter()
        #: Rig time (ns) at which contact was lost last.
        self._lost_ns = -1
        self._ticks_to_come = 0

    def happened(self, message: dict[str, Any]) -> None:
        """What the runner tells."""
        if "graph" in message:
            self.graph, self.words = message["graph"], message.get("words", "")
            self.domain = message.get("domain", self.domain)
            if self.graph == "starting":
                self.drive, self.state, self.values = "stopped", {}, {}
                self.contact, self.late, self.waits_for, self.meter = "", "", "", Meter()
                self._lost_ns, self._ticks_to_come = -1, 0
        self.screen = message.get("screen", self.screen)
        if "kept" in message:
            self.kept.append(message["kept"])
        if "log" in message:
            self.log = [*self.log, message["log"]][-MAX_LINES:]

    def heard(self, message: dict[str, Any]) -> bool:
        """A line of what the nodes say; whether it tells more than a tick's level."""
        before = self._known()
        if "state" in message:
            self._turned(message["state"])
        elif "level" in message:
            self.meter.level(message["time_ns"], message["level"])
        elif "health" in message:
            self._health(*message["health"])
        elif "values" in message:
            self._set(message["node"], message["values"])
        return "values" in message or self._known() != before

    def _known(self) -> tuple[Any, ...]:
        """What a page is told at once."""
        turning = self.state.get("cam"), self.state.get("rpm")
        return self.graph, self.drive, self.waits_for, self.contact, self.late, turning

    def _turned(self, state: dict[str, Any]) -> None:
        if state["cam"] != self.state.get("cam"):
            self.meter.forget()
        self.state, self.graph, self.waits_for = state, "running", ""
        self.meter.state(state["time_ns"], state["rpm"])
        self._ticks_to_come -= 1
        if self.drive != EMERGENCY and self._ticks_to_come < 0:
            self.drive = "turning"

    def stopped(self) -> None:
        """The drive was told to stop: only what is in flight may still come."""
        self.drive, self._ticks_to_come = STOPPED, MAX_TICKS_IN_FLIGHT + 1

    def started(self) -> None:
        """The drive was told to turn."""
        self.drive, self._ticks_to_come = "turning", 0

    def _health(self, node: str, level: int, values: dict[str, str]) -> None:
        if node == f"cam_drive{HEARTBEAT}":
            self.graph = "running" if self.graph == "starting" else self.graph
            self.waits_for = values["waits_for"]
            self.drive = self.drive if values["state"] == "waiting" else values["state"]
        elif node == "cam_drive":
            self.drive = EMERGENCY if level == ERROR else "turning"
        elif node == "follower":
            contact = IN_CONTACT if level == OK else LOST
            self.losses += contact == LOST
            if LOST in (contact, self.contact):  # it was until now
                self._lost_ns = int(self.state.get("time_ns", 0))
            self.contact = contact
        elif node == PACE:
            self.late = "" if level == OK else "lagging"

    def _set(self, node: str, values: dict[str, Any]) -> None:
        if node == "microphone" and values != self.values.get(node):
            self.meter.forget()
        self.values.setdefault(node, {}).update(values)

    def mounted(self) -> dict[str, Any]:
        """Cam and speed as they are now, for the next set-up."""
        rpm = self.values.get("cam_drive", {}).get("rpm", 0.0)
        cam = self.values.get("law_server", {}).get("cam", "")
        now = {"cam": cam or self.state.get("cam"), "rpm": rpm or self.state.get("rpm")}
        return {key: value for key, value in now.items() if value}

    def chosen(self) -> dict[str, dict[str, Any]]:
        """What else was set on the nodes, for those of the next set-up."""
        return {
            node: {key: values[key] for key in live if key in values and key not in ("cam", "rpm")}
            for node, live in LIVE.items()
            if (values := self.values.get(node))
        }

    def note(self) -> NotedReading:
        """Note the present reading."""
        if len(self.readings) >= MAX_READINGS:
            raise RefusedError(f"reading: {MAX_READINGS} are noted; allowed: no more, clear them")
        ear = self.values.get("microphone", {})
        if self.drive != "turning":
            raise RefusedError("reading: the cam stands; allowed: while it turns")
        rpm, level, begin_ns = self.meter.steady(TIME_WEIGHTINGS[ear.get("time_weighting", "F")])
        lost = self.contact == LOST or self._lost_ns >= begin_ns
        reading = NotedReading(
            self.state["cam"],
            self.setup.model,
            round(rpm, 6),
            round(level, 3),
            f"L{ear.get('frequency_weighting', '?')}{ear.get('time_weighting', '?')}",
            LOST if lost else self.contact,
            self.setup.added_mass,
            self.setup.spring_stiffness,
            self.setup.preload,
        )
        self.readings.append(reading)
        return reading

    def shown(self) -> dict[str, Any]:
        """All of it, for a page, that later changes leave as it is; readings are records."""
        tick = self.meter.latest
        level = round(tick.level, 1) if tick and self.drive == "turning" else None
        own = {f.name: copy(getattr(self, f.name)) for f in fields(self)}
        own |= {"setup": vars(self.setup), "values": {n: dict(v) for n, v in self.values.items()}}
        state = {key: value for key, value in self.state.items() if key in ("cam", "rpm")}
        return own | {"state": state, "level": level}


# The sound of the rig for a page: from the samples of each tick, while somebody listens.

#: Least rate (Hz) of the sound, which a browser plays.
LEAST_RATE = 16_000
#: Sound pressure (Pa) that a page's full volume stands for.
FULL_SCALE_PA = 20.0


class PageSound:
    """Renders the contact force of a run, tick by tick, as 32-bit floats of full scale."""

    def __init__(self, radiation: RadiationParameters, sample_rate: int) -> None:
        self._source = SoundSource(radiation, sample_rate, LEAST_RATE)
        #: Samples a second of the sound, Hz.
        self.rate = self._source.rate

    def render(self, rows: FloatArray, rpm: float) -> bytes:
        """The sound of a tick's samples, at a cam speed (rpm)."""
        block = Samples(rows)
        pressure = self._source.pressure(block.force, block.impulse, rpm * TURN / 60.0)
        return bytes(np.asarray(pressure / FULL_SCALE_PA, dtype="<f4").tobytes())
