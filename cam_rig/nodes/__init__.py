"""The nodes: shells around the core, the only importers of rclpy."""

import os

# As in cam_rig.cli: before numpy is imported, one thread of BLAS a node.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
