"""Which cells of a factorial design lose contact at the speeds of an effect.

Eq. 5 holds the follower on the cam at any speed, and a level "in contact" means what it says. A
cell whose jump speed lies below the fastest speed it was measured at is out of their reach there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cam_rig.schema import FactorialConfig
from cam_rig.studies.factorial.design import Design, Effect

#: A table of fewer laws or angles has no variance to analyse.
LEAST = 2


def fastest(effect: Effect, config: FactorialConfig) -> float | None:
    """The fastest speed (rad/s) at which an effect supposes contact; None where it does not."""
    if not effect.speeds:
        return None
    return float(max(np.atleast_1d(getattr(config, effect.speeds).si_list)))


def contact_lost(design: Design, effect: Effect, config: FactorialConfig) -> NDArray[np.bool_]:
    """Which cells leave the cam below the effect's fastest speed, ``(a, b)``."""
    speed = fastest(effect, config)
    jumps = np.array([[m.jump for m in row] for row in design.cells])
    return np.zeros(jumps.shape, bool) if speed is None else np.asarray(jumps < speed)


def staying(design: Design, effect: Effect, config: FactorialConfig) -> Design | None:
    """The laws and angles whose cells all keep contact; None where too few remain.

    Laws and angles are dropped one after the other, those first that most of their cells leave.
    """
    lost = contact_lost(design, effect, config)
    rows, columns = (list(range(n)) for n in lost.shape)
    while (part := lost[np.ix_(rows, columns)]).any():
        by_row, by_column = part.mean(axis=1), part.mean(axis=0)
        if by_row.max() >= by_column.max():
            del rows[int(np.argmax(by_row))]
        else:
            del columns[int(np.argmax(by_column))]
    if min(len(rows), len(columns)) < LEAST:
        return None
    return replace(
        design,
        name=f"{design.name}, in contact",
        rises=tuple(design.rises[i] for i in rows),
        angles=design.angles[columns],
        cells=[[design.cells[i][j] for j in columns] for i in rows],
    )


def laws_left(design: Design, effect: Effect, config: FactorialConfig) -> dict[str, int]:
    """How many cells of each law leave, of the laws that have such."""
    counts = contact_lost(design, effect, config).sum(axis=1).tolist()
    return {rise: n for rise, n in zip(design.rises, counts, strict=True) if n}
