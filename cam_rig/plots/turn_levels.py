"""The sound level turn by turn, which shows when it has settled."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from cam_rig.arrays import FloatArray
from cam_rig.plots.styles import colour

#: Room above and below, dB: a level that has settled is not shown with its rounding.
MARGIN_DB = 1.0


def figure(by_turn: FloatArray, settle_turns: int, level: float, title: str) -> Figure:
    """Levels (dB) of turns ``(n,)``, and their energy mean ``level`` after ``settle_turns``."""
    out = Figure(figsize=(8.0, 4.0), layout="constrained")
    axes = out.subplots()
    turn = np.arange(1, by_turn.size + 1)
    axes.plot(turn, by_turn, "o", color=colour(0), label="one turn")
    settled = np.array([settle_turns + 0.5, by_turn.size + 0.5])
    axes.plot(settled, [level, level], color=colour(1), label=f"settled turns: {level:.2f} dB")
    axes.set(xlabel="turn", ylabel="sound level [dB]", title=title)
    axes.set_xticks(turn[:: 1 + turn.size // 20])
    axes.set_ylim(by_turn.min() - MARGIN_DB, by_turn.max() + MARGIN_DB)
    axes.grid(alpha=0.3)
    axes.legend()
    return out
