"""The open question answered in words, every number taken from the study."""

from __future__ import annotations

import math

import numpy as np

from cam_rig.experiment.advantage import advantages
from cam_rig.experiment.factorial import EFFECTS, Design, Effect, Factorial

BY_KEY = {effect.key: effect for effect in EFFECTS}
#: A share of at least this much decides an effect.
DECIDES = 0.6
RPM = 30.0 / math.pi


def answer(found: Factorial) -> list[str]:
    """Sentences, the verdict first."""
    return [
        _verdict(found),
        _jump(found),
        _noise(found),
        _residual(found),
        _price(found),
        _squeezed(found),
    ]


def decided_by(design: Design, effect: Effect) -> str:
    """What explains most of an effect: continuity (the law), slopes (the angle), or both."""
    law, angle, _ = design.analysis(effect).shares
    if law >= DECIDES:
        return "continuity"
    return "slopes" if angle >= DECIDES else "both"


def _smooth(found: Factorial) -> Design:
    """Laws as smooth as those the paper compares, all at the same acceleration."""
    return found.same_acceleration.from_class(2)


def _verdict(found: Factorial) -> str:
    rows = advantages(found)
    jump = [row.jump_share for row in rows]
    acceleration = [row.acceleration_share for row in rows]
    slopes = float(np.mean(jump))
    which = "Mostly the gentler slopes" if slopes > 0.5 else "Mostly the continuity"
    return (
        f"{which}. Of {found.config.proposed}'s higher jump speed {_percent(min(jump))} to "
        f"{_percent(max(jump))}, and of its lower acceleration {_percent(min(acceleration))} to "
        f"{_percent(max(acceleration))}, are there in a follower that cannot ring, and so owed to "
        "the slopes; the rest is ringing, and so owed to continuity. Residual vibration is another "
        "matter: there continuity decides."
    )


def _jump(found: Factorial) -> str:
    all_laws, smooth = found.same_acceleration, _smooth(found)
    effect = BY_KEY["jump"]
    law, angle, _ = all_laws.analysis(effect).shares
    smooth_law, smooth_angle, _ = smooth.analysis(effect).shares
    table = effect.values(all_laws.cells)
    mean = np.exp(np.log(table).mean(axis=1))
    lines = ", ".join(
        f"{rise} (C{order}) {speed:.0f}"
        for rise, order, speed in zip(all_laws.rises, all_laws.classes, mean, strict=True)
    )
    return (
        "Jump speed, all laws accelerating alike (geometric mean over the angles, rpm): "
        f"{lines}. The law explains {_percent(law)} of the variance and the slopes "
        f"{_percent(angle)}; but that is the first step: among laws of C2 and above it is "
        f"{_percent(smooth_law)} against {_percent(smooth_angle)}. What is lost below C2 is lost "
        "to the jump of acceleration that sets the stem ringing."
    )


def _noise(found: Factorial) -> str:
    same, gentle = found.same_angles, found.same_acceleration
    noise, contact = BY_KEY["noise"], BY_KEY["noise_in_contact"]
    spread = float(np.ptp(gentle.analysis(noise).row_effects))
    heard = float(np.ptp(_smooth(found).analysis(contact).row_effects))
    _, angle, _ = gentle.analysis(noise).shares
    loudest = same.rises[int(np.argmax(same.analysis(noise).row_effects))]
    return (
        f"Noise follows the slopes: with equal acceleration they explain {_percent(angle)} of it, "
        f"and the laws differ by {spread:.2f} dB; with equal angles {loudest} is the loudest, for "
        f"it is the sharpest. The stem's ringing adds {heard:.2f} dB between laws of C2 and above "
        f"at {found.config.noise_in_contact.numbers[0]:g} rpm. The noise model hears little above "
        "some tens of Hz, as it was identified from the published curves; a microphone near the "
        "stem would hear more of continuity."
    )


def _residual(found: Factorial) -> str:
    effect = BY_KEY["residual"]
    same, gentle = (d.analysis(effect).shares for d in (found.same_angles, found.same_acceleration))
    analysis = found.same_acceleration.analysis(effect)
    factor = 10.0 ** (float(np.ptp(analysis.row_effects)) / 20.0)
    return (
        f"Residual vibration follows continuity: {_percent(same[0])} of its variance with equal "
        f"angles, {_percent(gentle[0])} with equal acceleration, and a factor of {factor:.0f} from "
        f"C{min(found.same_angles.classes)} to C{max(found.same_angles.classes)}. Only joints ring "
        "a stem, and the smoother the joint the less."
    )


def _price(found: Factorial) -> str:
    design = found.same_angles.from_class(2)
    effect = BY_KEY["jump"]
    rows = np.exp(np.log(effect.values(design.cells)).mean(axis=1))
    best, worst = int(np.argmax(rows)), int(np.argmin(rows))
    return (
        f"With equal angles continuity has its price in slopes: among laws of C2 and above "
        f"{design.rises[worst]} (C{design.classes[worst]}) is left first, at {rows[worst]:.0f} rpm "
        f"on average, {design.rises[best]} (C{design.classes[best]}) last, at {rows[best]:.0f}. "
        "That is the paper's own remark that polynomials of higher degree vibrate less but jump "
        "sooner."
    )


def _squeezed(found: Factorial) -> str:
    spans = sorted(found.squeezed, reverse=True)
    told = ", ".join(
        f"{math.degrees(span):.4g}° {found.squeezed[span].jump * RPM:.0f} rpm" for span in spans
    )
    others = [m.jump * RPM for cam, m in found.cams.items() if cam != found.config.proposed]
    return (
        f"Squeezed, with a low dwell for the rest, {found.config.proposed} loses what it had: "
        f"{told}. "
        f"The other cams are left between {min(others):.0f} and {max(others):.0f} rpm."
    )


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"
