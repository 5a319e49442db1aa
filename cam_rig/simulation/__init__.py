"""A scene file to samples and sound levels, without ROS; the nodes use the same core."""
