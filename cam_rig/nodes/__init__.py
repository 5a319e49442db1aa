"""The nodes: shells around the core, the only importers of rclpy."""
