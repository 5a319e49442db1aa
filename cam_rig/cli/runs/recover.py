"""cam-rig recover: a valid bag from one that is truncated or damaged."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from cam_rig.cli.common.console import console, user_errors


def recover(
    bag: Annotated[Path, typer.Argument(help="Bag folder or .mcap file that cannot be read.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--out", "--output", help="New bag; by default BAG_recovered. Must not exist yet."
        ),
    ] = None,
) -> None:
    """Copy everything readable of a damaged or unfinished bag into a new, valid one.

    The damaged bag is left as it is. What is missing is printed: ticks of the scene, or messages.
    A recovery that was interrupted can be repeated.

    Examples
    --------
    cam-rig recover bags/tm21_sweep_2026-01-31_12-00-00

    cam-rig recover broken.mcap --out bags/recovered
    """
    with user_errors():
        from cam_rig.bag.recording.recover import recover as recover_bag

        target = output or _beside(bag)
        saved = recover_bag(bag, target)
        console.print(escape(f"{target}: {saved.words}"))


def _beside(bag: Path) -> Path:
    """The default output, also of a bag that is named ``.``."""
    place = bag if bag.name not in ("", "..") else bag.resolve()
    return place.parent / f"{place.stem if place.is_file() else place.name}_recovered"
