"""User-defined rig from numbers and texts with units, compared with a shipped rig."""

from pathlib import Path

import matplotlib.pyplot as plt

import cam_rig

OUT = Path("out")
OUT.mkdir(exist_ok=True)

law = cam_rig.build_law(cam_rig.load_cam("cycloidal"))
paper = cam_rig.load_rig("paper_table2")  # a shipped rig by name, or the path of a file
light = paper.replace(name="light", mass="800 g", preload=60.0)  # plain numbers are SI: N
bench = cam_rig.Rig(
    "bench", mass=1.1, spring="3.2 N/mm", preload=50.0, damping=8.0, restitution=0.2
)
print(bench)

figure, axes = plt.subplots(figsize=(9.0, 4.4), layout="constrained")
for rig, model in ((paper, "two_mass"), (light, "two_mass"), (bench, "one_mass")):
    motion = cam_rig.simulate(law, rig, model=model, rpm=400, turns=2)
    jump = cam_rig.jump_speed(law, rig)
    label = f"{rig.name}: jump speed {jump.rpm:.0f} rpm"
    print(f"{label}, smallest force {motion.force.min():.1f} N at 400 rpm")
    axes.plot(motion.time, motion.force, label=label)

try:
    paper.replace(preload=-5.0)
except ValueError as error:  # it is also a cam_rig.CamRigError
    print(error)  # the parameter, its value and the limits

bench.save(OUT / "bench.yaml", overwrite=True)
assert cam_rig.load_rig(OUT / "bench.yaml") == bench

axes.set(xlabel="time [s]", ylabel="contact force [N]", title="Cycloidal cam at 400 rpm")
axes.margins(y=0.2)
axes.grid(alpha=0.3)
axes.legend(loc="upper right", ncols=3)
figure.savefig(OUT / "own_rig.png")
plt.close(figure)
