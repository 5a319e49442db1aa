"""A rig of one's own: other masses and springs, by name, checked as a rig file is."""

from pathlib import Path

import matplotlib.pyplot as plt

import cam_rig

OUT = Path("out")
OUT.mkdir(exist_ok=True)

law = cam_rig.build_law(cam_rig.load_cam("cycloidal"))
paper = cam_rig.load_rig("paper_table2")  # a shipped name; a path of one's own file works as well
light = paper.with_follower(mass=0.8, preload=60.0)  # kg, N; all else stays

figure, axes = plt.subplots(figsize=(9.0, 4.4), layout="constrained")
for rig, name in ((paper, "the paper's"), (light, "lighter, more preload")):
    motion = cam_rig.simulate(law, rig, model="two_mass", rpm=400, turns=2)
    jump = cam_rig.jump_speed(law, rig)
    label = f"{name}: jump speed {jump.rpm:.0f} rpm"
    print(f"{label}, smallest force {motion.force.min():.1f} N at 400 rpm")
    axes.plot(motion.time, motion.force, label=label)

try:
    paper.with_follower(preload=-5.0)
except cam_rig.CamRigError as error:
    print(error)  # the key, its value, what is allowed

axes.set(xlabel="time [s]", ylabel="contact force [N]", title="Cycloidal cam at 400 rpm")
axes.margins(y=0.2)
axes.grid(alpha=0.3)
axes.legend(loc="upper right", ncols=2)
figure.savefig(OUT / "own_rig.png")
plt.close(figure)
