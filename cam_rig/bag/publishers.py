"""One publisher a topic: the node that owns it, whose messages alone a recording holds."""

from __future__ import annotations

from collections.abc import Callable

from cam_rig.errors import RunError
from cam_rig.messages.topics import Topic


class Publishers:
    """The processes that have published as each node of the rig.

    Parameters
    ----------
    starts : how often a node was started so far; one without a runner that starts it again
    name_of : who publishes on a topic from a process, in words
    """

    def __init__(
        self,
        starts: Callable[[str], int] = lambda _node: 1,
        name_of: Callable[[Topic, bytes], str] = lambda _topic, source: source.hex(),
    ) -> None:
        self._starts, self._name_of = starts, name_of
        #: By node and process, the topic on which it was first heard.
        self._sources: dict[str, dict[bytes, Topic]] = {}

    def require(self, node: str, topic: Topic, source: bytes) -> None:
        """Refuse to go on when another process than a node's own publishes what is that node's.

        An empty ``source`` is the recorder itself.

        Raises
        ------
        RunError : a second publisher, by its name
        """
        known = self._sources.setdefault(node, {})
        if not source or source in known:
            return
        if len(known) >= self._starts(node):
            raise self._stranger(node, {source: topic, **known})
        known[source] = topic

    def _stranger(self, node: str, heard: dict[bytes, Topic]) -> RunError:
        """The error that names who does not bear the node's name, be it the first that was heard.

        Where all bear it, the one that was heard last.
        """
        names = {source: self._name_of(topic, source) for source, topic in heard.items()}
        strangers = [source for source, name in names.items() if name.split("/")[-1] != node]
        source = next(iter(strangers or heard))
        return second_publisher(heard[source], node, names[source])


def second_publisher(topic: Topic, node: str, other: str) -> RunError:
    """The error that ends a run in which two speak for one node."""
    return RunError(
        f"{topic.name}: has a second publisher, {other}; allowed: one, this rig's {node}; end the "
        "other, or set ROS_DOMAIN_ID to another number"
    )
