"""Reader of an SQLite file of a bag.

The reader returns the topics, and the messages in the order of their log times.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from pathlib import Path

from cam_rig.bag.connection import NO_DEFINITION, Connection, message_definition

#: Length in bytes of the header of an SQLite file.
HEADER_BYTES = 100


def require_all_pages(file: Path) -> None:
    """Raise sqlite3.DatabaseError if an SQLite file is shorter than its header states.

    SQLite itself does not report this if the missing pages are not needed for a query. The header
    has the page size (bytes 16 and 17, where 1 means 65536) and the number of pages (bytes 28 to
    31). The number is valid if the change counters (bytes 24 and 92) are equal.
    """
    with file.open("rb") as stream:
        header = stream.read(HEADER_BYTES)
        size = stream.seek(0, os.SEEK_END)
    if len(header) < HEADER_BYTES or header[24:28] != header[92:96]:
        return  # an empty file or an old format, which SQLite checks
    page = int.from_bytes(header[16:18], "big")
    expected = (65536 if page == 1 else page) * int.from_bytes(header[28:32], "big")
    if size < expected:
        raise sqlite3.DatabaseError(f"the file must have {expected} bytes, got {size}")


class SqliteFile:
    """Reader of an SQLite file of a bag, as a context manager.

    It has the interface of `McapFile`. The file is opened as immutable, so that no other file is
    written next to it.
    """

    def __init__(self, file: Path) -> None:
        require_all_pages(file)
        self._database = sqlite3.connect(f"{file.absolute().as_uri()}?immutable=1", uri=True)
        with ExitStack() as on_error:
            on_error.callback(self._database.close)
            self.message_count, start = self._database.execute(
                "SELECT COUNT(*), MIN(timestamp) FROM messages"
            ).fetchone()
            self.start_ns = int(start or 0)
            self.connections = list(self._connections())
            on_error.pop_all()

    def __enter__(self) -> SqliteFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._database.close()

    def messages(
        self, connections: Collection[Connection]
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield the messages of some topics: connection, log time (ns) and data.

        A connection is a topic in a file.
        """
        wanted = {connection.id: connection for connection in connections}
        rows = self._database.execute(
            "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id"
        )
        for topic, time_ns, data in rows:
            if topic in wanted:
                yield wanted[topic], time_ns, data

    def _connections(self) -> Iterator[Connection]:
        tables = {name for (name,) in self._database.execute("SELECT name FROM sqlite_master")}
        definitions = {}
        if "message_definitions" in tables:  # ROS 2 Iron and later
            rows = self._database.execute(
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            )
            definitions = {
                kind: message_definition(encoding, text) for kind, encoding, text in rows
            }
        counts = dict(
            self._database.execute("SELECT topic_id, COUNT(*) FROM messages GROUP BY topic_id")
        )
        rows = self._database.execute(
            "SELECT id, name, type, serialization_format FROM topics ORDER BY id"
        )
        for number, name, kind, encoding in rows:
            definition = definitions.get(kind, NO_DEFINITION)
            yield Connection(number, name, kind, encoding, definition, counts.get(number, 0))
