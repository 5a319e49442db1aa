"""Fit of a cam to readings of a dial gauge, which are simulated with noise."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import cam_rig

OUT = Path("out")
OUT.mkdir(exist_ok=True)

true = cam_rig.build_law(cam_rig.load_cam("poly345"))
degrees = np.arange(0.0, 360.0, 2.5)
noise = np.random.default_rng(1).normal(0.0, 3e-6, degrees.size)  # m, noise of a dial gauge
readings = 1e3 * (true(np.radians(degrees)) + noise)
head = "angle [deg],lift [mm]"
np.savetxt(
    OUT / "lifts.csv", np.column_stack([degrees, readings]), delimiter=",", header=head, comments=""
)

fit = cam_rig.fit_cam(OUT / "lifts.csv")
print(*fit.summary(), sep="\n")
figure = fit.plot()
figure.savefig(OUT / "fit_cam.png")
plt.close(figure)

angle = np.linspace(0.0, 2.0 * np.pi, 3601)
away = np.abs(fit.law(angle) - true(angle)).max()
print(f"scatter {fit.scatter * 1e6:.1f} µm, farthest from the truth {away * 1e6:.1f} µm")
assert away < 10e-6
