"""Recorded run: content, sound levels, and comparison with a new simulation."""

from pathlib import Path

import numpy as np

import cam_rig

BAG = Path(__file__).parents[1] / "bags" / "golden"
OUT = Path("out")
OUT.mkdir(exist_ok=True)

recording = cam_rig.read_bag(BAG)
print(
    f"{recording.loaded.scene.title}: {len(recording.ticks)} ticks, complete: {recording.complete}"
)
for topic, count in recording.counts.items():
    print(f"  {topic}: {count} messages")

# The bag contains its scene, cams and rig, so that the run can be simulated again.
computed = cam_rig.run_scene(recording.loaded)
for cam, curve in recording.noise.curves.items():
    away = np.abs(curve.level_db - computed.noise.curves[cam].level_db).max()
    levels = ", ".join(f"{level:.1f}" for level in curve.level_db)
    print(f"{cam}: {levels} dB; at most {away:.0e} dB from what is computed now")

# Samples of the follower: contact is lost where the contact force is zero.
samples = recording.samples("tm21", rpm=400)
lost = np.mean(samples.force == 0.0)
print(f"tm21 at 400 rpm: up to {samples.force.max():.0f} N, contact lost {lost:.0%} of the time")

recording.plot().savefig(OUT / "read_bag.png")
