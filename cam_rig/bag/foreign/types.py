"""Message types of a bag: the definitions in its files, else the types of ROS 2."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from rosbags.interfaces import MessageDefinitionFormat, Nodetype
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.base import TypesysError
from rosbags.typesys.store import Typestore

from cam_rig.bag.connection import Connection
from cam_rig.errors import BagError

#: Pattern of the line that separates two IDL definitions in the text of one MCAP schema.
NEXT_IDL = re.compile(r"^=+\nIDL: .*\n", re.MULTILINE)
#: Number of values that an integer type can represent, by its name in a message definition.
SPANS = {f"{sign}int{bits}": 2**bits for sign in ("", "u") for bits in (8, 16, 32, 64)}
SPANS |= {"byte": 2**8, "char": 2**8, "octet": 2**8}


def types_of(bag: Path, connection: Connection) -> Typestore:
    """Return the types with which the messages of a topic are read.

    The definition in the file has priority, because a standard type differs between ROS
    distributions. Raises BagError for a type without a readable definition.
    """
    store, kind = get_typestore(Stores.ROS2_KILTED), connection.msgtype
    if connection.msgdef.format is MessageDefinitionFormat.NONE:
        if kind in store.fielddefs:
            return store
        raise BagError(
            f"{bag}: {connection.topic} is of type {kind}, which is not a standard message and "
            "has no definition in the file; record it with storage mcap, which stores definitions"
        )
    try:
        definitions = _parse_definitions(connection)
    except TypesysError as error:
        if kind in store.fielddefs:
            return store
        reason = str(error).splitlines()[0]
        raise BagError(
            f"{bag}: {connection.topic}: the definition of type {kind} in the file cannot be "
            f"read ({reason}); record the bag with ros2 bag record"
        ) from None
    try:
        store.register(definitions)
    except TypesysError:  # a standard type of another distribution
        standard = store.fielddefs
        store = get_typestore(Stores.EMPTY)
        others = {name: standard[name] for name in standard if name not in definitions}
        store.register({**others, **definitions})
    return store


def _parse_definitions(connection: Connection) -> dict[str, Any]:
    if connection.msgdef.format is MessageDefinitionFormat.MSG:
        return get_types_from_msg(connection.msgdef.data, connection.msgtype)
    definitions: dict[str, Any] = {}
    for text in NEXT_IDL.split(connection.msgdef.data):
        if text.strip():
            definitions.update(get_types_from_idl(text))
    return definitions


def integer_span(types: Typestore, kind: str, path: str) -> int | None:
    """Return the number of values that the integer type of a field can represent.

    `kind` is the type of the message, and `path` the path of the field. Returns None for a field of
    another type.
    """
    node: Any = (Nodetype.NAME, kind)
    for part in path.split("."):
        name, _, index = part.partition("[")
        fields = dict(types.fielddefs[node[1]][1]) if node[0] is Nodetype.NAME else {}
        node = fields.get(name, (Nodetype.BASE, ("", 0)))
        if index and node[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            node = node[1][0]
    return SPANS.get(node[1][0]) if node[0] is Nodetype.BASE else None
