"""Error of order spectra against FFTs and 50 digits, for docs/accuracy.md.

An order is a multiple of the cam speed.

    OMP_NUM_THREADS=1 .venv/bin/python -m benchmark.orders
"""

from __future__ import annotations

import dataclasses
from itertools import pairwise
from pathlib import Path

import mpmath
import numpy as np

import cam_rig
from cam_rig.acoustics import level_db
from cam_rig.simulation.simulate import simulate, step_levels
from cam_rig.studies.orders.spectrum import force_orders, spectrum
from cam_rig.studies.orders.steady_force import ForcePiece, SteadyForce, steady_force
from cam_rig.units import RPM, to_rpm

PAGE = Path("docs/accuracy.md")
#: First line of the written section.
HEADING = "## Orders\n"
#: Last line of the section.
LAST_LINE = "Made by `benchmark/orders.py`.\n"
ORDERS = 100
COUNTS = (10**5, 10**6)
#: Cases: cam, rig, model, rpm, description.
CASES = (
    ("bezier15", "tm21", "one_mass", 400, "smooth"),
    ("poly345", "tm21", "one_mass", 400, "steps of jerk"),
    ("poly345", "paper_table2", "elastic_stem", 400, "vibration of the stem"),
    ("tm21", "tm21", "kinetostatic", 300, "steps of force"),
    ("tm21", "tm21", "one_mass", 400, "a flight a turn"),
    ("poly345", "paper_table2", "two_mass", 480, "stem and flights"),
)
TEXT = """{heading}
`cam-rig orders` integrates the steady force in closed form. The table gives the largest difference
over orders 0 to {n}, relative to the largest order, from an FFT of samples of the same force, and
from the integrals computed with 50 digits:

| cam, model, rpm | force | FFT of 10⁵ | FFT of 10⁶ | 50 digits |
|---|---|---:|---:|---:|
{rows}

The difference from the FFT decreases with the number of samples. It is therefore an error of the
FFT: orders above half its number of points are aliased, and a step is located to one sample only.
Landings are left out of this table.

The sum of the orders of `tm21_sweep` up to 40 kHz and of the background gives its levels to
{kept:.2f} dB if contact is kept. If the follower jumps, the levels differ by {low:+.2f} to
{high:+.2f} dB, because the sum of energies treats the pulse of a landing and the step of the force
at the same instant as independent.

"""


def by_digits(steady: SteadyForce, rates: np.ndarray) -> np.ndarray:
    """Return the orders of the same pieces, computed with at least 50 digits."""
    with mpmath.workdps(90):
        amplitudes = []
        for rate in rates:
            total = mpmath.mpc(0)
            for piece in steady.pieces:
                w = mpmath.mpc(0, float(rate))
                part = _polynomial(piece, w) + _vibration(piece, w)
                total += mpmath.exp(-w * mpmath.mpf(piece.begin)) * part
            amplitudes.append(complex(total / mpmath.mpf(steady.duration)))
    return np.array(amplitudes)


def _polynomial(piece: ForcePiece, w: mpmath.mpc) -> mpmath.mpc:
    """Return the integral of a polynomial piece times e^(−wt), by partial integration.

    The derivatives at both ends are computed from differences of the ordinates.
    """
    length, ordinates = mpmath.mpf(piece.length), [mpmath.mpf(float(x)) for x in piece.ordinates]
    if w == 0:
        return length * mpmath.fsum(ordinates) / len(ordinates)
    total, end = mpmath.mpc(0), mpmath.exp(-w * length)
    for k in range(len(ordinates)):
        total += (ordinates[0] - ordinates[-1] * end) / w ** (k + 1)
        degree = len(ordinates) - 1
        ordinates = [degree * (b - a) / length for a, b in pairwise(ordinates)]
    return total


def _vibration(piece: ForcePiece, w: mpmath.mpc) -> mpmath.mpc:
    if piece.free is None:
        return mpmath.mpc(0)
    length, free = mpmath.mpf(piece.length), piece.free
    matrix, start = (mpmath.matrix(x.tolist()) for x in (free.matrix, free.start))
    shifted = matrix - w * mpmath.eye(2)
    change = mpmath.expm(shifted * length) * start - start
    return (mpmath.matrix(free.row.tolist()).T * mpmath.lu_solve(shifted, change))[0]


def row(cam: str, rig: str, model: str, rpm: float, what: str) -> str:
    """Return a line of the table."""
    law = cam_rig.build_law(cam_rig.load_cam(cam))
    steady = steady_force(law, model, cam_rig.load_rig(rig), rpm * RPM)
    steady = dataclasses.replace(steady, landings=())
    assert steady.settled
    rates = np.arange(ORDERS * steady.turns + 1) * steady.speed / steady.turns
    exact = force_orders(steady, rates, 1e-4)
    others = [np.fft.fft(samples(steady, n))[: rates.size] / n for n in COUNTS]
    others.append(by_digits(steady, rates))
    peak = np.abs(exact).max()
    away = [f"{np.abs(other - exact).max() / peak:.1e}" for other in others]
    return " | ".join([f"| {cam}, `{model}`, {rpm:g}", what, *away]) + " |"


def samples(steady: SteadyForce, count: int) -> np.ndarray:
    """Return the force at evenly spaced times of all its turns."""
    return steady.at(np.arange(float(count)) * (steady.duration / count))


def level_differences() -> tuple[list[float], list[float]]:
    """Return the differences (dB) of summed orders and levels of the sweep.

    The first list is for speeds with contact, the second for speeds with loss of contact.
    """
    loaded = cam_rig.load_scene("tm21_sweep")
    in_contact, with_losses = list[float](), list[float]()
    for cam, steps in step_levels(
        simulate(loaded), loaded.scene.schedule.transient_turns.si
    ).items():
        for speed, level in steps.items():
            steady = steady_force(loaded.laws[cam], loaded.scene.model, loaded.rig, speed)
            highest = round(40_000.0 * 60.0 / to_rpm(speed)) if steady.landings else 2000
            sound = loaded.radiation
            orders = spectrum(steady, sound, sound.contact_time, highest)
            powers = [10.0 ** (x / 10.0) for x in (orders.total_db, orders.background_db)]
            total = float(level_db(20e-6 * sum(powers) ** 0.5))
            (with_losses if steady.landings else in_contact).append(total - level)
    return in_contact, with_losses


def main() -> None:
    """Compute all differences, and write the section."""
    rows = []
    for case in CASES:
        rows.append(row(*case))
        print(rows[-1])
    in_contact, with_losses = level_differences()
    facts = {"heading": HEADING, "n": ORDERS, "rows": "\n".join(rows)}
    facts |= {"kept": max(map(abs, in_contact)), "low": min(with_losses), "high": max(with_losses)}
    print(facts)
    text = PAGE.read_text(encoding="utf-8")
    before, _, remainder = text.partition(HEADING)
    after = remainder.partition(LAST_LINE)[2]
    page = f"{before.rstrip()}\n\n{TEXT.format(**facts)}{LAST_LINE}{after}"
    PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
