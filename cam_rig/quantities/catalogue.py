"""Table of all quantities, shared by designs, campaigns and the Python API.

A design optimises a law, and a campaign evaluates many rigs with varied numbers. A name has one
meaning everywhere. A name with ``_rigid`` belongs to one rigid mass that stays on the cam, so a
limit that a design keeps is also kept in a campaign of the same cam.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache, partial
from types import MappingProxyType

from cam_rig.dynamics.jump.any_follower import follower_of
from cam_rig.dynamics.jump.two_masses import REST_DURATION_S
from cam_rig.quantities import values
from cam_rig.quantities.terms import ANGLE_UNITS, SPEED_UNITS, LawQuantity, Sense
from cam_rig.units import TURN

_LENGTH = {"mm": 1e-3, "m": 1.0, "um": 1e-6, "µm": 1e-6, "cm": 1e-2}
_FORCE = {"N": 1.0, "kN": 1e3}
_LEVEL = {"dB": 1.0}
_TORQUE = {"N*m": 1.0, "Nm": 1.0, "N·m": 1.0, "mN*m": 1e-3}
_UPPER: tuple[Sense, ...] = ("<=",)
_LOWER: tuple[Sense, ...] = (">=",)
_BOTH: tuple[Sense, ...] = ("<=", ">=")
#: First three derivatives of s with respect to the cam angle: name, title, divisor of the unit, and
#: accepted units with their factors to SI.
_DERIVATIVES = tuple(
    (name, title, over, {f"mm{over}": 1e-3, f"m{over}": 1.0, f"um{over}": 1e-6})
    for name, title, over in (
        ("velocity", "s′", "/rad"),
        ("acceleration", "s″", "/rad^2"),
        ("jerk", "s‴", "/rad^3"),
    )
)

_jump = partial(LawQuantity, unit="rpm", units=SPEED_UNITS, senses=_LOWER, campaign=True)
_at_speed = partial(LawQuantity, where="rpm")
_of_run = partial(_at_speed, campaign=True, of_run=True)

#: Quantities that a design can optimise or limit. Campaigns can measure those with ``campaign``
#: True.
_DESIGN = (
    _jump("jump_speed", "jump speed from rest",
          value=lambda subject, *_: values.jump(
              subject, follower_of(subject.rig), REST_DURATION_S)),
    _jump("jump_speed_steady", "jump speed in steady state",
          value=lambda subject, *_: values.jump(subject, follower_of(subject.rig), None)),
    _jump("jump_speed_rigid", "jump speed of one rigid mass", rigid=True,
          value=lambda subject, *_: values.jump(subject, subject.rigid, None)),
    _at_speed("residual_vibration", "residual vibration of the end mass, one event", "um", _LENGTH,
              values.residual, senses=_UPPER),
    *(
        LawQuantity(f"peak_{name}", f"peak |{title}|", f"mm{over}", units, values.peak_of(order),
                    senses=_UPPER, order=order)
        for order, (name, title, over, units) in enumerate(_DERIVATIVES, 1)
    ),
    LawQuantity("rms_acceleration", "r.m.s. of s″", "mm/rad^2", _DERIVATIVES[1][3],
                values.rms_acceleration, senses=_UPPER),
    _at_speed("peak_contact_force_rigid", "peak contact force of one rigid mass", "N", _FORCE,
              lambda subject, term, _: max(high for _, high in values.forces(subject, term)),
              senses=_UPPER, campaign=True),
    _at_speed("least_contact_force_rigid", "least contact force of one rigid mass", "N", _FORCE,
              lambda subject, term, _: min(low for low, _ in values.forces(subject, term)),
              senses=_LOWER, signed=True, campaign=True),
    _at_speed("shaft_torque", "peak |shaft torque|", "N*m", _TORQUE, values.torque, senses=_UPPER),
    _at_speed("sound_level_rigid", "sound level of one rigid mass", "dB", _LEVEL,
              values.rigid_level, senses=_UPPER, signed=True),
    _at_speed("sound_level_with_jumps", "sound level with landings, mean power over speeds", "dB",
              _LEVEL, values.level_with_jumps, senses=_UPPER, signed=True),
    LawQuantity("pressure_angle", "pressure angle", "deg", ANGLE_UNITS, values.pressure_angle,
                senses=_UPPER, below=0.25 * TURN),
    LawQuantity("radius_of_curvature", "least radius of curvature", "mm", _LENGTH,
                values.least_radius, senses=_LOWER),
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

#: Quantities that campaigns can measure, but no design can optimise or limit: those of steady turns
#: with the scene's follower model, the steady residual vibration, and the twist of the shaft.
_MEASURED = (
    _at_speed("residual_vibration_steady",
              "residual vibration of one mass on its stem in steady state", "um", _LENGTH,
              values.steady_residual, ranges=True, campaign=True),
    _of_run("least_contact_force", "least contact force", "N", _FORCE,
            values.row_value("min_force"), signed=True),
    _of_run("peak_contact_force", "peak contact force", "N", _FORCE,
            values.row_value("peak_force")),
    _of_run("sound_level", "sound level", "dB", _LEVEL, values.run_level, signed=True),
    _of_run("peak_torque", "peak torque", "N*m", _TORQUE, values.row_value("peak_torque")),
    _of_run("lift_offs", "lift-offs a turn", "", {"": 1.0}, values.row_value("lift_offs"),
            signed=True),
    _at_speed("twist", "twist, peak to peak", "rad", ANGLE_UNITS, values.twist, campaign=True),
)  # fmt: skip

#: All quantities by name.
QUANTITIES: Mapping[str, LawQuantity] = {q.name: q for q in (*_DESIGN, *_MEASURED)}
#: Quantities that can be a goal or a limit of a design.
DESIGN_QUANTITIES = {name: q for name, q in QUANTITIES.items() if q.senses}
#: Description of the moving parts of each follower model, by the name of the model, for titles.
MOVING_PARTS = {
    "kinetostatic": "one rigid mass held on the cam",
    "one_mass": "one rigid mass free to leave the cam",
    "elastic_stem": "a mass on its stem held on the cam",
    "two_mass": "two masses",
    "torsional": "a rigid mass on a twisting shaft",
}


@cache
def campaign_quantities(model: str) -> Mapping[str, LawQuantity]:
    """Return the quantities by name that a campaign can measure with a follower model.

    ``model`` is the name of the scene's model. The titles of quantities that depend on the model
    describe its moving parts. Upper and lower limits are allowed.
    """
    quantities = {}
    for quantity in QUANTITIES.values():
        if quantity.campaign:
            title = quantity.title + (f" of {MOVING_PARTS[model]}" if quantity.of_run else "")
            quantities[quantity.name] = replace(quantity, title=title, senses=_BOTH)
    return MappingProxyType(quantities)
