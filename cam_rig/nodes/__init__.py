"""ROS 2 nodes of the rig, the only package that imports rclpy."""

import os

# One BLAS thread per node, as in cam_rig.cli. The variable is read when numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
