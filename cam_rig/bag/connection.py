"""Topic in a file of a bag, with the definition of its message type."""

from __future__ import annotations

from typing import NamedTuple

from rosbags.interfaces import MessageDefinition, MessageDefinitionFormat

#: Name of the serialization format of ROS 2 messages (Common Data Representation).
CDR = "cdr"
#: Formats of message definitions that rosbags can parse, by their names in a bag.
DEFINITION_FORMATS = {
    "ros2msg": MessageDefinitionFormat.MSG,
    "ros2idl": MessageDefinitionFormat.IDL,
    "omgidl": MessageDefinitionFormat.IDL,
}
#: Placeholder for a message definition that is missing or cannot be parsed.
NO_DEFINITION = MessageDefinition(MessageDefinitionFormat.NONE, "")


class Connection(NamedTuple):
    """Topic in a file of a bag, with names as in rosbags.

    `id` identifies the topic within the file. `encoding` is the serialization format of its
    messages, `msgdef` the definition of their type, and `msgcount` their number.
    """

    id: int
    topic: str
    msgtype: str
    encoding: str
    msgdef: MessageDefinition
    msgcount: int


def message_definition(encoding: str, text: str) -> MessageDefinition:
    """Return the definition of a message type in the form of rosbags.

    `encoding` is the name of its format in the bag, a key of `DEFINITION_FORMATS`, and `text` is
    the definition. Returns `NO_DEFINITION` for another format.
    """
    kind = DEFINITION_FORMATS.get(encoding)
    return NO_DEFINITION if kind is None else MessageDefinition(kind, text)
