"""Computing time of contours with 36 000 points, and of the checks of all cams.

Usage: python -m benchmark.contour
"""

import time
from collections.abc import Callable
from functools import partial

from cam_rig.laws import build_law
from cam_rig.profile import contours
from cam_rig.profile.cam_checks import check_cam
from cam_rig.schema import load_cam
from cam_rig.schema.load import config_root

#: Number of contour points, at distances of 0.01°.
CONTOUR_POINTS = 36_000
#: Number of timed runs, of which the shortest counts.
REPEATS = 10


def best_of(repeats: int, work: Callable[[], object]) -> float:
    """Return the shortest wall time (s) of several repetitions."""
    times = []
    for _ in range(repeats):
        start_time = time.perf_counter()
        work()
        times.append(time.perf_counter() - start_time)
    return min(times)


def main() -> None:
    """Measure the checks and contours of all cams and print the times."""
    start_time = time.perf_counter()
    cams = [load_cam(path) for path in sorted((config_root() / "cams").glob("*.yaml"))]
    read = time.perf_counter() - start_time
    laws = [build_law(cam) for cam in cams]
    start_time = time.perf_counter()
    for cam, law in zip(cams, laws, strict=True):
        check_cam(cam, law)
    check_arguments = time.perf_counter() - start_time
    print(f"{len(cams)} cams read in {read:.3f} s, checked in {check_arguments:.3f} s")
    for cam, law in zip(cams, laws, strict=True):
        took = best_of(REPEATS, partial(contours, cam.follower, law, CONTOUR_POINTS))
        print(
            f"{cam.name:20} {cam.follower.type:20} {CONTOUR_POINTS} points in {took * 1e3:.1f} ms"
        )


if __name__ == "__main__":
    main()
