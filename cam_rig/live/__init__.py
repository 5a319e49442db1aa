"""The protocol between the nodes, without ROS: who may send what when, and what a node keeps."""
