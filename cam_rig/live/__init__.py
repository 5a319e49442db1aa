"""The protocol between the nodes, without ROS: what is sent when, admitted, and saved."""
