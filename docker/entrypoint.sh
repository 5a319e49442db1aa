#!/bin/bash
# The built workspace, which names ROS 2 below it; then the command.
set -e
source /ws/install/setup.bash
exec "$@"
