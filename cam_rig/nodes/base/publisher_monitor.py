"""Detection of a second publisher on a topic that belongs to one node."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from cam_rig.messages.topics import Topic, second_publisher

if TYPE_CHECKING:
    from cam_rig.nodes.base.rig_node import RigNode

#: Period (s, wall clock) at which the publishers of each monitored topic are counted.
CHECK_PERIOD_S = 0.25
#: Longest time (s, wall clock) to wait for the node name of a second publisher. DDS may announce an
#: endpoint before the name of its node, and a program without ROS never has a name.
MAX_NAME_WAIT_S = 5.0
#: Text for a publisher whose node has no name yet.
UNNAMED = "a program that is not a ROS node"


class PublisherMonitor:
    """Ends the run if another node publishes on one of the topics of this node.

    The number of publishers is polled, because the matched event of rclpy reports only endpoints
    that match a subscription of this node, and an owner does not subscribe to its topics.
    """

    def __init__(self, node: RigNode) -> None:
        self._node = node
        self._topics: list[Topic] = []
        #: Time (s, monotonic clock) until which the monitor waits for the node name of a second
        #: publisher, 0 if it does not wait.
        self._named_by = 0.0
        node.create_wall_timer(CHECK_PERIOD_S, self._check)

    def add(self, topic: Topic) -> None:
        """Monitor a topic that this node alone may publish."""
        self._topics.append(topic)

    def find_publishers(self, topic: Topic) -> dict[bytes, str]:
        """Return the full node name of each publisher of a topic by DDS identifier.

        Publishers of another message type are left out, because DDS never connects them. The name
        is `UNNAMED` if the name of a node is not discovered yet.
        """
        names = {
            bytes(info.endpoint_gid): f"{info.node_namespace.rstrip('/')}/{info.node_name}"
            for info in self._node.get_publishers_info_by_topic(topic.relative)
            if info.topic_type == topic.type
        }
        return {gid: UNNAMED if "UNKNOWN" in name else name for gid, name in names.items()}

    def _check(self) -> None:
        """End the run if a monitored topic has a second publisher.

        The error names its node. If DDS has not announced the name yet, the check waits for it, at
        most `MAX_NAME_WAIT_S`.
        """
        # the count is cheap, but includes publishers of another message type
        suspected = [t for t in self._topics if self._node.count_publishers(t.relative) > 1]
        named_by, self._named_by = self._named_by or time.monotonic() + MAX_NAME_WAIT_S, 0.0
        for topic in suspected:
            names = list(self.find_publishers(topic).values())
            if len(names) <= 1:
                continue
            if UNNAMED in names and time.monotonic() < named_by:
                self._named_by = named_by
                continue
            this_node = self._node.get_fully_qualified_name()
            others = [name for name in names if name != this_node] or names[1:]
            self._node.fail(second_publisher(topic, topic.owner, ", ".join(others)))
