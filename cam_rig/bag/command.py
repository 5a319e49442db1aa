"""cam-rig analyze: the noise comparison from a bag."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.show.command import command
from cam_rig.show.terminal import say

if TYPE_CHECKING:
    pass


# cam-rig export: the samples of a run as named columns in a file.


# cam-rig recover: a valid bag from one that is truncated or damaged.


@command()
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
    from cam_rig.bag.recover import recover as recover_bag

    place = bag if bag.name not in ("", "..") else bag.resolve()
    target = output or place.parent / (f"{place.stem if place.is_file() else place.name}_recovered")
    say(f"{target}: {recover_bag(bag, target).words}")


def newest_bag() -> Path:
    """The bag under ``bags/`` that was written last, of those that were closed."""
    from cam_rig.bag.files import METADATA, is_unclosed
    from cam_rig.errors import BagError

    found = sorted(Path("bags").glob(f"*/{METADATA}"), key=lambda p: p.stat().st_mtime)
    for bag in (file.parent for file in reversed(found)):
        if not is_unclosed(bag):
            return bag
        say(f"{bag}: was not closed, an older one is taken; see: cam-rig recover")
    raise BagError("no bag in bags/; make one with: cam-rig run")
