"""Every quantity, once: designs, campaigns and Python read this table.

A name has one meaning: with ``_rigid`` it is of one rigid mass that stays on the cam, so a limit
that a design keeps is kept in a campaign of the same cam.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache, partial
from types import MappingProxyType

from cam_rig.dynamics.jump.any_follower import follower_of
from cam_rig.dynamics.jump.two_masses import FROM_REST
from cam_rig.quantities import values
from cam_rig.quantities.terms import ANGLE_UNITS, SPEED_UNITS, LawQuantity, Sense
from cam_rig.units import TURN

_LENGTH = {"mm": 1e-3, "m": 1.0, "um": 1e-6, "µm": 1e-6, "cm": 1e-2}
_FORCE, _LEVEL = {"N": 1.0, "kN": 1e3}, {"dB": 1.0}
_TORQUE = {"N*m": 1.0, "Nm": 1.0, "N·m": 1.0, "mN*m": 1e-3}
_MOST: tuple[Sense, ...] = ("<=",)
_LEAST: tuple[Sense, ...] = (">=",)
_BOTH: tuple[Sense, ...] = ("<=", ">=")
#: Of each derivative of s in turn the name, the title, the unit's end, and its units.
_DERIVATIVES = tuple(
    (name, title, over, {f"mm{over}": 1e-3, f"m{over}": 1.0, f"um{over}": 1e-6})
    for name, title, over in (
        ("velocity", "s′", "/rad"),
        ("acceleration", "s″", "/rad^2"),
        ("jerk", "s‴", "/rad^3"),
    )
)

_jump = partial(LawQuantity, unit="rpm", units=SPEED_UNITS, senses=_LEAST, campaign=True)
_at_speed = partial(LawQuantity, where="rpm")
_of_run = partial(_at_speed, campaign=True, of_run=True)

#: Goals and limits of designs, some of which a campaign measures too.
_DESIGNED = (
    _jump("jump_speed", "jump speed from rest",
          value=lambda one, *_: values.jump(one, follower_of(one.rig), FROM_REST)),
    _jump("jump_speed_steady", "jump speed in steady state",
          value=lambda one, *_: values.jump(one, follower_of(one.rig), None)),
    _jump("jump_speed_rigid", "jump speed of one rigid mass", rigid=True,
          value=lambda one, *_: values.jump(one, one.rigid, None)),
    _at_speed("residual_vibration", "residual vibration of the end mass, one event", "um", _LENGTH,
              values.residual, senses=_MOST),
    *(
        LawQuantity(f"peak_{name}", f"peak |{title}|", f"mm{over}", units, values.peak_of(order),
                    senses=_MOST, order=order)
        for order, (name, title, over, units) in enumerate(_DERIVATIVES, 1)
    ),
    LawQuantity("rms_acceleration", "r.m.s. of s″", "mm/rad^2", _DERIVATIVES[1][3],
                values.rms_acceleration, senses=_MOST),
    _at_speed("peak_contact_force_rigid", "peak contact force of one rigid mass", "N", _FORCE,
              lambda one, term, _: max(most for _, most in values.forces(one, term)),
              senses=_MOST, campaign=True),
    _at_speed("least_contact_force_rigid", "least contact force of one rigid mass", "N", _FORCE,
              lambda one, term, _: min(least for least, _ in values.forces(one, term)),
              senses=_LEAST, signed=True, campaign=True),
    _at_speed("shaft_torque", "peak |shaft torque|", "N*m", _TORQUE, values.torque, senses=_MOST),
    _at_speed("sound_level_rigid", "sound level of one rigid mass", "dB", _LEVEL,
              values.rigid_level, senses=_MOST, signed=True),
    _at_speed("sound_level_with_jumps", "sound level with landings, mean power over speeds", "dB",
              _LEVEL, values.level_with_jumps, senses=_MOST, signed=True),
    LawQuantity("pressure_angle", "pressure angle", "deg", ANGLE_UNITS, values.pressure_angle,
                senses=_MOST, below=0.25 * TURN),
    LawQuantity("radius_of_curvature", "least radius of curvature", "mm", _LENGTH,
                values.least_radius, senses=_LEAST),
    LawQuantity("event_angle", "span of event", "deg", ANGLE_UNITS, values.span, "event", _BOTH,
                goal=False, below=TURN),
    *(
        LawQuantity(name, title, f"mm{over}", units, values.at_angles(order), "deg", _BOTH,
                    goal=False, signed=True, order=order)
        for order, (name, title, over, units) in enumerate(
            (("lift", "lift", "", _LENGTH), *_DERIVATIVES[:2])
        )
    ),
)  # fmt: skip

#: What campaigns alone measure: of settled runs of the scene's model, and of whole turns.
_MEASURED = (
    _at_speed("residual_vibration_steady",
              "residual vibration of one mass on its stem in steady state", "um", _LENGTH,
              values.steady_residual, ranges=True, campaign=True),
    _of_run("least_contact_force", "least contact force", "N", _FORCE,
            values.in_row("force_least"), signed=True),
    _of_run("peak_contact_force", "peak contact force", "N", _FORCE, values.in_row("force_peak")),
    _of_run("sound_level", "sound level", "dB", _LEVEL, values.run_level, signed=True),
    _of_run("peak_torque", "peak torque", "N*m", _TORQUE, values.in_row("torque_peak")),
    _of_run("lift_offs", "lift-offs a turn", "", {"": 1.0}, values.in_row("lift_offs"),
            signed=True),
    _at_speed("twist", "twist, peak to peak", "rad", ANGLE_UNITS, values.twist, campaign=True),
)  # fmt: skip

#: Every quantity by its name.
QUANTITIES: Mapping[str, LawQuantity] = {one.name: one for one in (*_DESIGNED, *_MEASURED)}
#: What a design may have as a goal or a limit.
DESIGNED = {name: one for name, one in QUANTITIES.items() if one.senses}
#: What moves in each model of a scene, as titles say it.
MOVES = {
    "kinetostatic": "one rigid mass held on the cam",
    "one_mass": "one rigid mass free to leave the cam",
    "elastic_stem": "a mass on its stem held on the cam",
    "two_mass": "two masses",
    "torsional": "a rigid mass on a twisting shaft",
}


@cache
def measured_in(model: str) -> Mapping[str, LawQuantity]:
    """What a campaign measures whose scene has a model, which titles name; limited on any side."""
    found = {}
    for one in QUANTITIES.values():
        if one.campaign:
            title = f"{one.title} of {MOVES[model]}" if one.of_run else one.title
            found[one.name] = replace(one, title=title, senses=_BOTH)
    return MappingProxyType(found)
