"""Detection of a second publisher on a topic that belongs to one node."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from cam_rig.errors import CamRigError
from cam_rig.messages.topics import Topic, second_publisher

if TYPE_CHECKING:
    from cam_rig.nodes.base.rig_node import RigNode

#: Period (s, wall clock) at which the publishers of each monitored topic are counted.
CHECK_PERIOD_S = 0.25
#: Longest time (s, wall clock) to wait for the node name of a second publisher. DDS may announce an
#: endpoint before the name of its node, and a program without ROS never has a name.
MAX_NAME_WAIT_S = 5.0
#: Text for a publisher whose node still has no name after `MAX_NAME_WAIT_S`.
UNNAMED = "a program that is not a ROS node"


class UnnamedPublisherError(CamRigError):
    """Error of a callback that needs the node name of a publisher before DDS has announced it.

    The callback is repeated by `PublisherMonitor.repeat`.
    """


class PublisherMonitor:
    """Ends the run if another node publishes on one of the topics of this node.

    The number of publishers is polled, because the matched event of rclpy reports only endpoints
    that match a subscription of this node, and an owner does not subscribe to its topics.
    """

    def __init__(self, node: RigNode) -> None:
        self._node = node
        self._topics: list[Topic] = []
        #: Time (s, monotonic clock) until which the monitor waits for a node name, by topic.
        self._named_by: dict[Topic, float] = {}
        self._repeated: Callable[[], object] | None = None
        node.create_wall_timer(CHECK_PERIOD_S, self._check)

    def add(self, topic: Topic) -> None:
        """Monitor a topic that this node alone may publish."""
        self._topics.append(topic)

    def find_publishers(self, topic: Topic) -> dict[bytes, str]:
        """Return the full node name of each publisher of a topic by DDS identifier.

        Publishers of another message type are left out, because DDS never connects them.

        Raises
        ------
        UnnamedPublisherError
            If a name is not discovered yet. After `MAX_NAME_WAIT_S` the name is `UNNAMED` instead.
        """
        names = {
            bytes(info.endpoint_gid): f"{info.node_namespace.rstrip('/')}/{info.node_name}"
            for info in self._node.get_publishers_info_by_topic(topic.relative)
            if info.topic_type == topic.type
        }
        unnamed = {gid: UNNAMED for gid, name in names.items() if "UNKNOWN" in name}
        now = time.monotonic()
        if not unnamed:
            self._named_by.pop(topic, None)
        elif now < self._named_by.setdefault(topic, now + MAX_NAME_WAIT_S):
            raise UnnamedPublisherError(f"{topic.name}: the node of a publisher has no name yet")
        return names | unnamed

    def repeat(self, action: Callable[[], object]) -> None:
        """Repeat a callback at the next check, because it has raised `UnnamedPublisherError`.

        Only the first callback is kept. The error that it raises with the name ends the run.
        """
        self._repeated = self._repeated or action

    def _check(self) -> None:
        """End the run if a monitored topic has a second publisher. The error names its node."""
        action, self._repeated = self._repeated, None
        if action is not None:
            action()
        for topic in self._topics:
            # the count is cheap, but includes publishers of another message type
            if self._node.count_publishers(topic.relative) <= 1:
                continue
            try:
                names = list(self.find_publishers(topic).values())
            except UnnamedPublisherError:
                continue
            if len(names) > 1:
                this_node = self._node.get_fully_qualified_name()
                others = [name for name in names if name != this_node] or names[1:]
                self._node.fail(second_publisher(topic, topic.owner, ", ".join(others)))
