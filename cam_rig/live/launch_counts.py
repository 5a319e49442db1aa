"""How often each node of a run was started: so many processes may have published as that node."""

from __future__ import annotations

import os
from pathlib import Path

from cam_rig.errors import RunError


class Starts:
    """A count for each node, in the folder of a run whose killed nodes are started again.

    Parameters
    ----------
    folder : the run's handover folder; empty where no node is started again
    """

    def __init__(self, folder: str) -> None:
        self._folder = Path(folder) if folder else None

    def note(self, node: str) -> None:
        """Count one more start of a node, before it publishes anything.

        Raises
        ------
        RunError : the folder cannot be written
        """
        if self._folder is None:
            return
        file, count = self._file(node), self._read(node) + 1
        part = file.with_suffix(".starting")
        try:
            part.write_text(str(count), encoding="ascii")
            os.replace(part, file)
        except OSError as error:
            raise RunError(f"{file}: cannot be written ({error.strerror})") from None

    def count(self, node: str) -> int:
        """Starts of a node so far; one where none is started again."""
        return max(1, self._read(node)) if self._folder is not None else 1

    def _file(self, node: str) -> Path:
        assert self._folder is not None
        return self._folder / f"{node}.starts"

    def _read(self, node: str) -> int:
        try:
            with self._file(node).open(encoding="ascii") as stream:
                return int(stream.read(20) or 0)
        except FileNotFoundError:
            return 0
        except (OSError, ValueError) as error:
            raise RunError(f"{self._file(node)}: is not a count of starts ({error})") from None
