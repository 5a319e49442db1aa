"""Residual vibration in the dwell for several laws, and the follower's resonance."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import cam_rig

OUT = Path("out")
OUT.mkdir(exist_ok=True)

rig = cam_rig.load_rig("tm21").replace(stem_stiffness="400 N/mm")  # soft, to see it vibrate
rpm = np.arange(150.0, 351.0, 10.0)
result = cam_rig.vibration(["modified_trapezoid", "cycloidal", "poly345", "poly4567"], rig, rpm)
table = result.to_pandas()

figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 4.4), layout="constrained")
for cam, rows in table.groupby("cam", sort=False):
    left.semilogy(rows.rpm, 1e6 * rows.residual_amplitude, "o-", ms=3, label=cam)
    print(f"{cam}: {1e6 * rows.residual_amplitude.iloc[-1]:.3g} µm at {rows.rpm.iloc[-1]:g} rpm")
left.set(xlabel="cam speed [rpm]", ylabel="residual amplitude [µm]")
left.legend()

w = 2.0 * np.pi * np.geomspace(1.0, 1e3, 2000)  # rad/s
response = rig.frequency_response(w)
right.loglog(w / (2.0 * np.pi), np.abs(response[0]))  # lift of the follower / lift of the law
frequency = w[np.abs(response[0]).argmax()] / (2.0 * np.pi)
print(f"the follower on its stem: {frequency:.1f} Hz")
right.set(xlabel="frequency [Hz]", ylabel="displacement of the follower / lift")
for axes in (left, right):
    axes.grid(alpha=0.3)
figure.savefig(OUT / "vibration.png")
plt.close(figure)
