"""How the laws of a factorial study stand to each other, in words; empty where it cannot say."""

from __future__ import annotations

import math

import numpy as np

from cam_rig.laws.catalogue import figures
from cam_rig.studies.factorial.criteria import (
    BY_KEY,
    FOLLOWS,
    decided_by,
    falls_with_class,
    held,
    share_of_law,
)
from cam_rig.studies.factorial.design import Design, Factorial
from cam_rig.units import RPM_PER_RAD_S

JUMP = BY_KEY["jump"]


def order_of_jumps(found: Factorial) -> str:
    """The jump speeds of laws that accelerate alike, and whether the step to C2 is what counts."""
    design = found.same_acceleration
    lines = ", ".join(
        f"{rise} (C{order}) {speed:.0f}"
        for rise, order, speed in zip(design.rises, design.classes, _means(design), strict=True)
    )
    said = (
        "Jump speed, all laws accelerating alike (geometric mean over the angles, rpm): "
        f"{lines}; {share_of_law(design, JUMP)}."
    )
    smooth = design.from_class(2)
    if smooth is None or smooth.rises == design.rises:
        return said
    said += f" Among laws of C2 and above {share_of_law(smooth, JUMP)}."
    rough, even = design.analysis(JUMP).rows, smooth.analysis(JUMP).rows
    per_law = rough / len(design.rises), even / len(smooth.rises)
    if per_law[1] < 0.5 * per_law[0] and min(_means(smooth)) > _rough(design):
        said += (
            " So it is the step to C2 that counts: below it the acceleration jumps, and sets the "
            "stem ringing."
        )
    return said


def _rough(design: Design) -> float:
    """The highest mean jump speed of a law below C2."""
    return max(v for v, k in zip(_means(design), design.classes, strict=True) if k < 2)


def _means(design: Design) -> list[float]:
    """Jump speed of each law, geometric mean over the angles, rpm."""
    means = np.exp(np.log(JUMP.values(design.cells)).mean(axis=1))
    return [float(mean) for mean in means]


def loudness(found: Factorial) -> str:
    """Noise of the rigid follower and of the elastic one."""
    same, gentle, noise = found.same_angles, found.same_acceleration, BY_KEY["noise"]
    spread = float(np.ptp(gentle.analysis(noise).row_effects))
    loudest = same.rises[int(np.argmax(same.analysis(noise).row_effects))]
    sharpest = max(same.rises, key=lambda rise: figures(rise).peak_acceleration)
    also = ", and it is the sharpest" if loudest == sharpest else ""
    contact, speed = BY_KEY["noise_in_contact"], found.config.noise_in_contact.numbers[0]
    return (
        f"Noise of the rigid follower {FOLLOWS[decided_by(gentle, noise)]}: with equal "
        f"acceleration {share_of_law(gentle, noise)}, and the laws differ by {spread:.2f} dB; with "
        f"equal angles {loudest} is the loudest{also}. It cannot ring; the elastic follower can: "
        f"at {speed:g} rpm, with equal acceleration, {share_of_law(gentle, contact)}."
        f"{held(gentle, contact, found.config)}"
        " A structure that damps high notes stands between stem and microphone: near the stem more "
        "of the ringing would be heard."
    )


def price(found: Factorial) -> str:
    """What smooth laws with the same angles pay for their continuity; empty for fewer than two."""
    design = found.same_angles.from_class(2)
    if design is None:
        return ""
    means = _means(design)
    best, worst = int(np.argmax(means)), int(np.argmin(means))
    said = (
        f"With equal angles, among laws of C2 and above, {design.rises[worst]} "
        f"(C{design.classes[worst]}) is left first, at {means[worst]:.0f} rpm on average, "
        f"{design.rises[best]} (C{design.classes[best]}) last, at {means[best]:.0f}."
    )
    if falls_with_class(design, JUMP):
        said += (
            " Each class is left earlier than the one below it: continuity has its price in "
            "slopes. That is the paper's own remark that polynomials of higher degree vibrate less "
            "but jump sooner."
        )
    return said


def squeezed_words(found: Factorial) -> str:
    """The proposed cam in less and less of the turn."""
    spans = sorted(found.squeezed, reverse=True)
    speeds = [found.squeezed[span].jump * RPM_PER_RAD_S for span in spans]
    told = ", ".join(
        f"{math.degrees(span):.4g}° {v:.0f} rpm" for span, v in zip(spans, speeds, strict=True)
    )
    own, proposed = found.cams[found.config.proposed].jump * RPM_PER_RAD_S, found.config.proposed
    others = [m.jump * RPM_PER_RAD_S for cam, m in found.cams.items() if cam != proposed]
    said = f"{proposed}, left at {own:.0f} rpm, squeezed with a low dwell for the rest: {told}."
    if others:
        said += f" The other cams are left between {min(others):.0f} and {max(others):.0f} rpm."
        below = sum(v < max(others) for v in speeds)
        if below:
            said += (
                f" In {below} of {len(speeds)} spans it has lost its lead over the best of them."
            )
    return said
