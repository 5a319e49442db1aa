"""Reader of an SQLite file of a bag.

The reader returns the topics, and the messages in the order of their log times.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from pathlib import Path

from cam_rig.bag.connection import NO_DEFINITION, Connection, message_definition


class SqliteFile:
    """Reader of an SQLite file of a bag, as a context manager.

    It has the interface of `McapFile`. The file is opened as immutable, so that no other file is
    written next to it.
    """

    def __init__(self, file: Path) -> None:
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
