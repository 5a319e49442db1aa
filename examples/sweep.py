"""Speed sweep of a cam without a file: lift-offs, forces and sound levels."""

from pathlib import Path

import matplotlib.pyplot as plt

import cam_rig

OUT = Path("out")
OUT.mkdir(exist_ok=True)

cam = cam_rig.Cam(
    "lug",
    lift="12 mm",
    segments=[
        {"law": "poly4567", "span": "100 deg", "to": 1.0},
        {"law": "dwell", "span": "40 deg"},
        {"law": "cycloidal", "span": "100 deg", "to": 0.0},
        {"law": "dwell", "span": "120 deg"},
    ],
    follower={"type": "roller", "base_radius": "40 mm", "roller_radius": "12 mm"},
)
run = cam_rig.sweep(cam, "tm21", rpm=range(200, 651, 50), sample_rate=12_000)
table = run.to_pandas()
print(table[["rpm", "level", "peak_force", "lift_offs"]].round(2).to_string(index=False))
lost = table.rpm[table.lift_offs > 0.0].min()
print(f"contact is lost from {lost:g} rpm on")

figure, (upper, lower) = plt.subplots(2, 1, figsize=(8.0, 6.0), sharex=True, layout="constrained")
upper.plot(table.rpm, table.level, "o-")
upper.set_ylabel("level [dB re 20 µPa], relative")
lower.plot(table.rpm, table.peak_force, "o-", label="peak")
lower.plot(table.rpm, table.min_force, "o-", label="least")
lower.set(xlabel="cam speed [rpm]", ylabel="contact force [N]")
lower.legend()
for axes in (upper, lower):
    axes.grid(alpha=0.3)
figure.savefig(OUT / "sweep.png")
plt.close(figure)
