"""The largest waviness of each wavelength from Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cam_rig.api.arguments import checked
from cam_rig.api.campaign import opened
from cam_rig.api.notebook import shown
from cam_rig.arrays import FloatArray
from cam_rig.errors import ConfigError
from cam_rig.extras import libraries_named
from cam_rig.studies.campaign.largest_waviness import (
    LargestWaviness,
    WavinessSearch,
    find_largest,
)
from cam_rig.studies.campaign.profile_errors import require_wavelength
from cam_rig.studies.campaign.run import InThisProcess

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

#: Wavelengths of one search, at most; each takes seconds.
MOST = 100_000


@dataclass(frozen=True, eq=False, repr=False)
class WavinessRun:
    """The largest waviness of each wavelength, SI: a `LargestWaviness` each in ``wavelengths``."""

    search: WavinessSearch
    wavelengths: tuple[LargestWaviness, ...]

    def __repr__(self) -> str:
        """What, and how many."""
        name = self.search.campaign.config.name
        return f"WavinessRun({name}: {len(self.wavelengths)} wavelengths)"

    def to_pandas(self) -> DataFrame:
        """A row each wavelength; m and rad, NaN for an end that so few draws do not tell.

        Raises
        ------
        MissingLibraryError : pandas is not installed
        """
        with libraries_named():
            from pandas import DataFrame
        names = ("wavelength", "waves", "amplitude", "low", "high", "outcome", "evaluations")
        columns = {name: [getattr(one, name) for one in self.wavelengths] for name in names}
        found = DataFrame(columns)
        return found.astype({"low": float, "high": float})

    def plot(self) -> Figure:
        """Amplitude over wavelength, with its interval and the resonances of the stem.

        Raises
        ------
        MissingLibraryError : matplotlib is not installed
        """
        with libraries_named():
            from cam_rig.plots.campaign.waviness import figure
        return shown(figure(self.search, self.wavelengths))


@checked
def largest_waviness(
    study: str | Path | Mapping[str, Any],
    wavelengths: int | Sequence[float] | FloatArray = 24,
    *,
    points: int | None = None,
    seed: int | None = None,
    executor: Executor | None = None,
) -> WavinessRun:
    """Find the largest waviness with which 99 % of a study's draws keep its limits.

    Parameters
    ----------
    study : a name in ``config/campaigns``, a path, or what such a file holds; with limits and
        a waviness
    wavelengths : how many over the study's range, to which those at the stem's resonance are added;
        or the wavelengths themselves, rad
    points, seed : draws in place of the study's; from 368 on the interval has both ends
    executor : where wavelengths are searched: a `ProcessPoolExecutor`, Dask's
        ``client.get_executor()``; None is this process. What is found is the same

    Raises
    ------
    ConfigError : something wrong in the study, or no limits or waviness in it
    RunError : the executor broke down

    Examples
    --------
    >>> import math, cam_rig
    >>> found = cam_rig.largest_waviness("tolerance_poly345", [math.radians(18.0)], points=4)
    >>> [(one.outcome, round(one.waves, 6)) for one in found.wavelengths]
    [('found', 20.0)]
    >>> 1e-6 < found.wavelengths[0].amplitude < 1e-5  # m
    True
    """
    search = WavinessSearch(opened(study).planned(points, seed))
    if isinstance(wavelengths, int):
        if not 1 <= wavelengths <= MOST:
            allowed = f"1 to {MOST}, or angles (rad)"
            raise ConfigError(f"wavelengths: is {wavelengths}; allowed: {allowed}")
        asked = search.wavelengths(wavelengths)
    else:
        asked = np.ravel(np.array(wavelengths, dtype=np.float64))
        for one in asked.tolist():
            require_wavelength(one)
    return WavinessRun(search, tuple(find_largest(search, asked, executor or InThisProcess())))
