"""Test of the follower with replay_testing: its states are recomputed from a recorded run.

Run it in a sourced workspace, in the folder of the source:
`ros2 run replay_testing replay_test examples/ros2/replay_test_of_the_follower.py`.
"""

import mcap_ros2.reader
from launch import LaunchDescription
from launch_ros.actions import Node
from replay_testing import McapFixture, analyze, fixtures, run

#: Recorded run of the scene quick, which belongs to the source.
BAG = "bags/golden/golden_0.mcap"
#: Number of ticks of the recorded run.
TICKS = 16


@fixtures.parameterize([McapFixture(path=BAG)])
class Fixtures:
    """Messages that are replayed, and the topic that the node under test publishes."""

    input_topics = ("/cam/law_coefficients", "/cam/state")
    output_topics = ("/follower/state",)


@run.default()
class Run:
    """Node under test."""

    qos_overrides_yaml = "config/record_qos.yaml"

    def generate_launch_description(self) -> LaunchDescription:
        """Return the launch of the follower."""
        parameters = [{"scene": "quick", "on_finish": "wait"}]
        return LaunchDescription(
            [Node(package="cam_rig", executable="follower", parameters=parameters)]
        )


@analyze
class Analyze:
    """Checks of the recorded messages of the follower."""

    def test_one_state_per_tick(self) -> None:
        """The follower publishes one state per tick, with lift, velocity and force."""
        found = mcap_ros2.reader.read_ros2_messages(self.reader, topics=["/follower/state"])
        states = [message.ros_msg for message in found]
        assert len(states) == TICKS
        assert all(len(state.position) == 1 for state in states)
