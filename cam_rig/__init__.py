"""cam_rig: a virtual cam test rig as a ROS 2 node stack."""

__version__ = "0.1.0"
