"""A design's problem: the space of laws, the rig, the cam's follower, and who is asked what."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.laws import Law
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.studies.design.elastic.mode import Mode
from cam_rig.studies.design.space import Space
from cam_rig.studies.jump.any_rig import AnyFollower, follower_of


@dataclass(frozen=True, eq=False)
class DesignProblem:
    """What rows of a program are made of; ``free`` is what the start's cam has elsewhere."""

    cam: CamConfig
    start: Law
    rig: RigConfig
    space: Space
    free: tuple[str, ...] = ()

    @cached_property
    def rigid(self) -> FollowerParameters:
        """The follower as one rigid mass."""
        return FollowerParameters.from_rig(self.rig)

    @cached_property
    def follower(self) -> AnyFollower:
        """Of two masses where the rig says how they split."""
        return follower_of(self.rig)

    @property
    def two_masses(self) -> bool:
        """Whether it is."""
        return isinstance(self.follower, TwoMassParameters)

    @cached_property
    def mode(self) -> Mode:
        """Of that follower on its stem."""
        self.rig.need("stem_stiffness", "a goal or limit of vibration")
        return Mode.of(self.follower)

    @cached_property
    def force_scale(self) -> float:
        """The force (N) that forces are measured by: preload, or the spring at half the lift."""
        spring = 0.5 * self.rigid.spring_stiffness * self.start.lift
        return self.rigid.preload or spring
