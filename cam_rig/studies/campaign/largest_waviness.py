"""The largest waviness for each wavelength with which 99 % of a study's draws keep its limits.

Every wavelength and amplitude is tried on the same draws of the other inputs (common random
numbers). Of each draw the amplitude up to which it keeps the limits is bracketed by bisection over
`WavinessSearch.amplitudes`; the largest waviness is then an order statistic of these amplitudes,
and its interval two others. It is taken that a draw which keeps the limits keeps them with less.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from cam_rig.arguments import checked, on_one_axis
from cam_rig.datasets.batches import InThisProcess
from cam_rig.dynamics import TwoMassParameters
from cam_rig.errors import ConfigError
from cam_rig.show.result import NULL_PROGRESS, Column, Progress, Records, Result
from cam_rig.show.tables import format_number
from cam_rig.studies.campaign.campaign import WAVE, WAVELENGTH, Campaign, keeps_limits
from cam_rig.studies.campaign.draws import drawn
from cam_rig.studies.campaign.inputs import LONGEST, SHORTEST, require_wavelength
from cam_rig.studies.campaign.results import order_interval
from cam_rig.studies.campaign.study import opened
from cam_rig.units import TURN, FloatArray
from cam_rig.workers import broken_named

#: The part of the draws that may lose the limits.
LOST = 0.01
#: Amplitudes reach to this part of the lift, and over so many decades; beside them there is 0.
OF_LIFT, DECADES = 0.1, 6.0
#: Amplitudes in all: each is found in 9 steps, to 3 %.
AMPLITUDES = 2**9 - 1
#: Probabilities between which wavelengths are taken where their distribution has no end.
ENDS = (0.01, 0.99)
#: Wavelengths nearer to each other than this part of themselves are one.
SAME = 1e-9
#: Wavelengths near the stem's resonance, over that at it.
NEAR = (0.95, 1.0, 1.05)
Outcome = Literal["found", "lost without waviness", "kept at the largest amplitude"]


@dataclass(frozen=True)
class LargestWaviness:
    """What one wavelength (rad) comes to.

    The amplitude (m) is the largest of those tried that 99 % keep the limits with; 0 where they do
    not keep them with any. An end of its interval is None where so few draws do not tell.
    """

    wavelength: float
    amplitude: float
    low: float | None
    high: float | None
    outcome: Outcome
    evaluations: int

    @property
    def waves(self) -> float:
        """Waves in a turn; a whole number where the wavelength divides it."""
        return TURN / self.wavelength


def resonances(campaign: Campaign) -> list[float]:
    """Wavelengths (rad) whose waves pass at the stem's natural frequency at each limit's speed.

    Of the base's rig; one for each speed. A jump speed's limit is a speed; other measures are at
    one. None of a rigid follower.
    """
    try:
        follower = TwoMassParameters.from_rig(campaign.rig)
    except ConfigError:
        return []
    stiffness = follower.stem_stiffness + follower.spring_stiffness
    pulse = math.sqrt(stiffness / follower.end_mass)
    speeds = {
        limit.term.high if limit.term.quantity.where else limit.value
        for limit in campaign.limits
        if not limit.term.quantity.rigid
    }
    found = sorted(TURN * speed / pulse for speed in speeds if speed is not None)
    return [one for one in found if SHORTEST <= one <= LONGEST]


@dataclass(eq=False)
class WavinessSearch:
    """A study with limits and a waviness; ``amplitudes`` rise from 0, evenly in logarithm."""

    campaign: Campaign

    def __post_init__(self) -> None:
        largest = OF_LIFT * float(np.ptp(self.campaign.law.ordinates))
        rising = np.geomspace(largest * 10.0**-DECADES, largest, AMPLITUDES - 1)
        self.amplitudes = np.append(0.0, rising)
        config = self.campaign.config
        if not self.campaign.limits:
            raise ConfigError("limits: has none; needed for the largest waviness: one at least")
        if WAVE not in config.vary:
            raise ConfigError(f"vary: has no {WAVE}; needed for the largest waviness")
        if config.plan.kind not in ("sobol", "latin_hypercube"):
            raise ConfigError(
                f"plan.kind: is {config.plan.kind}; allowed for the largest waviness: sobol, "
                "latin_hypercube"
            )
        for pair in config.correlated:
            if {WAVE, WAVELENGTH} & set(pair.inputs):
                raise ConfigError(
                    f"correlated: {list(pair.inputs)}; allowed for the largest waviness: inputs "
                    "other than its amplitude and wavelength"
                )

    def wavelengths(self, count: int) -> FloatArray:
        """So many (rad) over the range, every other divides the turn; and those at resonance."""
        one = self.campaign.inputs[self._column(WAVELENGTH)]
        ends = drawn(one, np.array(ENDS if one.endless else (0.0, 1.0)))
        low, high = np.clip(ends, SHORTEST, LONGEST).tolist()
        found = np.geomspace(low, high, count)
        whole = TURN / np.round(TURN / found[::2])
        found[::2] = np.where((whole >= low) & (whole <= high), whole, found[::2])
        near = np.outer(resonances(self.campaign), NEAR).ravel()
        found = np.sort(np.concatenate([found, near[(near >= low) & (near <= high)]]))
        return np.asarray(found[np.append(True, np.diff(found) > SAME * found[1:])])

    def at(self, wavelength: float) -> LargestWaviness:
        """The largest waviness of one wavelength (rad)."""
        campaign, amplitudes = self.campaign, self.amplitudes
        rows = campaign.draws.rows(0, campaign.total)
        rows[:, self._column(WAVELENGTH)] = wavelength
        tried = 0

        def keeps(draw: int, step: int) -> bool:
            nonlocal tried
            tried += 1
            row = rows[draw].copy()
            row[self._column(WAVE)] = amplitudes[step]
            return keeps_limits(campaign, row)

        rank = math.floor(LOST * campaign.total * (1.0 + 1e-12))
        low, high = order_interval(campaign.total, LOST)
        needed = min(campaign.total, max(rank, high) + 1)
        steps = least_steps(keeps, campaign.total, needed, amplitudes.size)

        def amplitude(place: int) -> float | None:
            if not 0 <= place < len(steps):
                return None
            return float(amplitudes[max(0, steps[place])])

        outcome: Outcome = "lost without waviness" if steps[rank] < 0 else "found"
        if steps[rank] == amplitudes.size - 1:
            outcome = "kept at the largest amplitude"
        ends = amplitude(low), amplitude(high)
        return LargestWaviness(wavelength, amplitude(rank) or 0.0, *ends, outcome, tried)

    def _column(self, path: str) -> int:
        return [one.path for one in self.campaign.inputs].index(path)


def least_steps(
    keeps: Callable[[int, int], bool], draws: int, needed: int, steps: int
) -> list[int]:
    """Of all draws the ``needed`` smallest of their last steps that keep the limits, rising.

    ``keeps(draw, step)`` is asked of steps 0 … ``steps − 1``; the last one is −1 where not even
    step 0 does. A draw that keeps them beyond the largest of those found so far is not one of
    them: it takes one question, and only the others a bisection.
    """
    found: list[int] = []
    for draw in range(draws):
        low, high = -1, steps
        if len(found) == needed:
            high = found[-1]
            if high < 0 or keeps(draw, high):
                continue
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if keeps(draw, middle) else (low, middle)
        found = sorted([*found, low])[:needed]
    return found


def find_largest(
    search: WavinessSearch,
    wavelengths: FloatArray,
    executor: Executor,
    progress: Progress = NULL_PROGRESS,
) -> WavinessResult:
    """The largest waviness of each wavelength (rad), in their order; the same on any executor."""
    progress.start(wavelengths.size, search.campaign.config.name)
    found = []
    with broken_named():
        for one in executor.map(search.at, wavelengths.tolist()):
            found.append(one)
            progress.advance()
    return WavinessResult(search, tuple(found))


#: Wavelengths of one search, at most; each takes seconds.
MOST = 100_000


@dataclass(frozen=True, eq=False, repr=False)
class WavinessResult(Result):
    """The largest waviness of each wavelength, SI: a `LargestWaviness` each in ``wavelengths``."""

    schema = "cam_rig.waviness.1"
    plot_function = "cam_rig.studies.campaign.figures:waviness_figure"
    columns: ClassVar = {
        "wavelengths": (
            Column("wavelength", "°", ".4g"),
            Column("waves", "1", ".5g", "waves a turn"),
            Column("amplitude", "µm", ".3g"),
            Column("low", "µm", ".3g", "from", missing="not told"),
            Column("high", "µm", ".3g", "to", missing="not told"),
            Column("outcome"),
            Column("evaluations", doc="points that were measured", hidden=True),
        ),
        "waviness": (
            Column("study", of="config.name"),
            Column("draws", of="total"),
            Column("seed"),
            Column("limits", of=lambda one: [limit.words for limit in one.limits]),
            Column("kept_by", of=lambda _: 1.0 - LOST),
            Column("resonance_wavelengths", "°", of=resonances),
        ),
    }

    search: WavinessSearch
    wavelengths: tuple[LargestWaviness, ...]

    def tables(self) -> list[Records]:
        """``wavelengths``, a row each, and ``waviness``: the study."""
        campaign = self.search.campaign
        limits = " and ".join(limit.words for limit in campaign.limits)
        near = " and ".join(
            f"{format_number(math.degrees(x), '.4g')}°" for x in resonances(campaign)
        )
        notes = (
            f"The same {campaign.total} draws for all; from and to are the interval of 95 % that "
            "so many draws give.",
            f"Waves of {near} meet the stem's resonance at the limit's speed." if near else "",
        )
        caption = f"Largest waviness with which 99 % keep: {limits}"
        return [
            self.table("wavelengths", caption, self.wavelengths, *notes),
            self.table("waviness", "Study", [campaign], single=True, hidden=True),
        ]


@checked
def largest_waviness(
    study: str | Path | Mapping[str, Any],
    wavelengths: int | Sequence[float] | FloatArray = 24,
    *,
    points: int | None = None,
    seed: int | None = None,
    executor: Executor | None = None,
) -> WavinessResult:
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
        asked = on_one_axis("wavelengths", wavelengths)
        for one in asked.tolist():
            require_wavelength(one)
    return find_largest(search, asked, executor or InThisProcess())
