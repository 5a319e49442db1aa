"""The robot's messages among those derived: from a mounted cam, and from a tick's instants."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

from cam_rig.messages import topics
from cam_rig.messages.instants import Instants
from cam_rig.messages.motion import DerivedMessage, MotionMessages, each_instant
from cam_rig.messages.topics import Topic
from cam_rig.robot.cam_markers import cam_markers
from cam_rig.robot.follower_markers import FollowerMarkers
from cam_rig.robot.frames import Robot
from cam_rig.robot.parts import new, serialize
from cam_rig.robot.transforms import Transforms
from cam_rig.robot.urdf import urdf
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.simulation.schedule import CamState


def motion_of_follower(loaded: LoadedScene, points_per_turn: int = 0) -> MotionMessages:
    """What the follower publishes while somebody subscribes."""
    return MotionMessages(loaded, points_per_turn, (ContactMarkers(loaded),))


def motion_of_bag(loaded: LoadedScene, points_per_turn: int = 0) -> MotionMessages:
    """What a bag holds besides what the recorder receives.

    Live, robot_state_publisher publishes /tf and /tf_static, and the law server the mounted cam.
    """
    further = ContactMarkers(loaded), RobotTransforms(loaded), MountedCam(loaded)
    return MotionMessages(loaded, points_per_turn, further)


class ContactMarkers:
    """/follower/markers."""

    topics = (topics.FOLLOWER_MARKERS,)

    def __init__(self, loaded: LoadedScene) -> None:
        self._of = cache(lambda cam: FollowerMarkers(Robot.of(loaded, cam)))

    def mounted(self, state: CamState) -> Iterable[DerivedMessage]:
        """None."""
        return ()

    def moved(self, instants: Instants) -> Iterable[DerivedMessage]:
        """One for each instant."""
        i = instants
        found = self._of(i.law.name).at(i.time_ns, i.angle_in_turn, i.lift, i.force)
        return each_instant(topics.FOLLOWER_MARKERS, i, found)


class RobotTransforms:
    """/tf and /tf_static."""

    topics = (topics.TF_STATIC, topics.TF)

    def __init__(self, loaded: LoadedScene) -> None:
        self._of = cache(lambda cam: Transforms(Robot.of(loaded, cam)))

    def mounted(self, state: CamState) -> Iterable[DerivedMessage]:
        """Of the links that stay where they are."""
        cdr = self._of(state.cam).fixed(state.time_ns)
        return (DerivedMessage(topics.TF_STATIC, state.time_ns, cdr),)

    def moved(self, instants: Instants) -> Iterable[DerivedMessage]:
        """One for each instant."""
        i = instants
        found = self._of(i.law.name).moving(i.time_ns, i.angle_in_turn, i.lift)
        return each_instant(topics.TF, i, found)


class MountedCam:
    """/robot_description and /cam/markers."""

    topics = (topics.ROBOT_DESCRIPTION, topics.CAM_MARKERS)

    def __init__(self, loaded: LoadedScene) -> None:
        self._loaded = loaded

    def messages(self, cam: str) -> list[tuple[Topic, bytes]]:
        """The serialized messages of a mounted cam of the scene."""
        robot = Robot.of(self._loaded, cam)
        description = serialize(new("std_msgs/String", urdf(robot)))
        return [(topics.ROBOT_DESCRIPTION, description), (topics.CAM_MARKERS, cam_markers(robot))]

    def mounted(self, state: CamState) -> Iterable[DerivedMessage]:
        """Both."""
        found = self.messages(state.cam)
        return [DerivedMessage(topic, state.time_ns, cdr) for topic, cdr in found]

    def moved(self, instants: Instants) -> Iterable[DerivedMessage]:
        """None."""
        return ()
