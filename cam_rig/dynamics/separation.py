"""The two-mass follower as it rides the cam, lifts off, flies and lands (eq. 14-19).

Phases are closed forms, events are roots; nothing is stepped. A landing stops the roller mass on
the cam (ż := ṡ, the paper's plastic re-contact) or throws it back with Newton's restitution; the
end mass goes on with the velocity it had.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from cam_rig.dynamics.block import Event, EventKind
from cam_rig.dynamics.linear import LinearResponse
from cam_rig.dynamics.two_mass import TwoMassParameters, contact_response, force_output
from cam_rig.dynamics.two_mass_guards import fly, landing_time, lift_off_time
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.laws.bernstein import FloatArray

#: More events in one call than any physical series has.
MOST_EVENTS = 20_000


@dataclass(frozen=True, eq=False)
class Phase:
    """Contact, state (η, η̇), or flight, state (z, ż, y, ẏ), from ``begin`` to ``end`` s."""

    begin: float
    end: float
    contact: bool
    state: FloatArray


@dataclass
class Separation:
    """The follower's course on one law at one speed.

    Parameters
    ----------
    speed : rad/s
    angle : cam angle in rad at t = 0
    """

    law: Law
    parameters: TwoMassParameters
    speed: float
    angle: float = 0.0
    phases: list[Phase] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._response: LinearResponse = contact_response(self.law, self.parameters, self.speed)
        self._contact = True
        self._force = force_output(self.parameters)

    def run(self, duration: float, state: FloatArray | None = None, contact: bool = True) -> None:
        """Find all phases and events up to ``duration`` s, from rest on the cam by default."""
        if state is None:
            state, contact = np.zeros(2), True
        now = 0.0
        while now < duration:
            if len(self.events) > MOST_EVENTS:
                raise DynamicsError(
                    f"{len(self.events)} events in {now:g} s; allowed: {MOST_EVENTS} a run"
                )
            guard = lift_off_time if contact else landing_time
            angle = self.angle + self.speed * now
            event = guard(self.law, self.parameters, self.speed, angle, state, duration - now)
            end = duration if event is None else now + event
            self.phases.append(Phase(now, end, contact, state))
            if event is not None and contact:
                self._note("lift-off", end)
                state, contact = self._full(state, now, end), False
            elif event is not None:
                state, contact = self._meet(end, self.fly(state, np.array([event]))[:, 0])
            now, self._contact = end, contact

    @property
    def ends_in_contact(self) -> bool:
        """Whether the roller is on the cam after the last phase and its event, if it had one."""
        return self._contact

    @property
    def final_state(self) -> FloatArray:
        """(η, η̇) or (z, ż, y, ẏ) at the end of the run, exact as it is handed on."""
        last = self.phases[-1]
        if last.contact:
            angle = self.angle + self.speed * last.begin
            return self._response.end(last.state, angle, last.end - last.begin)
        return self.fly(last.state, np.array([last.end - last.begin]))[:, 0]

    def fly(self, state: FloatArray, times: FloatArray) -> FloatArray:
        """(z, ż, y, ẏ) at times (s) of a flight, ``(4, len(times))``."""
        return fly(self.parameters, state, times)

    def cam(self, time: FloatArray) -> FloatArray:
        """S, ṡ and s̈ at times in s, ``(3, len(time))``."""
        angle = self.angle + self.speed * time
        return np.stack([self.law(angle, order) * self.speed**order for order in range(3)])

    def force(self, state: FloatArray, time: FloatArray) -> FloatArray:
        """Contact force (N) of vibrations (η, η̇), ``(2, n)``, at times in s."""
        out = self._force
        total = out.state @ state + out.law @ self.cam(time) + out.constant[:, None]
        return np.asarray(total[0])

    def _full(self, state: FloatArray, begin: float, end: float) -> FloatArray:
        """(z, ż, y, ẏ) at the end of a contact phase."""
        vibration = self._response.end(state, self.angle + self.speed * begin, end - begin)
        cam = self.cam(np.array([end]))[:, 0]
        return np.concatenate([cam[:2], self.parameters.static_place(cam) + vibration])

    def _meet(self, time: float, state: FloatArray) -> tuple[FloatArray, bool]:
        """After a landing: what flies on, or the end mass's state in contact."""
        p = self.parameters
        cam = self.cam(np.array([time]))[:, 0]
        approach, vibration = float(cam[1] - state[1]), state[2:] - p.static_place(cam)
        force = float(self.force(vibration[:, None], np.array([time]))[0])
        rebound = p.restitution * approach
        restitution = p.restitution if self._rises(rebound, force) else 0.0
        impulse = p.roller_mass * (1.0 + restitution) * approach
        lost = 0.5 * p.roller_mass * (1.0 - restitution**2) * approach**2
        self._note("landing", time, impulse, lost)
        if restitution > 0.0:
            return np.array([cam[0], cam[1] + rebound, *state[2:]]), False
        return vibration, True

    def _rises(self, rebound: float, force: float) -> bool:
        """Whether a rebound rises above rounding; the rest of an endless series is contact."""
        if rebound <= 0.0 or force <= 0.0:
            return rebound > 0.0
        return 0.5 * rebound**2 * self.parameters.roller_mass / force > 1e-12 * self.law.lift

    def _note(self, kind: EventKind, time: float, impulse: float = 0.0, lost: float = 0.0) -> None:
        self.events.append(Event(kind, time, self.angle + self.speed * time, impulse, lost))
