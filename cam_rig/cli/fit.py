"""Command group cam-rig fit: numbers of a cam, a rig or its sound from measurements."""

from __future__ import annotations

import typer

from cam_rig.show.command import StrictCommand
from cam_rig.studies.fit_cam.command import fit_cam
from cam_rig.studies.fit_rig.command import fit_rig
from cam_rig.studies.fit_sound.command import fit_sound

fit = typer.Typer(no_args_is_help=True, rich_markup_mode="markdown")


@fit.callback()
def _group() -> None:
    """Find the numbers of a cam, a rig or its sound from measurements."""


fit.command("rig", cls=StrictCommand)(fit_rig)
fit.command("cam", cls=StrictCommand)(fit_cam)
fit.command("sound", cls=StrictCommand)(fit_sound)
