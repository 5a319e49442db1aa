"""Test of the rig with launch_testing: all nodes end with code 0, and the bag is closed.

Run it in a sourced workspace: `launch_test examples/ros2/launch_test_of_the_rig.py`.
"""

import tempfile
import unittest
from pathlib import Path

import launch_testing.actions
import launch_testing.asserts
from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

#: Folder of the bag, which the recorder creates.
BAG = Path(tempfile.mkdtemp()) / "bag"


def generate_test_description() -> LaunchDescription:
    """Return the launch of the scene quick, followed by the tests."""
    rig = PathJoinSubstitution([FindPackageShare("cam_rig"), "launch", "rig.launch.py"])
    return LaunchDescription(
        [
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(rig),
                launch_arguments={"scene": "quick", "output_uri": str(BAG)}.items(),
            ),
            launch_testing.actions.ReadyToTest(),
        ]
    )


class TestRun(unittest.TestCase):
    """Checks while the rig turns."""

    def test_the_drive_turns_the_first_cam(self, proc_output: object) -> None:
        """The drive logs the first speed of the scene."""
        proc_output.assertWaitFor("turning tm21 at 200 rpm", timeout=60)
        proc_output.assertWaitFor("done with 16 ticks", timeout=60)


@launch_testing.post_shutdown_test()
class TestEnd(unittest.TestCase):
    """Checks after all nodes have ended."""

    def test_exit_codes_and_bag(self, proc_info: object) -> None:
        """Every node ends with code 0, and rosbag2's metadata exists."""
        launch_testing.asserts.assertExitCodes(proc_info)
        assert (BAG / "metadata.yaml").is_file()
