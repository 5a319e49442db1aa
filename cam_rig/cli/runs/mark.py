"""cam-rig panel --mark: the marks of lab sheets."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cam_rig.cli.common.console import say, show
from cam_rig.cli.common.names import cam_path, rig_path
from cam_rig.cli.common.outputs import check_outputs, write_csv, write_json

if TYPE_CHECKING:
    from cam_rig.schema import CamConfig, RigConfig


def mark_sheets(
    sheets: list[Path],
    cam: str | None,
    rig: str | None,
    tolerance: float | None,
    json_target: str | None,
    csv: Path | None,
) -> None:
    """Mark lab sheets, and print a table and a line of each.

    Parameters
    ----------
    cam, rig : files that the sheets are of; None for shipped ones of the names on the sheets
    tolerance : %, within which a reading is right; None for 1 %

    Raises
    ------
    ConfigError : no sheet, or none of this cam and rig
    OutputError : a result cannot be written
    """
    from cam_rig.errors import ConfigError
    from cam_rig.panel.lab.marking import TOLERANCE_PERCENT, mark_sheet, marks_table, to_json
    from cam_rig.schema import load_cam, load_rig

    check_outputs(json_target, None, csv)
    if not sheets:
        raise ConfigError("--mark: no sheet is named; allowed: .csv files of cam-rig panel --lab")

    def cam_of(name: str) -> CamConfig:
        _require_name("cam", name)
        found = load_cam(cam_path(cam or name))
        _require_same("cam", name, found.name)
        return found

    def rig_of(name: str) -> RigConfig:
        _require_name("rig", name)
        found = load_rig(rig_path(rig or name))
        _require_same("rig", name, found.name)
        return found

    within = TOLERANCE_PERCENT if tolerance is None else tolerance
    marked = [mark_sheet(path, within, cam_of, rig_of) for path in sheets]
    tables = [marks_table(sheet) for sheet in marked]
    show(*tables)
    say(*(sheet.summary for sheet in marked))
    write_csv(tables, csv)
    write_json(to_json(marked), json_target)


def _require_name(kind: str, name: str) -> None:
    """Refuse what would be a path to somewhere."""
    from cam_rig.errors import ConfigError
    from cam_rig.files import shown
    from cam_rig.schema.load import NAME

    if not NAME.fullmatch(name):
        raise ConfigError(f"{kind} is {shown(name)}; allowed: a name as {kind} files have it")


def _require_same(kind: str, name: str, found: str) -> None:
    from cam_rig.errors import ConfigError

    if name != found:
        option = "--rig FILE" if kind == "rig" else "the cam's file"
        raise ConfigError(
            f"is of {kind} {name!r}, marked with {found!r}; allowed: the same, so name {option}"
        )
