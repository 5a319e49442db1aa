"""cam-rig orders: force and sound of a steady turn by orders of the cam, over speed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.show.command import check_recording, command
from cam_rig.show.result import Progress, Result
from cam_rig.show.terminal import say

if TYPE_CHECKING:
    from cam_rig.laws import Law
    from cam_rig.schema import RigConfig

#: What a cam alone is put on: rig and model.
CAM_RIG, CAM_MODEL = "tm21", "one_mass"
#: Orders at most: a table that nobody reads, minutes.
MAX_ORDERS = 10_000

Source = Annotated[
    str, typer.Argument(metavar="CAM|SCENE", help="Cam or scene: a file, or a name in config.")
]
Speeds = Annotated[
    str | None, typer.Option(help="Speeds: 300, or 200,300, or 200:400:10; by default the scene's.")
]
OneCam = Annotated[str | None, typer.Option(help="One cam of a scene; by default all.")]
OwnRig = Annotated[
    str | None, typer.Option(help="Rig file, or a name in config/rigs; by default the scene's.")
]
OwnModel = Annotated[
    str | None, typer.Option(help="Model, as in a scene (two_mass); by default the scene's.")
]
Highest = Annotated[int, typer.Option("--orders", min=1, max=MAX_ORDERS, help="Highest order.")]
Save = Annotated[
    Path | None, typer.Option(help="Write a Rerun recording (.rrd): diagram and spectra.")
]


@command("json", "csv", "plot")
def orders(
    source: Source,
    rpm: Speeds = None,
    cam: OneCam = None,
    rig: OwnRig = None,
    model: OwnModel = None,
    highest: Highest = 100,
    save: Save = None,
    *,
    progress: Progress,
) -> Result:
    """Find the spectrum of force and sound by orders of the cam: exact, without leakage.

    An order is a frequency as a multiple of the cam's. The Fourier coefficients of the steady
    turn are closed forms, those of landings too. A cam alone is put on the rig tm21, model
    one_mass, at 200 to 400 rpm. The plot has the orders as rays over speed (Campbell diagram), of
    one speed as lines; the CSV has every order.

    Examples
    --------
    cam-rig orders poly345 --rpm 400

    cam-rig orders tm21_sweep --cam tm21 --rpm 200:400:5 --plot out/orders.png --csv out/orders.csv

    cam-rig orders poly345 --rig paper_table2 --model two_mass --rpm 300:500:5 --save out/orders.rrd
    """
    from cam_rig.paper.orders.spectrum import waterfall
    from cam_rig.paper.orders.study import OrdersResult
    from cam_rig.schema.scene import model_named
    from cam_rig.simulation.asked import speeds_asked
    from cam_rig.units import RPM

    if save is not None:
        check_recording(save)
    laws, titles, chosen_rig, own_model, own_speeds = _opened(source, cam, rig)
    speeds = [speed * RPM for speed in (own_speeds if rpm is None else speeds_asked(rpm))]
    chosen = model_named(model or own_model)
    found = waterfall(laws, chosen, chosen_rig, speeds, highest, progress)
    if save is not None:
        from cam_rig.paper.orders.chart import save_orders

        save_orders(found, save, titles)
        say(f"recording: {save}")
    return OrdersResult(found, titles)


def _opened(
    source: str, cam: str | None, rig: str | None
) -> tuple[dict[str, Law], dict[str, str], RigConfig, str, list[float]]:
    """Laws and titles by cam, rig, model, and speeds in rpm, of a scene or of a cam alone."""
    from cam_rig.laws.cam import law_of, require_sprung
    from cam_rig.schema import load_cam, load_rig
    from cam_rig.schema.load import cam_path, rig_path, scene_path
    from cam_rig.simulation.asked import speeds_asked
    from cam_rig.simulation.scene import open_scene
    from cam_rig.units import to_rpm

    if _is_cam(source):
        if cam is not None:
            raise ConfigError(f"--cam {cam}: {source} is a cam; allowed: with a scene")
        path = cam_path(source)
        loaded = load_cam(path)
        require_sprung(path, loaded)
        named = load_rig(rig_path(rig or CAM_RIG))
        law, title = {loaded.name: law_of(path, loaded)}, {loaded.name: loaded.title}
        return law, title, named, CAM_MODEL, speeds_asked("200:400:10")
    scene = open_scene(scene_path(source))
    laws = dict(scene.laws) if cam is None else {cam: scene.law_of(cam)}
    speeds = [round(to_rpm(speed), 9) for speed in scene.scene.program.speeds.si_list]
    chosen = load_rig(rig_path(rig)) if rig else scene.rig
    return laws, scene.titles, chosen, scene.scene.model, sorted(speeds)


def _is_cam(source: str) -> bool:
    """Whether a file, or a shipped name, is that of a cam."""
    from cam_rig.schema.load import cam_path, config_root, read_yaml, scene_path

    path = scene_path(source)
    if not path.exists():
        if cam_path(source).exists():
            return True
        there = [file.stem for file in config_root().glob("[cs][ac]*/*.yaml")]
        raise ConfigError(
            f"{source}: no such cam or scene{did_you_mean(source, there)}; allowed: a file, or a "
            "name in config/cams or config/scenes"
        )
    data = read_yaml(path)
    return isinstance(data, dict) and "segments" in data
