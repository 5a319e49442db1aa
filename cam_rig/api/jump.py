"""The jump speed of a cam on a rig: the lowest at which the follower loses contact."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from cam_rig.api.arguments import checked
from cam_rig.api.notebook import shown
from cam_rig.extras import libraries_named
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.studies.jump.any_rig import find_jump, follower_of
from cam_rig.studies.jump.contact_lost_speed import FROM_REST
from cam_rig.studies.jump.jump_speed import Jump

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame


@dataclass(frozen=True, repr=False)
class JumpSpeed(Jump):
    """A jump speed: ``rpm``, ``speed`` (rad/s), and where contact is lost.

    ``angle`` (rad of cam angle in its turn) and ``time`` (s, from rest or from the beginning of a
    turn) are those of the first lift-off. ``duration`` (s) is the run's; None is steady state.
    """

    law: Law = field(repr=False)
    rig: RigConfig = field(repr=False)
    duration: float | None

    def __repr__(self) -> str:
        """What and where, in rpm and degrees."""
        where = f"contact lost at {math.degrees(self.angle):.1f}° after {self.time:.3g} s"
        return f"JumpSpeed({self.law.name}: {self.rpm:.2f} rpm, {where})"

    def to_pandas(self) -> DataFrame:
        """One row: cam, speed, and where contact is lost.

        Raises
        ------
        MissingLibraryError : pandas is not installed
        """
        with libraries_named():
            from pandas import DataFrame
        row = {"cam": self.law.name, "rpm": self.rpm, "angle_rad": self.angle, "time_s": self.time}
        return DataFrame([row])

    def plot(self) -> Figure:
        """The minimum contact force (N) of a run over the speed (rpm): zero at the jump speed.

        Raises
        ------
        MissingLibraryError : matplotlib is not installed
        """
        with libraries_named():
            from cam_rig.plots.jump import one_cam
        return shown(one_cam(self.law, follower_of(self.rig), self.duration, self.rpm))


@checked
def jump_speed(law: Law, rig: RigConfig, *, duration: float | None = FROM_REST) -> JumpSpeed:
    """The lowest speed at which the follower loses contact, to 0.01 rpm.

    Of two masses where the rig says how they split, else of one rigid mass, which does not vibrate.

    Parameters
    ----------
    law : of `build_law`, or one's own `Law`
    rig : two masses with ``roller_share`` and ``stem_damping``, such as ``paper_table2``; one
        mass without both
    duration : s, of runs from rest at cam angle 0, each at one speed; None for the steady state

    Raises
    ------
    ConfigError : an argument of another type, or the rig has one of the two numbers alone
    DynamicsError : a duration beyond 60 s; contact lost at every speed or at none; or no steady
        state

    Examples
    --------
    >>> import cam_rig
    >>> law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    >>> rig = cam_rig.load_rig("paper_table2")
    >>> round(cam_rig.jump_speed(law, rig).rpm, 2)
    413.44
    """
    found = find_jump(law, follower_of(rig), duration)
    return JumpSpeed(found.speed, found.angle, found.time, law, rig, duration)
