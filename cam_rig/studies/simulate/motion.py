"""Motion of a follower on one cam at one speed: samples and events."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from pydantic import ValidationError

from cam_rig.arguments import check_arguments
from cam_rig.dynamics import MODELS, Block, Event
from cam_rig.dynamics.interval import NamedRows
from cam_rig.dynamics.velocity_jumps import require_continuous
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig, SceneConfig
from cam_rig.schema.explain import explain
from cam_rig.show.result import Column, Records, Result
from cam_rig.simulation.inputs import LawOrCam, RequiredRig, resolve_law, resolve_rig
from cam_rig.simulation.schedule import cam_states
from cam_rig.simulation.simulate import FollowerSimulator
from cam_rig.units import FloatArray

#: Largest number of samples of a simulated motion. A motion of this length takes 1 GB.
MAX_TOTAL_SAMPLES = 20_000_000
#: Name of the only cam in the scene that is created for a motion.
CAM = "cam"


@dataclass(frozen=True, eq=False, repr=False)
class FollowerMotion(NamedRows, Result):
    """Simulated motion of a follower: arrays of samples ``(n,)``, and events.

    The samples are ``time`` (s), ``lift`` (m), ``velocity`` (m/s), ``acceleration`` (m/s²),
    ``force`` (contact force, N), ``impulse`` (of the landings since the previous sample, N·s),
    ``angle`` (cam angle with all its turns, rad) and ``torque`` (of the contact force on the cam,
    N·m).

    Parameters
    ----------
    law : Law
        Motion law of the cam.
    rig : RigConfig
        Rig with the follower.
    scene : SceneConfig
        Model, speed, turns and sample rate.
    rows : (6, n) array
        All samples except ``angle`` and ``torque``.
    blocks : tuple of Block
        Samples of each interval of the run as views of `rows`, with their events.
    """

    schema = "cam_rig.motion.1"
    plot_function = "cam_rig.studies.simulate.figures:motion_figure"
    columns: ClassVar = {
        "samples": (
            Column("time", "s"),
            Column("angle", "°", doc="cam angle with all its turns"),
            Column("lift", "mm", doc="of the follower"),
            Column("velocity", "m/s"),
            Column("acceleration", "m/s²"),
            Column("force", "N", doc="contact force"),
            Column("impulse", "N·s", doc="of the landings since the previous sample"),
            Column("torque", "N·m", doc="of the contact force on the cam, F s′"),
        ),
        "events": (
            Column("kind"),
            Column("time", "s", ".5f"),
            Column("angle", "°", ".2f", "cam angle"),
            Column("impulse", "N·s", ".3g"),
            Column("energy_lost", "J", ".3g"),
        ),
    }

    law: Law
    rig: RigConfig
    scene: SceneConfig
    rows: FloatArray
    blocks: tuple[Block, ...]

    @cached_property
    def angle(self) -> FloatArray:
        """Cam angle counted over all turns, rad, shape `(n,)`."""
        rate = int(self.scene.sample_rate.si)
        intervals = [block.interval for block in self.blocks]
        angle = np.concatenate([i.unwrapped_at(i.grid(rate).sample_times()) for i in intervals])
        angle.setflags(write=False)
        return angle

    @cached_property
    def torque(self) -> FloatArray:
        """Torque F s′ of the contact force on the cam, N·m, shape `(n,)` (eq. 8 of the paper)."""
        torque = self.force * self.law(self.angle, 1)
        torque.setflags(write=False)
        return torque

    @property
    def events(self) -> tuple[Event, ...]:
        """Lift-offs and landings in order, each with kind, time, angle and impulse."""
        return tuple(event for block in self.blocks for event in block.events)

    @property
    def rpm(self) -> float:
        """Cam speed, rpm."""
        return self.scene.schedule.speeds.numbers[0]

    def __repr__(self) -> str:
        run = f"{self.law.name} on {self.rig.name}, {self.scene.model}, {self.rpm:g} rpm"
        return f"FollowerMotion({run}: {self.time.size} samples, {len(self.events)} events)"

    def tables(self) -> list[Records]:
        """Return the tables ``samples``, for export only, and ``events``."""
        return [
            self.array_table("samples"),
            self.table("events", "Lift-offs and landings", self.events),
        ]


@check_arguments
def simulate(
    law: LawOrCam,
    rig: RequiredRig,
    *,
    model: str = "one_mass",
    rpm: float,
    turns: int = 3,
    sample_rate: int = 48_000,
    ramp: float | None = None,
) -> FollowerMotion:
    """Simulate the follower on a cam at one speed.

    Every model is exact between its events, so the sample rate does not affect the accuracy.

    Parameters
    ----------
    law : Law, Cam, str or Path
        Motion law, or a cam: its name in ``config/cams``, its path, or the object.
    rig : Rig, str or Path
        Rig: its name in ``config/rigs``, its path, or the object.
    model : str, optional
        ``one_mass`` (rigid, with lift-offs and landings, default), ``two_mass`` (eq. 14-19 of the
        paper), ``elastic_stem`` (eq. 5, always in contact), ``kinetostatic`` (no vibration, no loss
        of contact), or ``torsional`` (eq. 10, elastic shaft).
    rpm : float
        Cam speed, rpm.
    turns : int, optional
        Number of turns at that speed (default: 3).
    sample_rate : int, optional
        Sample rate, Hz (default: 48 000).
    ramp : float, optional
        Time of a linear ramp from rest to the speed, s (default: start at the speed).

    Returns
    -------
    FollowerMotion
        Motion, forces and events of the follower.

    Raises
    ------
    ConfigError
        If an argument is out of range, or the rig lacks a number that the model needs.
    DynamicsError
        If the model does not support the law, such as a lift that jumps.

    Examples
    --------
    >>> import cam_rig
    >>> motion = cam_rig.simulate("poly345", "paper_table2", model="two_mass", rpm=450, turns=3)
    >>> motion.time.shape, round(float(motion.lift.max()) * 1e3, 2)  # mm
    ((19200,), 50.0)
    >>> [event.kind for event in motion.events][:2]
    ['lift-off', 'landing']
    """
    law, rig = resolve_law(law), resolve_rig(rig, law)
    scene = scene_of("simulate", [CAM], rig, model, [rpm], turns, 0, sample_rate, ramp)
    count = turns * 60.0 / rpm * sample_rate
    if count > MAX_TOTAL_SAMPLES:
        raise ConfigError(
            f"the motion may have at most {MAX_TOTAL_SAMPLES:g} samples, got {count:.3g} in "
            f"{turns} turns at {rpm:g} rpm and {sample_rate} Hz; use fewer turns or a lower "
            "sample_rate"
        )
    require_continuous(law)
    follower_model = MODELS[scene.model]
    parameters = follower_model.parameters(rig)
    simulator = FollowerSimulator(follower_model, parameters, sample_rate, {CAM: law})
    ticks = (simulator.turn_to(state) for state in cam_states(scene))
    blocks = [block for _, block in filter(None, ticks)]
    rows = np.hstack([block.rows for block in blocks])
    rows.setflags(write=False)
    ends = np.cumsum([block.rows.shape[1] for block in blocks])
    views = np.split(rows, ends[:-1], axis=1)
    viewing = (replace(block, rows=view) for block, view in zip(blocks, views, strict=True))
    return FollowerMotion(law, rig, scene, rows, tuple(viewing))


def scene_of(
    function: str,
    cams: list[str],
    rig: RigConfig,
    model: str,
    rpm: list[float],
    turns: float,
    transient_turns: float,
    sample_rate: int,
    ramp: float | None,
) -> SceneConfig:
    """Return a scene with the arguments of a function, checked like a scene file.

    `rpm` is in rpm, `sample_rate` in Hz, and `ramp` in s. `function` is the name of the function,
    with which error messages start.

    Raises
    ------
    ConfigError
        If an argument is out of range.
    """

    def number(value: object, unit: str) -> dict[str, object]:
        return {"assumed": value, "unit": unit, "source": f"argument of {function}"}

    schedule = {
        "speeds": number(rpm, "rpm"),
        "turns": number(turns, "turns"),
        "transient_turns": number(transient_turns, "turns"),
        "ramp": None if ramp is None else number(ramp, "s"),
    }
    data = {
        "name": function,
        "title": ", ".join(cams),
        "cams": cams,
        "rig": rig.name,
        "model": model,
        "sample_rate": number(sample_rate, "Hz"),
        "schedule": schedule,
    }
    try:
        return SceneConfig.model_validate(data)
    except ValidationError as error:
        text = explain(error, SceneConfig).replace("schedule.speeds", "rpm")
        raise ConfigError(f"{function}: {text.replace('schedule.', '')}") from None
