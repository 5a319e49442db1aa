"""The ROS 2 nodes: thin shells around the core, and the importers of rclpy."""

import os

# As in cam_rig.cli: before numpy is imported, one thread of BLAS a node.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
