"""Protocol between the nodes, without ROS: setpoints, flow control, pacing."""
