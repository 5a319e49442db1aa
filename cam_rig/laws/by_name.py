"""Laws by name: of cams over the turn, or bare rises, and the catalogue of all."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cam_rig.arguments import checked
from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.laws.cam import law_of
from cam_rig.laws.catalogue import families
from cam_rig.laws.results import CamLawsResult, LawsResult, RisesResult
from cam_rig.laws.segments import NAMED_RISES
from cam_rig.schema import CamConfig, load_cam
from cam_rig.schema.load import cam_path, config_root


@checked
def law(
    names: str | Path | CamConfig | Sequence[str | Path | CamConfig], *, rises: bool = False
) -> CamLawsResult | RisesResult:
    """Lift, velocity, acceleration and jerk over the cam angle, their peaks, and the joints.

    Peaks come from the roots of the next derivative. Several laws are laid over each other: as cams
    over the turn if each is a cam's, else as bare rises of unit lift over a unit span.

    The command is ``cam-rig law``.

    Parameters
    ----------
    names : a cam: a name, a path, or what `load_cam` gave; a rise by its name; or several
    rises : names that a cam and a rise have in common mean the rise

    Raises
    ------
    ConfigError : no such cam or rise, one named twice, or cams among rises
    LawError : a cam whose segments do not join

    Examples
    --------
    >>> import cam_rig
    >>> found = cam_rig.law("poly345")
    >>> found.summary()
    ['joints (others C4): 31.25° C2, 148.75° C2, 211.25° C2, 328.75° C2']
    """
    asked = [names] if isinstance(names, str | Path | CamConfig) else list(names)
    if not asked:
        raise ConfigError("names: is an empty list; allowed: a cam or a rise, or several")
    texts = [str(name) for name in asked if not isinstance(name, CamConfig)]
    if texts and _are_rises(texts, rises):
        if len(texts) < len(asked):
            raise ConfigError(f"{texts[0]!r} is a rise; allowed: cams with cams, rises with rises")
        return RisesResult(tuple(texts))
    found = []
    for one in asked:
        path = one.name if isinstance(one, CamConfig) else cam_path(one)
        cam = one if isinstance(one, CamConfig) else load_cam(cam_path(one))
        found.append((cam, law_of(path, cam)))
    return CamLawsResult(tuple(found))


@checked
def list_laws(family: str | None = None) -> LawsResult:
    """Every law by name, with its peaks per unit rise and unit span, and how smoothly it joins.

    The command is ``cam-rig laws``.

    Parameters
    ----------
    family : only one of ``polynomial``, ``start``, ``end`` (half-rises), ``classical``

    Raises
    ------
    ConfigError : no such family

    Examples
    --------
    >>> import cam_rig
    >>> table = cam_rig.list_laws("polynomial").to_pandas()
    >>> table.law.tolist()[:2]
    ['poly345', 'poly4567']
    """
    found = families()
    if family is None:
        return LawsResult(tuple(found.values()), free=True)
    if family not in found:
        hint = did_you_mean(family, found)
        raise ConfigError(f"--family {family!r}: no such family{hint}; allowed: {', '.join(found)}")
    return LawsResult((found[family],), free=False)


def _are_rises(names: Sequence[str], rises: bool) -> bool:
    """Whether the names are drawn as bare rises: when asked for, or when not all are cams."""
    cams = sorted(path.stem for path in (config_root() / "cams").glob("*.yaml"))
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ConfigError(f"{name!r} is named twice; allowed: each law once")
        if not _is_cam(name, cams) and name not in NAMED_RISES:
            hint = did_you_mean(name, [*cams, *NAMED_RISES])
            raise ConfigError(
                f"{name[:40]!r}: no such cam or rise{hint}; cams: {', '.join(cams)}; "
                f"rises: {', '.join(NAMED_RISES)}"
            )
    if not rises and all(_is_cam(name, cams) for name in names):
        return False
    alone = next((name for name in names if name not in NAMED_RISES), None)
    if alone is not None:
        other = next((f"{name!r} is a rise" for name in names if not _is_cam(name, cams)), None)
        raise ConfigError(
            f"{alone!r} is a cam and no rise, {other or '--rises asks for rises'}; allowed: cams "
            f"with cams, rises with rises; rises: {', '.join(NAMED_RISES)}"
        )
    return True


def _is_cam(name: str, cams: Sequence[str]) -> bool:
    """Whether it is a cam's name, or a path, which is a cam's or an error of its own."""
    return name in cams or cam_path(name) == Path(name)
