"""Sound levels of two cams against speed, and their difference."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import cam_rig

OUT = Path("out")
OUT.mkdir(exist_ok=True)

rig = cam_rig.load_rig("tm21")
rpm = np.arange(200.0, 401.0, 20.0)
figure, axes = plt.subplots(figsize=(8.0, 4.4), layout="constrained")
for name in ("poly345", "bezier15"):
    law = cam_rig.build_law(cam_rig.load_cam(name))
    heard = [
        cam_rig.sound_level(cam_rig.simulate(law, rig, rpm=speed, turns=4, sample_rate=12_000))
        for speed in rpm
    ]
    print(f"{name}: {heard[-1]}")
    axes.plot(rpm, [each.level_db for each in heard], "o-", label=name)
axes.set(xlabel="cam speed [rpm]", ylabel="sound pressure level [dB re 20 µPa]")
axes.grid(alpha=0.3)
axes.legend()
figure.savefig(OUT / "sound.png")
plt.close(figure)
