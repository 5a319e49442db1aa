"""The model of a scene, driven along a steady stretch of a real cam's motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cam_rig.acoustics import level_db
from cam_rig.arrays import FloatArray
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.simulation.simulate import FollowerSimulator, MicrophoneSimulator
from cam_rig.studies.real_run.cam_motion import SteadyStretch
from cam_rig.units import NS, TURN


@dataclass(frozen=True, eq=False)
class ModelRun:
    """The follower's samples, rows as in `COLUMNS`, from where it is put down on its cam.

    Parameters
    ----------
    begin : s, from here on it is settled
    sound : ``(3, n)``, for each tick its end (s), mean square pressure (Pa²), samples
    """

    stretch: SteadyStretch
    begin: float
    rows: FloatArray
    sound: FloatArray

    @property
    def settled(self) -> FloatArray:
        """The settled samples."""
        return self.rows[:, self.rows[0] >= self.begin]

    @property
    def flies(self) -> bool:
        """Whether contact is lost in its settled turns."""
        return bool((self.settled[4] <= 0.0).any())

    def level(self) -> float:
        """DB re 20 µPa, of the settled turns."""
        settled = self.sound[:, self.sound[0] > self.begin + 1.0 / NS]
        mean = float(np.sum(settled[1] * settled[2]) / np.sum(settled[2]))
        return float(level_db(np.sqrt(mean)))

    def lift_coefficients(self, orders: FloatArray, offset: float) -> NDArray[np.complex128]:
        """Fourier coefficients of the lift over the cam angle, of the last whole turn.

        Parameters
        ----------
        offset : rad, of the cam's angle before the stretch's
        """
        angle = self.stretch.at(self.rows[0])
        last = angle > angle[-1] - TURN
        wave = np.exp(-1j * orders[:, None] * (angle[last] + offset))
        return np.asarray(wave @ self.rows[1, last] / np.count_nonzero(last))


def drive(loaded: LoadedScene, cam: str, stretch: SteadyStretch, offset: float) -> ModelRun:
    """Turn a cam of a scene as the stretch says.

    Parameters
    ----------
    offset : rad, the cam's angle less the stretch's
    """
    follower, microphone = FollowerSimulator.of(loaded), MicrophoneSimulator.of(loaded)
    blocks, sound = [], []
    for state in stretch.states(cam, offset):
        turned = follower.turn_to(state)
        if turned is None:
            continue
        block = turned[1]
        pressure = microphone.listen(block.rows, block.interval.mean_speed)
        blocks.append(block.rows)
        sound.append((block.interval.stop_ns / NS, pressure**2, float(block.rows.shape[1])))
    settle = loaded.scene.program.settle_turns.si * TURN / stretch.mean_speed
    begin = float(stretch.knots[0]) + settle
    return ModelRun(stretch, begin, np.hstack(blocks), np.array(sound).T)
