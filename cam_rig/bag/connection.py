"""Topic in a file of a bag, with the definition of its message type."""

from __future__ import annotations

from typing import NamedTuple

from rosbags.interfaces import MessageDefinition, MessageDefinitionFormat

#: Name of the encoding of ROS 2 messages.
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

    `encoding` is that of its messages, and `msgcount` their number.
    """

    id: int
    topic: str
    msgtype: str
    encoding: str
    msgdef: MessageDefinition
    msgcount: int


def message_definition(encoding: str, text: str) -> MessageDefinition:
    """Return the definition of a message type in a file.

    The result is `NO_DEFINITION` for an unknown encoding.
    """
    kind = DEFINITION_FORMATS.get(encoding)
    return NO_DEFINITION if kind is None else MessageDefinition(kind, text)
