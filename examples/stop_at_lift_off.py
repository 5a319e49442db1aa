"""A node of one's own: it stops the drive as soon as the follower leaves the cam."""

from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.client import Client
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import Trigger

#: Also what was said before the follower discovered this node.
LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class StopAtLiftOff(Node):
    """Listens to the follower, and calls the drive once; in the namespace that it is started in."""

    def __init__(self) -> None:
        super().__init__("stop_at_lift_off")
        self.answer: Any = None
        self.stop: Client = self.create_client(Trigger, "cam_drive/stop")
        self.stop.wait_for_service()
        self.create_subscription(DiagnosticArray, "diagnostics", self.on_diagnostics, LATCHED)

    def on_diagnostics(self, message: DiagnosticArray) -> None:
        """The follower says whether it kept contact, and at which speed."""
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
