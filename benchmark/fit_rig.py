"""Coverage of the 95 % intervals of ``cam-rig fit rig`` over simulated machines.

    python -m benchmark.fit_rig --trials 200 --model one_mass

Each trial has a random rig, cam, set of five speeds and noise: force 1 %, lift 10 µm, an encoder of
1024 counts with an offset of 3°, and a sensors' clock that is 200 ppm fast.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict

import numpy as np

import cam_rig
from benchmark.simulated_instruments import InstrumentErrors, measured_run
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.schema import RigConfig
from cam_rig.studies.fit_rig.estimate import NORMAL_95
from cam_rig.studies.fit_rig.run.fit import fit_run
from cam_rig.studies.fit_rig.run.result import RigFit
from cam_rig.units import to_rpm

#: Cams with and without a dwell, smooth or with steps of acceleration.
CAMS = ("poly345", "cycloidal", "bezier15", "poly4567", "arcs_convex")
#: Speeds relative to the jump speed of the rigid follower.
PARTS = (0.35, 0.55, 0.75, 0.95, 1.08)
#: Largest random change of a relative speed.
SCATTER = 0.03


def trial(
    seed: int, model: str, cams: tuple[str, ...], is_free: bool
) -> tuple[RigConfig, RigFit, float]:
    """Return a random rig, the fit of its simulated run, and the time of the fit (s).

    Parameters
    ----------
    is_free : True if the fit selects the model
    """
    random = np.random.default_rng(seed)
    law = cam_rig.build_law(cam_rig.load_cam(cams[seed % len(cams)]))
    rig = cam_rig.load_rig("tm21" if model == "one_mass" else "paper_table2")
    follower = rig.follower
    numbers = {
        name: getattr(follower, name).si * float(random.uniform(0.6, 1.6))
        for name in ("mass", "spring_stiffness", "preload", "damping")
    }
    if model == "one_mass":
        numbers["restitution"] = float(random.uniform(0.1, 0.6))
    else:
        stem = rig.need("stem_stiffness", "the fit of a stem").si
        share = float(random.uniform(0.25, 0.6))
        numbers |= {"stem_stiffness": stem * float(random.uniform(0.5, 2.0)), "roller_share": share}
        numbers["stem_damping"] = float(random.uniform(5.0, 30.0))
    rig = rig.with_follower(**numbers)
    jump = to_rpm(rigid_jump_speed(law, FollowerParameters.from_rig(rig)))
    parts = np.array(PARTS) + random.uniform(-SCATTER, SCATTER, len(PARTS))
    errors = InstrumentErrors(in_proportion=seed % 2 == 1)
    run = measured_run(law, rig, model, (parts * jump).tolist(), errors, seed)
    begin = time.perf_counter()
    model_name = None if is_free or model == "one_mass" else model
    fit = fit_run(law, run, cam_rig.load_rig("tm21"), model_name)
    return rig, fit, time.perf_counter() - begin


def main() -> None:
    """Print the number of estimates and the coverage of intervals by parameter."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--model", choices=("one_mass", "two_mass"), default="one_mass")
    parser.add_argument("--cams", default=",".join(CAMS), help="names with commas")
    parser.add_argument("--free-model", action="store_true", help="let the fit select the model")
    arguments = parser.parse_args()
    scores, seconds, models = defaultdict[str, list[float]](list), [], defaultdict[str, int](int)
    for seed in range(arguments.first, arguments.first + arguments.trials):
        rig, fit, took = trial(
            seed, arguments.model, tuple(arguments.cams.split(",")), arguments.free_model
        )
        seconds.append(took)
        models[fit.model] += 1
        for number in fit.identified:
            assert number.value is not None
            assert number.error is not None
            truth = getattr(rig.follower, number.name).si
            score = (number.value - truth) / number.error
            scores[number.name].append(score)
            if abs(score) > 4.0:
                print(f"seed {seed}: {number.name} {score:.1f} standard errors off", flush=True)
    print("number            told  within 95 %  mean score  its scatter")
    for name, found_scores in scores.items():
        z = np.array(found_scores)
        within = 100.0 * np.mean(np.abs(z) < NORMAL_95)
        print(f"{name:16} {z.size:5d} {within:10.1f} % {z.mean():11.2f} {z.std():12.2f}")
    every = np.abs(np.concatenate([np.array(z) for z in scores.values()]))
    print(f"all              {every.size:5d} {100.0 * np.mean(every < NORMAL_95):10.1f} %")
    print(f"models {dict(models)}; {np.median(seconds):.1f} s a fit, {max(seconds):.1f} s at most")


if __name__ == "__main__":
    main()
