"""The reference's closed form of one phase."""

import mpmath as mp
import pytest

from benchmark.speed.exact import DIGITS, exact_pieces, flow
from benchmark.speed.models import TwoMasses
from cam_rig.laws import Law


@pytest.mark.parametrize("spring_damping", [0.0, 89.37064464606817, 1e3])
def test_a_phase_begins_where_it_is_told_and_obeys_its_equation(spring_damping):
    """State at the start, and rate against a centred difference of 1e-20 s: to 30 digits.

    Flight of two masses has rates that come in pairs, that are real, and that are real but for
    the last digit: each counts as what it is.
    """
    law = Law(
        "one", [0.0, 2.0, 6.283185307179586], [[0.0, 0.01], [0.0, 0.01], [0.01, 0.0], [0.01, 0.0]]
    )
    model = TwoMasses(
        0.2668876, 0.0824588, 18605.758128384656, 1876.5254484237591, 0.0, spring_damping, 15.1
    )
    with mp.workdps(DIGITS):
        piece = exact_pieces(law, 100.0)[0]
        phases = model.typed(mp.mpf).phases()
        for name, start in (("contact", [4e-4, -0.1]), ("flight", [0.0, 4e-4, 0.0, -0.1])):
            phase, begin, step = phases[name], mp.mpf("0.001"), mp.mpf("1e-20")
            run = flow(phase, piece, begin, [mp.mpf(x) for x in start])
            state = run.state(begin)
            assert max(abs(a - b) for a, b in zip(state, start, strict=True)) < 1e-50
            motion, half = piece.motion(begin), len(start) // 2
            before, after = run.state(begin - step), run.state(begin + step)
            for i in range(half):
                pull = zip(phase.rows[i], state, strict=True)
                drive = zip(phase.drive[i], motion, strict=True)
                wanted = sum(a * b for a, b in pull) + sum(a * b for a, b in drive)
                rate = (after[half + i] - before[half + i]) / (2 * step)
                assert abs(rate - wanted) <= mp.mpf(10) ** -30 * (1 + abs(wanted))
