"""What the rig's nodes say on /diagnostics, each once, in the order of rig time."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

from cam_rig.bag.recording.pending import MAX_WAITING, make_room
from cam_rig.errors import RefusedError
from cam_rig.messages import topics


class Diagnosis(NamedTuple):
    """Rig time (ns), who speaks, and the serialized message."""

    stamp: int
    speaker: str
    cdr: bytes


class Diagnoses:
    """Diagnoses that wait for their time: none is believed before a state of the cam shows it.

    So a stamp of the wall clock, which others use on the same topic, never gets into a bag.
    """

    def __init__(self) -> None:
        self._waiting: dict[Diagnosis, None] = {}
        self._said: deque[Diagnosis] = deque(maxlen=4 * MAX_WAITING)

    def take(self, stamp: int, speaker: str, cdr: bytes) -> None:
        """Keep a diagnosis that was not here before.

        Raises
        ------
        RefusedError : it is of no node of the rig, or there are too many of no known time
        """
        if speaker == topics.PACE:
            return
        if speaker not in topics.SPEAKERS:
            raise RefusedError(
                f"{topics.DIAGNOSTICS.name}: of {speaker[:80]!r}; recorded: "
                f"{', '.join(topics.SPEAKERS)}"
            )
        diagnosis = Diagnosis(stamp, speaker, cdr)
        if diagnosis in self._said or diagnosis in self._waiting:
            return
        self._waiting[diagnosis] = None
        if make_room(self._waiting):
            raise RefusedError(
                f"{topics.DIAGNOSTICS.name}: more than {MAX_WAITING} of no known time"
            )

    def due(self, until: int) -> Iterator[tuple[int, bytes]]:
        """Log time (ns) and message of all up to a rig time."""
        for diagnosis in sorted(one for one in self._waiting if one.stamp <= until):
            del self._waiting[diagnosis]
            self._said.append(diagnosis)
            # Some ns late, by speaker: its place among others of its time depends on nobody's haste
            yield (
                diagnosis.stamp + 1 + topics.SPEAKERS.index(diagnosis.speaker),
                diagnosis.cdr,
            )
