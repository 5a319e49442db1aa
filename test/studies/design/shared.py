"""Cams, rigs and designs for tests of law designs, and a separate integration.

A design is a search for a motion law.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.laws import Law, build_law
from cam_rig.quantities.catalogue import DESIGN_QUANTITIES
from cam_rig.quantities.terms import Term, parse_term
from cam_rig.schema import CamConfig, RigConfig, load_cam, load_rig
from cam_rig.schema.load import config_root
from cam_rig.studies.design.request import DesignRequest, LawClass, Multistart
from cam_rig.studies.design.result import LawDesign
from cam_rig.studies.design.space import DesignProblem, Space
from cam_rig.studies.design.study import search_design
from cam_rig.units import TURN, FloatArray

RIG = load_rig(config_root() / "rigs" / "paper_table2.yaml")
#: Limit of a design: the peak acceleration must not exceed that of the start law.
NO_HARDER = ("peak_acceleration<=start",)


def cam(name: str = "poly345") -> CamConfig:
    return load_cam(config_root() / "cams" / f"{name}.yaml")


def term(text: str) -> Term:
    return parse_term(text, DESIGN_QUANTITIES)


def problem(law_class: LawClass, name: str = "poly345") -> DesignProblem:
    law = build_law(cam(name))
    return DesignProblem(cam(name), law, RIG, Space(law, law_class))


def designed(
    law_class: LawClass,
    start: CamConfig | None = None,
    rig: RigConfig = RIG,
    starts: int = 4,
    **words: Any,
) -> LawDesign:
    request = DesignRequest.of(law_class=law_class, multistart=Multistart(starts), **words)
    return search_design(start or cam(), rig, request)


def written(design: LawDesign, folder: Path) -> CamConfig:
    """Write the cam file of a design to a folder, and return the cam read from it."""
    file = folder / f"{design.cam.name}.yaml"
    file.write_text(design.text, encoding="utf-8")
    return load_cam(file)


def peak_torque(law: Law, speed: float, rig: RigConfig = RIG) -> float:
    """Return the largest |torque| (N·m) of one rigid mass at a speed (rad/s).

    The torque is (k s + c Ω s' + m Ω² s'' + F₀) s', evaluated at 7201 angles.
    """
    p = FollowerParameters.from_rig(rig)
    s, slope, curvature = law.motion_at(np.linspace(0.0, TURN, 7201))
    force = p.spring_stiffness * s + p.damping * speed * slope + p.mass * speed**2 * curvature
    return float(np.abs((force + p.preload) * slope).max())


def integrated(law: Law, p: TwoMassParameters, speed: float, times: FloatArray) -> FloatArray:
    """Return the contact force (N) of two masses from rest at the given times (s).

    It is integrated numerically by DOP853, independently of cam_rig. `speed` is in rad/s.
    """

    def rate(time: float, state: FloatArray) -> list[float]:
        s, slope, _ = law.at(speed * time % TURN)
        force = p.stem_stiffness * (s - state[0]) + p.stem_damping * (speed * slope - state[1])
        pull = p.spring_stiffness * state[0] + p.damping * state[1] + p.preload
        return [state[1], (force - pull) / p.end_mass]

    s, slope, _ = law.at(0.0)
    start = [p.share * s - p.preload / p.stiffness, p.share * slope * speed]
    tight = {"rtol": 1e-9, "atol": 1e-14, "max_step": 5e-4}
    y, v = solve_ivp(rate, (0.0, times[-1]), start, "DOP853", times, **tight).y
    s, slope, curvature = law.motion_at(np.mod(speed * times, TURN))
    force = p.stem_stiffness * (s - y) + p.stem_damping * (speed * slope - v)
    return np.asarray(force + p.roller_mass * speed**2 * curvature)


def require_kept(design: LawDesign) -> None:
    """Require that a design improves its goal and satisfies its limits.

    The goal is compared with the start law. The relative tolerance of a limit is 1e-6.
    """
    goal, *limits = design.measures
    change = goal.result - goal.start
    assert (change if goal.sense == "<=" else -change) < 0.0
    for limit in limits:
        assert limit.limit is not None
        excess = limit.result - limit.limit
        assert (excess if limit.sense == "<=" else -excess) <= 1e-6 * abs(limit.limit), (
            limit.term.key
        )
