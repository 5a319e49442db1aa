"""Launch file of the TM21 noise sweep: rig.launch.py with its default scene."""

from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """Include rig.launch.py."""
    rig = PathJoinSubstitution([FindPackageShare("cam_rig"), "launch", "rig.launch.py"])
    return LaunchDescription([IncludeLaunchDescription(PythonLaunchDescriptionSource(rig))])
