"""A scene file to samples and sound levels, without ROS: the same core as the nodes use."""
