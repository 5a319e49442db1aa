"""Cams, rigs and designs that tests of designs share."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cam_rig.law_design.design import search_design
from cam_rig.law_design.request import DesignRequest, LawClass, Multistart
from cam_rig.law_design.result import LawDesign
from cam_rig.law_design.space import DesignProblem, Space
from cam_rig.laws import build_law
from cam_rig.quantities.catalogue import DESIGNED
from cam_rig.quantities.terms import Term, parse_term
from cam_rig.schema import CamConfig, RigConfig, load_cam, load_rig
from cam_rig.schema.load import config_root

RIG = load_rig(config_root() / "rigs" / "paper_table2.yaml")


def cam(name: str = "poly345") -> CamConfig:
    return load_cam(config_root() / "cams" / f"{name}.yaml")


def term(text: str) -> Term:
    return parse_term(text, DESIGNED)


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


def written(found: LawDesign, folder: Path) -> CamConfig:
    """The cam as its file has it."""
    file = folder / f"{found.cam.name}.yaml"
    file.write_text(found.text, encoding="utf-8")
    return load_cam(file)
