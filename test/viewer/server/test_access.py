"""Who may ask: the whole table of right and wrong hosts, origins, tokens and cookies."""

from __future__ import annotations

import itertools

import pytest

from cam_rig.viewer.access import Access

ACCESS = Access(8123, "right")
HOSTS = {"127.0.0.1:8123": True, "localhost:8123": True, "127.0.0.1": False, "evil.example": False}
ORIGINS = {
    None: True,
    "http://127.0.0.1:8123": True,
    "http://localhost:8123": True,
    "http://127.0.0.1:8124": False,
    "null": False,
    "https://127.0.0.1:8123": False,
}
COOKIES = {
    "cam_rig_8123=right": True,
    "a=b; cam_rig_8123=right; c": True,
    "cam_rig_8124=right": False,
    "cam_rig_8123=righ": False,
    "cam_rig_8123=": False,
    "é\ud800=1": False,
    "": False,
}


@pytest.mark.parametrize("needs_origin", [False, True])
def test_all_three_must_be_right(needs_origin: bool) -> None:
    """One that is wrong refuses, whatever the others are, with one line that says what is."""
    for host, origin, cookie in itertools.product(HOSTS, ORIGINS, COOKIES):
        given = {"host": host, "origin": origin, "cookie": cookie}
        headers = {name: value for name, value in given.items() if value is not None}
        why_not = ACCESS.why_not(headers, None, needs_origin)
        right = HOSTS[host] and ORIGINS[origin] and COOKIES[cookie]
        assert (why_not == "") == (right and not (needs_origin and origin is None)), given
        assert why_not == "" or why_not.startswith("allowed")
        assert "right" not in why_not
        assert len(why_not.splitlines()) <= 1


def test_a_token_in_the_address_counts_alone() -> None:
    """A wrong one is refused also beside the right cookie; the right one needs none."""
    headers = {"host": "localhost:8123"}
    assert ACCESS.why_not(headers, "right") == ""
    for wrong in ("", "wrong", "\ud800"):
        assert ACCESS.why_not(headers | {"cookie": "cam_rig_8123=right"}, wrong) != ""


def test_every_server_has_a_token_of_its_own() -> None:
    """Long enough that nobody guesses it."""
    tokens = {Access(1).token for _ in range(100)}
    assert len(tokens) == 100
    assert min(map(len, tokens)) >= 32
