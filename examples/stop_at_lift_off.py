"""User-defined node that stops the drive as soon as the follower leaves the cam."""

from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.client import Client
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import Trigger

#: QoS profile that also receives messages from before the discovery of the node.
LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class StopAtLiftOff(Node):
    """Node that listens to the follower, and stops the drive once.

    It uses the namespace in which it is started.
    """

    def __init__(self) -> None:
        super().__init__("stop_at_lift_off")
        self.answer: Any = None
        self.stop: Client = self.create_client(Trigger, "cam_drive/stop")
        self.stop.wait_for_service()
        self.create_subscription(DiagnosticArray, "diagnostics", self.on_diagnostics, LATCHED)

    def on_diagnostics(self, message: DiagnosticArray) -> None:
        """Stop the drive if the follower reports a loss of contact, and print its speed."""
        for status in message.status:
            lost = status.name == "follower" and status.level == DiagnosticStatus.WARN
            if lost and self.answer is None:
                values = {pair.key: pair.value for pair in status.values}
                self.get_logger().info(f"contact lost at {values['rpm']} rpm")
                self.answer = self.stop.call_async(Trigger.Request())


rclpy.init()
node = StopAtLiftOff()
while node.answer is None or not node.answer.done():
    rclpy.spin_once(node)
node.get_logger().info(f"the drive: {node.answer.result().message}")
