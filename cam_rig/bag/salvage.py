"""Reading an MCAP file as far as it goes: cut off, or with damaged parts."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, Chunk, DataEnd, Footer, Message, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from cam_rig.errors import BagError

#: What a file with wrong bytes in it may raise in the readers.
DAMAGE = (
    McapError,
    OSError,
    struct.error,
    zlib.error,
    KeyError,
    IndexError,
    ValueError,
    EOFError,
    MemoryError,
    OverflowError,
    RuntimeError,
)


def reason(error: Exception) -> str:
    """An error's words in one line, or its kind where it has none."""
    words = re.sub(r"\[?PosixPath\('([^']*)'\)\]?", r"\1", " ".join(str(error).split()))
    return words or type(error).__name__


@dataclass
class Salvage:
    """The attachments and messages of a file, in its order; what was lost is known afterwards.

    ``whole`` says that the file was closed, ``damaged`` how many of its chunks were unreadable,
    ``unread`` how many bytes at its end no record could be made of.
    """

    file: Path
    whole: bool = False
    damaged: int = 0
    unread: int = 0

    def records(self) -> Iterator[tuple[Schema, Channel, Message] | Attachment]:
        """Messages with their channel, and attachments.

        Raises
        ------
        BagError : the file cannot be opened
        """
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        for record in self._pieces():
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Attachment):
                yield record
            elif isinstance(record, Message):
                channel = channels.get(record.channel_id)
                schema = None if channel is None else schemas.get(channel.schema_id)
                if channel is not None and schema is not None:
                    yield schema, channel, record

    def _pieces(self) -> Iterator[Any]:
        try:
            stream = self.file.open("rb")
        except OSError as error:
            raise BagError(f"{self.file}: cannot be read ({error.strerror})") from None
        size, good = self.file.stat().st_size, 0
        with stream:
            records = StreamReader(stream, emit_chunks=True, record_size_limit=size).records
            try:
                for record in records:
                    good = stream.tell()
                    if isinstance(record, Chunk):
                        yield from self._inside(record)
                    elif isinstance(record, (DataEnd, Footer)):
                        self.whole = True
                        return
                    else:
                        yield record
            except DAMAGE:
                self.unread = size - good

    def _inside(self, chunk: Chunk) -> list[Any]:
        try:
            return list(breakup_chunk(chunk, validate_crc=True))
        except DAMAGE:
            self.damaged += 1
            return []
