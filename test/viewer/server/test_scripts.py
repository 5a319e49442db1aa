"""What a page is given to do beside the viewer."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from cam_rig.viewer.page import TIMELINE, cursor_request, page_script
from cam_rig.viewer.timeline import RIG_TIME


def fields(message: bytes) -> Iterator[tuple[int, int | bytes]]:
    """Numbers and contents of a protobuf message's fields: whole numbers, and what has a length."""
    rest = list(message)

    def varint() -> int:
        value = shift = 0
        while True:
            byte = rest.pop(0)
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value

    while rest:
        key = varint()
        assert key & 7 in (0, 2)
        if key & 7 == 0:
            yield key >> 3, varint()
        else:
            size = varint()
            yield key >> 3, bytes(rest[:size])
            del rest[:size]


@pytest.mark.parametrize("time_ns", [1, 127, 128, 300_000_000, 7_200_000_000_000])
def test_the_request_names_timeline_and_time(time_ns: int) -> None:
    """As Rerun's Viewer Control API numbers its fields."""
    [(number, request)] = fields(cursor_request(time_ns))
    assert number == 6 and isinstance(request, bytes)
    parts = dict(fields(request))
    assert isinstance(parts[2], bytes) and isinstance(parts[3], bytes)
    assert dict(fields(parts[2])) == {1: RIG_TIME.encode()}
    assert dict(fields(parts[3])) == {1: time_ns}


def test_the_timeline_is_that_of_the_recording() -> None:
    """Its name stands in two modules, for one of them must not import Rerun."""
    assert TIMELINE == RIG_TIME


def test_only_a_recording_that_begins_later_has_its_cursor_moved() -> None:
    """A live run is followed, and its page asks nothing of its viewer."""
    assert "viewer_control" not in page_script()
    assert "viewer_control" in page_script(0.3)
    assert "300000000n" in page_script(0.3)
