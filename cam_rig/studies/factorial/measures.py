"""What a factorial study measures of one law."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cam_rig.acoustics import RadiationParameters
from cam_rig.arrays import rms
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.laws import Law
from cam_rig.schema import FactorialConfig, RigConfig
from cam_rig.simulation.settled_turns import Acoustics, settled_turns
from cam_rig.studies.jump.rigid import rigid_jump_speed
from cam_rig.studies.jump.search import sought_speed
from cam_rig.studies.vibration.steady_state import require_speeds, residual_vibration, steady_turn
from cam_rig.units import RPM


@dataclass(frozen=True)
class Measures:
    """The effects of one law.

    Parameters
    ----------
    jump : rad/s, from rest; ``rigid_jump`` that of a rigid follower
    acceleration : m/s², geometric mean over the speeds of the largest |ẍ| in steady state;
        ``own_acceleration`` that of the law itself
    residual : m, r.m.s. over the speeds of the residual vibration in the low dwell
    noise : dB, mean over the speeds, landings among it, on the rigid follower
    noise_in_contact : dB, on the elastic follower, at the one speed
    """

    jump: float
    rigid_jump: float
    acceleration: float
    own_acceleration: float
    residual: float
    noise: float
    noise_in_contact: float


@dataclass(frozen=True)
class Bench:
    """Rigs and speeds of a study, ready to measure a law."""

    two_mass: TwoMassParameters
    follower: FollowerParameters
    rigid: FollowerParameters
    sound: Acoustics
    rigid_sound: Acoustics
    config: FactorialConfig

    @classmethod
    def of(cls, config: FactorialConfig, rig: RigConfig, noise_rig: RigConfig) -> Bench:
        """Take the numbers of the rigs.

        Raises
        ------
        ConfigError : the rig has no two masses, or they are not those of the noise's rig; a speed
            too fast for its stem
        """
        if rig.follower.mass.si != noise_rig.follower.mass.si:
            raise ConfigError(
                f"factorial {config.name!r}: follower.mass is {rig.follower.mass.si:g} kg on "
                f"{rig.name} and {noise_rig.follower.mass.si:g} kg on {noise_rig.name}; allowed: "
                "the same, or the effects are not of one follower"
            )
        follower = FollowerParameters.from_rig(rig)
        for key in ("accelerated", "residual"):
            try:
                require_speeds(follower, [v / RPM for v in getattr(config, key).si_list])
            except DynamicsError as error:
                raise ConfigError(f"factorial {config.name!r}: {key}: {error}") from None
        return cls(
            TwoMassParameters.from_rig(rig),
            follower,
            FollowerParameters.from_rig(noise_rig),
            Acoustics(RadiationParameters.from_rig(rig)),
            Acoustics(RadiationParameters.from_rig(noise_rig)),
            config,
        )

    def measure(self, law: Law) -> Measures:
        """Every effect of one law.

        Raises
        ------
        DynamicsError : a cam without a jump speed, or a speed without a steady state
        """
        config = self.config
        turns = [(s, steady_turn(law, self.follower, s)) for s in config.accelerated.si_list]
        peaks = [math.log(float(np.abs(turn.acceleration).max())) for _, turn in turns]
        bend = float(np.abs(law(turns[0][1].angle, 2)).max())
        own = [math.log(bend * speed**2) for speed, _ in turns]
        amplitude = residual_vibration(law, self.follower, np.array(config.residual.si_list))
        noise = settled_turns(law, "one_mass", self.rigid, config.noise.si_list)
        contact = settled_turns(law, "two_mass", self.two_mass, [config.noise_in_contact.si])
        return Measures(
            jump=sought_speed(law, self.two_mass, config.run.si),
            rigid_jump=rigid_jump_speed(law, self.follower),
            acceleration=math.exp(float(np.mean(peaks))),
            own_acceleration=math.exp(float(np.mean(own))),
            residual=rms(amplitude),
            noise=float(self.rigid_sound.levels(noise).mean()),
            noise_in_contact=float(self.sound.levels(contact)[0]),
        )
