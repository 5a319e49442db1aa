"""Spectrum of force and sound by orders: function, inputs, and result with tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from cam_rig.arguments import check_arguments
from cam_rig.dynamics import MODELS
from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.laws import Law
from cam_rig.laws.cam import law_of, require_sprung
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.load import cam_path, config_root, file_exists, read_yaml, resolve_path
from cam_rig.schema.scene import present_model_name
from cam_rig.show.result import (
    NULL_PROGRESS,
    Column,
    Footnote,
    Progress,
    Records,
    Result,
    subject_line,
)
from cam_rig.simulation.inputs import (
    Rig,
    Speeds,
    check_speeds,
    default_rig,
    read_cams,
    resolve_rig,
    resolve_scene,
)
from cam_rig.simulation.scene import LoadedScene, speeds_of
from cam_rig.studies.orders import MAX_ORDERS
from cam_rig.studies.orders.spectrum import CamOrders, OrderSpectrum, waterfall
from cam_rig.units import RPM

#: Number of loudest orders that the table of speeds lists for each cam and speed.
LOUDEST_COUNT = 2
#: Largest number of rows with which the table of orders is displayed. A longer table is only
#: exported.
MAX_SHOWN_ROWS = 40


class OrdersRow(NamedTuple):
    """Table row: the spectrum of a cam at one speed, and the index of an order in it."""

    cam: str
    spectrum: OrderSpectrum
    order_index: int = 0

    @property
    def has_sound(self) -> bool:
        """True if the rig has the parameters that a sound level requires."""
        return math.isfinite(self.spectrum.background_db)

    def loudest(self, rank: int) -> tuple[float, float] | None:
        """Return an order and its sound level (dB) by rank, 0 for the loudest.

        Returns None without sound, or if there are too few orders.
        """
        orders, level = self.spectrum.orders[1:], self.spectrum.level[1:]
        if level.size <= rank or not self.has_sound:
            return None
        index = np.argsort(-level, kind="stable")[rank]
        return float(orders[index]), float(level[index])


def _at_order(name: str) -> Callable[[OrdersRow], float]:
    """Return a function that reads one value of a table row from its spectrum.

    ``name`` is an array property of `OrderSpectrum`. The function returns its element for the order
    of the row.
    """
    return lambda row: float(getattr(row.spectrum, name)[row.order_index])


def _loudest_column(rank: int) -> Column:
    """Return the table column of one of the loudest orders, with its level (dB).

    ``rank`` is 0 for the loudest order.
    """

    def text(row: OrdersRow) -> str | None:
        order = row.loudest(rank)
        return order and f"{order[0]:g}: {order[1]:.1f}"

    return Column(f"loudest_{rank + 1}", of=lambda row: (row.loudest(rank) or [None])[0], cell=text)


@dataclass(frozen=True, repr=False)
class OrdersResult(Result):
    """Spectrum of each cam at each speed, by orders of the cam's rotation.

    `titles` are the display names by cam. A cam without a title is shown by its name.
    """

    schema = "cam_rig.orders.1"
    plot_function = "cam_rig.studies.orders.figures:figure"
    columns: ClassVar = {
        "orders": (
            Column("cam"),
            Column("rpm", "rpm", ".6g", "speed", "spectrum.rpm"),
            Column("order", "", ".6g", of=_at_order("orders")),
            Column("frequency", "Hz", ".2f", of=_at_order("frequency")),
            Column("force_amplitude", "N", ".4g", of=_at_order("amplitude")),
            Column(
                "force_phase",
                "°",
                ".1f",
                of=lambda row: float(np.angle(row.spectrum.force[row.order_index])),
            ),
            Column("level", "dB", ".1f", "sound level", _at_order("level")),
        ),
        "speeds": (
            Column("cam"),
            Column("rpm", "rpm", ".6g", "speed", "spectrum.rpm"),
            Column(
                "period",
                "",
                "d",
                "period, turns",
                "spectrum.steady.turns",
                lambda row: row.spectrum.steady.turns if row.spectrum.steady.settled else None,
                missing="none",
            ),
            Column("mean_force", "N", ".2f", of="spectrum.amplitude.0"),
            Column("level", "dB", ".1f", "sound", "spectrum.total_db"),
            Column("background_level", "dB", ".1f", "background", "spectrum.background_db"),
            *map(_loudest_column, range(LOUDEST_COUNT)),
            Column("settled", of="spectrum.steady.settled", hidden=True),
        ),
        "run": (Column("rig", of="rig.name"), Column("model")),
    }

    studies: tuple[CamOrders, ...]
    titles: Mapping[str, str] = field(default_factory=dict)

    @property
    def subject(self) -> str:
        """Cams, rig and model."""
        study = self.studies[0]
        return subject_line((each.cam for each in self.studies), study.rig.name, study.model)

    @property
    def speed_rows(self) -> list[OrdersRow]:
        """Rows of the table of speeds, one per cam and cam speed."""
        return [OrdersRow(study.cam, each) for study in self.studies for each in study.spectra]

    @property
    def speeds(self) -> Records:
        """Table with one row per cam and speed.

        It contains the mean force, the sound level of all orders, and the loudest orders.
        """
        rows = self.speed_rows
        highest = max((row.spectrum.orders[-1] for row in rows), default=0.0)
        return self.table(
            "speeds",
            f"Orders 1 to {highest:g} of the steady turn",
            rows,
            Footnote(
                "Sound: level of these orders together. Loudest: the order, and its level in dB re "
                "20 µPa. The background is noise without orders.",
                lambda row: row.has_sound,
            ),
            Footnote(
                "The pulse of a landing extends to some kHz: more orders contain more of it.",
                lambda row: row.spectrum.steady.landings,
            ),
            Footnote(
                "none: the force is not periodic. The values are those of the last simulated turn.",
                lambda row: not row.spectrum.steady.settled,
            ),
        )

    def tables(self) -> list[Records]:
        """Return the tables ``orders``, ``speeds`` and ``run``.

        The table ``orders`` starts at order 1. It does not contain the mean force, order 0.
        """
        rows = [
            row._replace(order_index=index)
            for row in self.speed_rows
            for index in range(1, row.spectrum.orders.size)
        ]
        orders = self.table(
            "orders",
            "Force and sound by orders of the cam",
            rows,
            "Phase: force = mean + Σ amplitude · cos(order · θ + phase). Level: dB re 20 µPa.",
            hidden=len(rows) > MAX_SHOWN_ROWS,
        )
        run: list[Any] = list(self.studies[:1])
        return [orders, self.speeds, self.table("run", "The model", run, single=True, hidden=True)]

    def summary(self) -> list[str]:
        """Return a sentence with the missing parameters if the sound is left out.

        It is empty otherwise.
        """
        study = self.studies[0]
        keys = " and ".join(study.rig.missing_for_sound(MODELS[study.model].lifts_off))
        return [f"sound left out: rig {study.rig.name} has no {keys}"] if keys else []


# Inputs: a scene, or a cam alone with the following defaults.
#: Name of the rig that is used for a cam without a scene.
CAM_RIG = "tm21"
#: Name of the follower's model that is used for a cam without a scene.
CAM_MODEL = "one_mass"
#: Cam speeds (rpm) that are used for a cam without a scene.
CAM_RPM = tuple(range(200, 401, 10))


@check_arguments
def order_spectrum(
    source: str | Path | CamConfig | LoadedScene,
    rpm: Speeds | None = None,
    *,
    cam: str | None = None,
    rig: Rig = None,
    model: str | None = None,
    orders: int = 100,
    progress: Progress = NULL_PROGRESS,
) -> OrdersResult:
    """Return the spectrum of force and sound by orders of the cam, without leakage.

    An order is a frequency as a multiple of the cam's rotational frequency. The Fourier
    coefficients of the steady turn, including its landings, are closed forms.

    The command is ``cam-rig orders``.

    Parameters
    ----------
    source : Cam, Scene, str or Path
        Cam or scene: a name, a path, or the result of `load_cam` or `load_scene`. A cam alone is
        placed on the rig ``tm21`` with the model ``one_mass``, at 200 to 400 rpm.
    rpm : float or sequence of float, optional
        One or more speeds in rpm (default: those of the scene).
    cam : str, optional
        Name of one cam of a scene (default: all).
    rig : Rig, str or Path, optional
        Rig: a name, a path or a rig (default: that of the scene).
    model : str, optional
        Model, as in `simulate` (default: that of the scene).
    orders : int, optional
        Highest order, 1 to 10 000 (default: 100).
    progress : Progress, optional
        Receiver of the progress.

    Returns
    -------
    OrdersResult
        The spectra of each cam at each speed.

    Raises
    ------
    ConfigError
        If a cam, scene, rig or model is unknown, or a number is out of range.

    Examples
    --------
    >>> import cam_rig
    >>> found = cam_rig.order_spectrum("poly345", rpm=300, orders=10)
    >>> int(found.to_pandas().order.max())
    10
    """
    if not 1 <= orders <= MAX_ORDERS:
        raise ConfigError(f"orders must be between 1 and {MAX_ORDERS}, got {orders}")
    laws, titles, chosen, own_model, own_rpm = _resolve_source(source, cam, rig)
    speeds = own_rpm if rpm is None else check_speeds(rpm)
    rad_s = [speed * RPM for speed in speeds]
    studies = waterfall(
        laws, present_model_name(model or own_model), chosen, rad_s, orders, progress
    )
    return OrdersResult(studies, titles)


def _resolve_source(
    source: str | Path | CamConfig | LoadedScene, cam: str | None, rig: Rig
) -> tuple[dict[str, Law], dict[str, str], RigConfig, str, list[float]]:
    """Return the inputs of the study from a scene or a cam.

    They are the laws by cam, the titles by cam, the rig, the name of the model, and the speeds in
    rpm. ``cam`` selects one cam of a scene.
    """
    if isinstance(source, CamConfig) or (not isinstance(source, LoadedScene) and _is_cam(source)):
        if cam is not None:
            raise ConfigError(f"--cam requires a scene, got the cam {source}")
        ((path, loaded),) = read_cams([source])
        require_sprung(path, loaded)
        law, title = {loaded.name: law_of(path, loaded)}, {loaded.name: loaded.title}
        if rig is None:
            rig = default_rig([path if isinstance(path, Path) else loaded], CAM_RIG)
        return law, title, resolve_rig(rig, source), CAM_MODEL, [*map(float, CAM_RPM)]
    scene = resolve_scene(source, rig)
    laws = dict(scene.laws) if cam is None else {cam: scene.law_of(cam)}
    return laws, scene.titles, scene.rig, scene.scene.model, speeds_of(scene.scene)


def _is_cam(source: str | Path) -> bool:
    """Return True if a file or a shipped name is that of a cam, False for a scene.

    Raises ConfigError if there is no such cam or scene.
    """
    path = resolve_path("scenes", source)
    if not file_exists(path):
        if file_exists(cam_path(source)):
            return True
        names = [file.stem for file in config_root().glob("[cs][ac]*/*.yaml")]
        raise ConfigError(
            f"{source}: no such cam or scene{did_you_mean(str(source), names)}; use a file, or a "
            "name in config/cams or config/scenes"
        )
    data = read_yaml(path)
    return isinstance(data, dict) and "segments" in data
