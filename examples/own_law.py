"""User-defined motion law, from a cam file and from numbers, and its follower."""

from pathlib import Path

import numpy as np

import cam_rig

FOLDER = Path(__file__).parent
OUT = Path("out")
OUT.mkdir(exist_ok=True)

# From a file: segments around the turn, each with a named law or with numbers.
cam = cam_rig.load_cam(FOLDER / "own_cam.yaml")
from_file = cam_rig.build_law(cam)
failed = [check.name for check in cam_rig.contour(cam).checks if not check.passed]
print(f"{cam.title}: lift {from_file.lift * 1e3:g} mm; checks that fail: {failed or 'none'}")

# From numbers: pieces in Bernstein form, with a column of ordinates (m) each. The first three are
# equal, as are the last three, so that velocity and acceleration are zero at both ends of rise and
# fall.
h = 0.02
rise = np.array([0.0, 0.0, 0.0, h, h, h])
pieces = np.stack([rise, np.full(6, h), h - rise, np.zeros(6)], axis=1)
breaks = np.radians([0.0, 120.0, 180.0, 300.0, 360.0])
breaks[-1] = 2.0 * np.pi  # exactly a turn, because the law is periodic
from_numbers = cam_rig.Law("own_law", breaks, pieces)

rig = cam_rig.load_rig("paper_table2")
for law in (from_file, from_numbers):
    angle = np.linspace(0.0, 2.0 * np.pi, 3601)
    motion = cam_rig.simulate(law, rig, model="two_mass", rpm=520, turns=3)
    left = sum(event.kind == "lift-off" for event in motion.events)
    print(
        f"{law.name}: peak s'' {np.abs(law(angle, 2)).max() * 1e3:.1f} mm/rad², "
        f"largest force {motion.force.max():.0f} N, {left} lift-offs at 520 rpm"
    )
    motion.plot().savefig(OUT / f"{law.name}.png")
