"""What the bench's pages are shown: what the nodes say, the set-up, the readings noted so far."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from cam_rig.acoustics.sound_level_meter import TIME_WEIGHTINGS
from cam_rig.errors import RefusedError
from cam_rig.live.flow_control import MAX_TICKS_IN_FLIGHT
from cam_rig.messages.topics import HEARTBEAT, PACE
from cam_rig.panel.bench.readings import MAX_READINGS, Meter, NotedReading
from cam_rig.panel.bench.setup import Setup

#: What a node's heartbeat says of a drive that was stopped, and its diagnosis after an emergency.
STOPPED, EMERGENCY, LOST = "stopped", "emergency", "contact lost"
WAITING, BEHIND = "waiting for ", ", and behind it "
#: Lines of the graph's log that are shown.
MAX_LINES = 6


@dataclass
class LiveState:
    """The bench as its pages see it.

    Parameters
    ----------
    setup : how the rig is set up
    """

    setup: Setup
    #: off, starting, running, ended or failed.
    graph: str = "off"
    #: Why it failed.
    words: str = ""
    domain: int = 0
    #: Whether the cam is driven: turning, stopped, or emergency.
    drive: str = "stopped"
    #: Nodes that the drive waits for, in its words.
    waits_for: str = ""
    #: Nodes that were killed and wait to be started again, and how they ended.
    ended: dict[str, str] = field(default_factory=dict)
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

    # -- what happens to the graph ------------------------------------------------------------

    def happened(self, message: dict[str, Any]) -> None:
        """What the runner tells."""
        if "graph" in message:
            self.graph, self.words = message["graph"], message.get("words", "")
            self.domain = message.get("domain", self.domain)
            if self.graph == "starting":
                self.drive, self.state, self.ended, self.values = "stopped", {}, {}, {}
                self.contact, self.late, self.waits_for, self.meter = "", "", "", Meter()
                self._lost_ns, self._ticks_to_come = -1, 0
        if "ended" in message:
            self.ended = message["ended"]
        self.screen = message.get("screen", self.screen)
        if "kept" in message:
            self.kept.append(message["kept"])
        if "log" in message:
            self.log = [*self.log, message["log"]][-MAX_LINES:]

    # -- what the nodes say -------------------------------------------------------------------

    def heard(self, message: dict[str, Any]) -> None:
        """A line of the panel's node."""
        if "state" in message:
            self._turned(message["state"])
        elif "level" in message:
            self.meter.level(message["time_ns"], message["level"])
        elif "health" in message:
            self._health(*message["health"])
        elif "values" in message:
            self._set(message["node"], message["values"])

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

    def _health(self, node: str, _level: int, words: str) -> None:
        if node == f"cam_drive{HEARTBEAT}":
            self.graph = "running" if self.graph == "starting" else self.graph
            waits = words.removeprefix(WAITING) if words.startswith(WAITING) else ""
            self.waits_for = waits.replace(BEHIND, ", ")
        if node == "follower":
            if words == LOST:
                self.losses += 1
            if LOST in (words, self.contact):  # it was until now
                self._lost_ns = int(self.state.get("time_ns", 0))
            self.contact = words
        elif node == PACE:
            self.late = "" if words == "on time" else words
        elif node.startswith("cam_drive"):
            if words.startswith(EMERGENCY):
                self.drive = EMERGENCY
            elif words.startswith(STOPPED):
                self.drive = STOPPED
            elif words == "turning":
                self.drive = "turning"

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
        drive, ear = (self.values.get(node, {}) for node in ("cam_drive", "microphone"))
        pace = {key: drive[key] for key in ("pacing",) if key in drive}
        return {"cam_drive": pace, "microphone": dict(ear)}

    # -- what is noted ------------------------------------------------------------------------

    def note(self) -> NotedReading:
        """Note the present reading.

        Raises
        ------
        RefusedError : the cam has not turned long enough at one speed; too many are noted
        """
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

    def clear(self) -> None:
        """Forget all readings."""
        self.readings.clear()

    def shown(self) -> dict[str, Any]:
        """All of it, for a page."""
        tick = self.meter.latest
        return {
            "graph": self.graph,
            "words": self.words,
            "domain": self.domain,
            "screen": self.screen,
            "drive": self.drive,
            "waits_for": self.waits_for,
            "ended": self.ended,
            "values": self.values,
            "state": self.state,
            "level": round(tick.level, 3) if tick and self.drive == "turning" else None,
            "contact": self.contact,
            "losses": self.losses,
            "late": self.late,
            "kept": self.kept,
            "log": self.log,
            "setup": asdict(self.setup),
            "readings": [asdict(reading) for reading in self.readings],
        }
