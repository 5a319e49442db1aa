"""Delayed messages of blocked writers, and a warning about subscribers that slow a node down."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from cam_rig.messages.topics import Topic
from cam_rig.runner.node_table import ENTRIES

if TYPE_CHECKING:
    from cam_rig.nodes.base.rig_node import RigNode, RigPublisher

#: Period (s, wall clock) of the check, and the shortest time between two warnings.
PERIOD_S = 10.0
#: Largest fraction of the wall-clock time that a node may spend in publishing without a warning.
#: With one subscriber to /joint_states a free run spends 0.14, and 0.65 if this subscriber is
#: stopped (measured).
MAX_PUBLISHING = 0.3
#: Shortest time (s, wall clock) since the last check for a further check at the end of a run.
MIN_DURATION_S = 2.0
#: Period (s, wall clock) at which the delayed messages of blocked writers are published again.
RETRY_PERIOD_S = 0.2
#: Longest time (s, wall clock) for which a node that ends tries to publish its delayed messages.
MAX_FLUSH_S = 3.0


class PublishingMonitor:
    """Publishes delayed messages, and warns if a node spends much of its time in publishing.

    A reliable subscriber that does not take messages, such as a stopped process, makes each message
    on its topic about ten times as expensive (Fast DDS), and delays the run without any error.
    """

    def __init__(self, node: RigNode) -> None:
        self._node = node
        self._publishers: list[tuple[Topic, RigPublisher]] = []
        self._checked_at = time.monotonic()
        self._times: list[float] = []  # publishing_s of each publisher at the last check
        node.create_wall_timer(RETRY_PERIOD_S, self._on_timer)

    def add(self, topic: Topic, publisher: RigPublisher) -> None:
        """Monitor the publisher of a topic for delayed messages and slow subscribers."""
        self._publishers.append((topic, publisher))
        self._times.append(publisher.publishing_s)

    def _on_timer(self) -> None:
        self.retry()
        if (now := time.monotonic()) - self._checked_at >= PERIOD_S:
            self.check(now)

    def retry(self) -> None:
        """Publish the delayed messages of all writers that are no longer blocked."""
        for _, publisher in self._publishers:
            publisher.publish_delayed()

    def flush(self) -> None:
        """Publish the delayed messages of a node that ends, for at most `MAX_FLUSH_S`."""
        deadline = time.monotonic() + MAX_FLUSH_S
        while any(p.delayed for _, p in self._publishers) and time.monotonic() < deadline:
            self.retry()

    def check(self, now: float) -> None:
        """Warn if publishing took a large fraction of the time since the last check.

        The limit is `MAX_PUBLISHING`. `now` is the present time (s, monotonic clock).
        """
        times = [publisher.publishing_s for _, publisher in self._publishers]
        spent = [after - before for after, before in zip(times, self._times, strict=True)]
        duration, total = now - self._checked_at, sum(spent)
        self._times, self._checked_at = times, now
        if duration < MIN_DURATION_S or total <= MAX_PUBLISHING * duration:
            return
        factor = duration / max(duration - total, 0.01 * duration)
        topic = self._publishers[spent.index(max(spent))][0]
        names = ", ".join(self._find_subscribers(topic)) or "nodes of this rig only"
        self._node.get_logger().warning(
            f"publishing took {total:.1f} s of the last {duration:.1f} s, most of it on "
            f"{topic.name}: this node takes {factor:.1f} times as long; continue or end the "
            f"subscriber that takes no messages (subscribers: {names})"
        )

    def _find_subscribers(self, topic: Topic) -> list[str]:
        """Return the full names of the subscribers that are not nodes of the rig."""
        infos = self._node.get_subscriptions_info_by_topic(topic.relative)
        namespace = self._node.get_namespace()
        return sorted(
            f"{info.node_namespace.rstrip('/')}/{info.node_name}"
            for info in infos
            if info.node_namespace != namespace or info.node_name not in ENTRIES
        )
