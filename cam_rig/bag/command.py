"""Command ``cam-rig recover``, and the search for the newest bag in ``bags/``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cam_rig.show.command import command
from cam_rig.show.terminal import say


@command()
def recover(
    bag: Annotated[Path, typer.Argument(help="Bag folder or .mcap file that cannot be read.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--out", "--output", help="New bag, which must not exist yet (default: BAG_recovered)."
        ),
    ] = None,
) -> None:
    """Copy everything readable of a damaged or unfinished bag into a new, valid bag.

    The damaged bag is not changed. The command prints the missing ticks of the scene, or the
    missing messages. A recovery that was interrupted can be repeated.

    Examples
    --------
    cam-rig recover bags/tm21_sweep_2026-01-31_12-00-00

    cam-rig recover broken.mcap --out bags/recovered
    """
    from cam_rig.bag.recover import recover as recover_bag

    source = bag if bag.name not in ("", "..") else bag.resolve()
    target = output or source.parent / (
        f"{source.stem if source.is_file() else source.name}_recovered"
    )
    say(f"{target}: {recover_bag(bag, target).text}")


def newest_bag() -> Path:
    """Return the closed bag under ``bags/`` that was written last.

    Raises BagError if there is no closed bag. A bag that was not closed is skipped, and the command
    that recovers it is printed.
    """
    from cam_rig.bag.files import METADATA, is_unclosed
    from cam_rig.errors import BagError

    metadata_files = sorted(Path("bags").glob(f"*/{METADATA}"), key=lambda p: p.stat().st_mtime)
    for bag in (file.parent for file in reversed(metadata_files)):
        if not is_unclosed(bag):
            return bag
        say(f"{bag}: was not closed and is skipped; recover it with: cam-rig recover {bag}")
    raise BagError("no closed bag in bags/; record one with: cam-rig run")
