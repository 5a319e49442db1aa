"""Schema of a campaign file, which describes many rigs to be measured.

It has a base (cam, rig, scene), variations of its numbers (the inputs), a plan of the points,
measures, and limits on measures. A point is one combination of input values.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, FiniteFloat, model_validator

from cam_rig.schema.load import NAME, is_path
from cam_rig.schema.named import Name
from cam_rig.schema.quantity import UNITS, Strict
from cam_rig.schema.scene import Model

#: Unit of a variation in percent of the value in the files on which the campaign is based.
PERCENT = "%"
#: Largest number of points (rigs) of a campaign. Results are read one column at a time, and a
#: column of this length takes 0.8 GB.
MAX_POINTS = 100_000_000
#: Largest number of grid values of an input that is given as a range.
MAX_COUNT = 100_000
#: Largest number of varied numbers (inputs) of a campaign.
MAX_INPUTS = 100


def _check_file(text: str) -> str:
    if not (is_path(text) or NAME.fullmatch(text)):
        raise ValueError(
            "must be a name of lower-case letters, digits and _, or the path of a .yaml file "
            f"relative to the study's folder, got {text!r}"
        )
    return text


#: Name of a shipped file, or path of a file relative to the campaign file's folder.
FileOrName = Annotated[str, AfterValidator(_check_file)]
Finite = Annotated[FiniteFloat, Field(strict=True)]
Spread = Annotated[FiniteFloat, Field(strict=True, ge=0.0)]
PlanKind = Literal["grid", "latin_hypercube", "sobol", "shares"]


class Variation(Strict):
    """Variation of one number of the cam, the rig or the scene.

    It has exactly one of ``values`` (a list), ``range`` (lower and upper end), ``normal`` and
    ``uniform``. These numbers are in ``unit``, or in percent of the number in the base. ``normal``
    is a standard deviation; the distribution is truncated to ``within`` on both sides of the mean.
    ``uniform`` is half of the width of a uniform distribution. The mean is the number in the base
    by default. On a grid a range has ``count`` values. ``source`` is a free text on the origin of
    the variation.
    """

    values: list[Finite] | None = Field(default=None, min_length=1)
    range: tuple[Finite, Finite] | None = None
    normal: Spread | None = None
    uniform: Spread | None = None
    mean: Finite | None = None
    within: Annotated[FiniteFloat, Field(strict=True, gt=0.0)] | None = None
    count: int | None = Field(default=None, strict=True, ge=2, le=MAX_COUNT)
    unit: str
    source: str = ""

    @model_validator(mode="after")
    def _one_kind(self) -> Variation:
        kinds = ("values", "range", "normal", "uniform")
        named = [kind for kind in kinds if getattr(self, kind) is not None]
        if len(named) != 1:
            raise ValueError(
                f"must have exactly one of {', '.join(kinds)}, got {' and '.join(named) or 'none'}"
            )
        for key, owners in (
            ("mean", ("normal", "uniform")),
            ("within", ("normal",)),
            ("count", ("range",)),
        ):
            if getattr(self, key) is not None and named[0] not in owners:
                raise ValueError(f"{key} requires {' or '.join(owners)}, got {named[0]}")
        if self.range is not None and not self.range[0] < self.range[1]:
            raise ValueError(f"range must be rising, got {list(self.range)}")
        if self.values is not None and len(set(self.values)) != len(self.values):
            raise ValueError(f"values must differ from each other, got {self.values}")
        return self

    @model_validator(mode="after")
    def _check_unit(self) -> Variation:
        units = {unit for group in UNITS.values() for unit in group}
        if self.unit not in units | {PERCENT}:
            allowed = ", ".join(sorted(units - {"1"}))
            raise ValueError(f"unit must be % or one of {allowed}, got {self.unit!r}")
        if self.unit == PERCENT and self.mean is not None:
            raise ValueError("mean cannot be combined with the unit %; remove it")
        return self


class CampaignBase(Strict):
    """Base of a campaign: a scene with its cam and rig, or a cam and a rig.

    The numbers of the base are varied. Each file is a name, or a path relative to the campaign
    file's folder. ``model`` is the dynamic model for measures that need a motion. It is that of the
    scene. Without a scene the default is two masses if the rig defines how its mass is split,
    otherwise one mass.
    """

    scene: FileOrName | None = None
    cam: FileOrName | None = None
    rig: FileOrName | None = None
    model: Model | None = None

    @model_validator(mode="after")
    def _check_base(self) -> CampaignBase:
        if self.scene is None and (self.cam is None or self.rig is None):
            raise ValueError("requires a scene, or a cam and a rig")
        if self.scene is not None and (self.rig is not None or self.model is not None):
            raise ValueError("a scene has its rig and model, so it can be combined with cam only")
        return self


class CorrelatedPair(Strict):
    """Correlation of two inputs of a campaign.

    ``coefficient`` is the correlation of the two normal variables from which the inputs are drawn
    (a Gaussian copula).
    """

    inputs: tuple[str, str]
    coefficient: Annotated[FiniteFloat, Field(strict=True, gt=-1.0, lt=1.0)]


class CampaignPlan(Strict):
    """Plan of the points of a campaign: kind, number of points and seed.

    For the kind ``shares`` (Sobol indices of d inputs), ``points`` is the size of the base sample.
    Each of its points gives d + 2 rows. A grid has no ``points``.
    """

    kind: PlanKind
    points: int | None = Field(default=None, strict=True, ge=1)
    seed: int = Field(default=1, strict=True, ge=0, lt=2**63)

    @model_validator(mode="after")
    def _points(self) -> CampaignPlan:
        if self.kind == "grid" and self.points is not None:
            raise ValueError("points cannot be combined with a grid, which has values and counts")
        if self.kind != "grid" and self.points is None:
            raise ValueError(f"points is missing; {self.kind} requires it")
        if self.kind == "shares" and self.points is not None and self.points & (self.points - 1):
            raise ValueError(f"points must be a power of 2 for shares, got {self.points}")
        return self


class CampaignConfig(Strict):
    """Content of a campaign file in ``config/campaigns/``.

    ``vary`` maps the path of a number, such as ``rig.follower.mass``, to its variation.
    ``measures`` are quantities such as ``jump_speed``, and ``limits`` are limits on some of them.
    """

    name: Name
    title: str
    base: CampaignBase
    vary: dict[str, Variation] = Field(min_length=1, max_length=MAX_INPUTS)
    correlated: list[CorrelatedPair] = Field(default_factory=list)
    plan: CampaignPlan
    measures: list[str] = Field(min_length=1)
    limits: list[str] = Field(default_factory=list)

    @model_validator(mode="after")
    def _plan_fits(self) -> CampaignConfig:
        kind = self.plan.kind
        for path, variation in self.vary.items():
            if kind != "grid" and variation.count is not None:
                raise ValueError(f"vary.{path}.count requires a grid, got {kind}")
            if kind == "grid" and variation.values is None and variation.count is None:
                raise ValueError(
                    f"vary.{path} must have values, or a range with its count, on a grid"
                )
        if self.correlated and kind in ("grid", "shares"):
            raise ValueError(
                f"correlated cannot be combined with {kind}, which requires independent inputs; "
                "use sobol or latin_hypercube"
            )
        return self

    @model_validator(mode="after")
    def _pairs(self) -> CampaignConfig:
        pairs = set()
        for pair in self.correlated:
            unknown = [path for path in pair.inputs if path not in self.vary]
            if unknown or pair.inputs[0] == pair.inputs[1]:
                raise ValueError(
                    f"correlated must be two of {', '.join(self.vary)}, got {list(pair.inputs)}"
                )
            if frozenset(pair.inputs) in pairs:
                raise ValueError(f"correlated: {list(pair.inputs)} is repeated; remove one")
            pairs.add(frozenset(pair.inputs))
        return self
