"""One publisher a topic: the node that owns it, whose messages alone a recording holds."""

from __future__ import annotations

from collections.abc import Callable

from cam_rig.errors import RunError
from cam_rig.messages.topics import Topic


class Publishers:
    """The processes that have published as each node of the rig.

    Parameters
    ----------
    launches : how often a node was launched so far; once, unless killed nodes are started again
    name_of : the node that publishes on a topic from a process
    """

    def __init__(
        self,
        launches: Callable[[str], int] = lambda _node: 1,
        name_of: Callable[[Topic, bytes], str] = lambda _topic, source: source.hex(),
    ) -> None:
        self._launches, self._name_of = launches, name_of
        #: By node and process, the topic of the first message.
        self._sources: dict[str, dict[bytes, Topic]] = {}

    def require(self, node: str, topic: Topic, source: bytes) -> None:
        """Refuse to go on when another process than a node's own publishes on its topics.

        An empty ``source`` is the recorder itself.

        Raises
        ------
        RunError : a second publisher, by its name
        """
        known = self._sources.setdefault(node, {})
        if not source or source in known:
            return
        if len(known) >= self._launches(node):
            raise self._second_publisher(node, {source: topic, **known})
        known[source] = topic

    def _second_publisher(self, node: str, sources: dict[bytes, Topic]) -> RunError:
        """The error that names the process without the node's name, though it may be the first.

        Where all bear the name, the newest.
        """
        names = {source: self._name_of(topic, source) for source, topic in sources.items()}
        others = [source for source, name in names.items() if name.split("/")[-1] != node]
        source = next(iter(others or sources))
        return second_publisher(sources[source], node, names[source])


def second_publisher(topic: Topic, node: str, other: str) -> RunError:
    """The error that ends a run in which two processes publish as one node."""
    return RunError(
        f"{topic.name}: has a second publisher, {other}; allowed: one, this rig's {node}; end the "
        "other, or set ROS_DOMAIN_ID to another number"
    )
