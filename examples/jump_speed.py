"""Map of the jump speed against return spring and preload.

The jump speed is the lowest cam speed at which the follower loses contact.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import cam_rig

OUT = Path("out")
OUT.mkdir(exist_ok=True)

law = cam_rig.build_law(cam_rig.load_cam("poly345"))
rig = cam_rig.load_rig("paper_table2")
springs = np.linspace(2000.0, 6000.0, 5)  # N/m
preloads = np.linspace(15.0, 60.0, 4)  # N

rpm = np.array(
    [
        [
            cam_rig.jump_speed(law, rig.with_follower(spring_stiffness=k, preload=f)).rpm
            for k in springs
        ]
        for f in preloads
    ]
)
for preload, row in zip(preloads, rpm, strict=True):
    print(f"preload {preload:4.0f} N:", " ".join(f"{speed:5.0f}" for speed in row), "rpm")

figure, axes = plt.subplots(figsize=(7.0, 4.8), layout="constrained")
axes.pcolormesh(springs / 1e3, preloads, rpm, cmap="Blues", vmin=250.0, vmax=650.0)
for i, preload in enumerate(preloads):
    for j, spring in enumerate(springs):
        axes.text(spring / 1e3, preload, f"{rpm[i, j]:.0f}", ha="center", va="center")
axes.set(xlabel="return spring [N/mm]", ylabel="preload [N]")
axes.set_title(f"Jump speed of {law.name}, rpm: it steps where a free vibration decides")
figure.savefig(OUT / "jump_speed.png")
plt.close(figure)
