"""A class at one server: a hidden rig, a page and a file for each group, and none is lost."""

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from http.client import HTTPException
from pathlib import Path

import pytest

from cam_rig.errors import ConfigError, OutputError
from cam_rig.panel.command import ClassRoom, mark_sheets
from cam_rig.panel.lab.recorded import Notebook, read_sheet
from cam_rig.panel.server import serve

from ..viewer.asking import Visitor
from .conftest import WAIT_S, sheet_of

#: Readings that a page records until its server is killed.
EACH = 10


class ClassServer:
    """`cam-rig panel --lab jump` for all groups, as a process of its own."""

    def __init__(self, out, groups):
        seeds = [word for group in groups for word in ("--seed", group)]
        command = [Path(sys.executable).parent / "cam-rig", "panel", "--lab", "jump", *seeds]
        self.process = subprocess.Popen(
            [*map(str, command), "--no-rerun", "--out", str(out)],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        lines = [self.process.stdout.readline().strip() for _ in groups]
        self.addresses = dict(line.split(": ", 1) for line in lines)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.communicate(timeout=WAIT_S)

    def page(self, group):
        """A browser of a group's, led to its page."""
        return Visitor(self.addresses[group])


def recorded(page, place):
    """The speeds on a sheet, as its page shows them."""
    return [row["rpm"] for row in json.loads(page.get(f"{place}/sheet"))["readings"]]


def record_until_killed(server, group, recorded_one):
    """Speeds whose recording a page was told of, with what it had on its way in the end."""
    page, told = server.page(group), []
    options = json.loads(page.get(f"/lab/{group}/sheet"))["options"]
    setup = {name: values[0] for name, values in options.items()}
    for rpm in range(400, 400 + EACH):
        try:
            status, _, _ = page.post(f"/lab/{group}/record", json.dumps(setup | {"rpm": rpm}))
        except (OSError, HTTPException):  # the server is no more, or ended within its answer
            return told, rpm
        assert status == 200
        told.append(rpm)
        recorded_one()
    return told, None


@pytest.mark.slow
@pytest.mark.parametrize("many", [6, pytest.param(30, marks=pytest.mark.long)])
def test_groups_at_once_lose_nothing_when_the_server_is_killed(many, tmp_path):
    """What a page was told is in its group's file; started again, the server goes on with it."""
    groups = [f"group-{number}" for number in range(many)]
    with ClassServer(tmp_path, groups) as server, ThreadPoolExecutor(many) as pool:
        count = iter(range(many * EACH))

        def one():
            if next(count) == 3 * many:
                server.process.kill()

        pages = [(pool.submit(record_until_killed, server, group, one), group) for group in groups]
        told = {group: page.result(WAIT_S) for page, group in pages}
    assert any(rpm is not None for _, rpm in told.values())
    with ClassServer(tmp_path, groups) as again:
        for group, (speeds, waiting) in told.items():
            found = recorded(again.page(group), f"/lab/{group}")
            assert found[: len(speeds)] == speeds
            assert found[len(speeds) :] in ([], [waiting])
    files = [path for path in tmp_path.glob("lab_*.csv") if path.stat().st_size]
    assert {read_sheet(path).seed for path in files} == {g for g in groups if told[g][0]}
    marks = mark_sheets(files[:2], [], None, None)
    assert len(marks.tables()) > 0


def test_each_group_has_a_rig_and_a_page_of_its_own(tmp_path):
    """One seed is a sheet at /lab, several are a page each; a name stands for one group."""
    cams, rig = sheet_of().cams.values(), sheet_of().rig
    room = ClassRoom("jump", ("one", "two"), None)
    pages = room.pages([*cams], rig, tmp_path)
    assert list(pages) == ["/lab/one", "/lab/two"]
    assert list(ClassRoom("jump", ("one",), None).pages([*cams], rig, tmp_path)) == ["/lab"]
    with serve(*pages.values(), home="/lab/one") as served:
        one, two = (Visitor(served.access.address(place)) for place in pages)
        assert (one.home, two.home) == ("/lab/one", "/lab/two")
        assert json.loads(two.get("/lab/two/sheet"))["seed"] == "two"
    with pytest.raises(ConfigError, match="one is named twice"):
        ClassRoom("jump", ("one", "one"), None).pages([*cams], rig, tmp_path / "other")


def test_a_sheet_of_something_else_is_not_gone_on_with(tmp_path):
    """A file of another rig stays as it is."""
    sheet = sheet_of("tm21", seed="one")
    book = Notebook(sheet, tmp_path)
    book.record(vars(sheet.setups[0]) | {"rpm": 300.0})
    again = Notebook(sheet, tmp_path, goes_on=True)
    assert again.recorded == read_sheet(book.path)
    with pytest.raises(OutputError, match="another panel writes it; allowed: to end that one"):
        Notebook(sheet, tmp_path, goes_on=True)
    del again
    with pytest.raises(ConfigError, match="is of rig tm21; allowed: of paper_table2"):
        Notebook(sheet_of(seed="one"), tmp_path, goes_on=True)


def test_an_address_of_this_machine_answers_to_its_name_alone():
    """``--host`` is the only name that a browser may ask by; another machine's is refused."""
    own = "127.0.0.2"  # every machine's, as 127.0.0.1 is, and not that one
    with serve(home="/lab", host=own) as served:
        assert served.access.hosts == (f"{own}:{served.access.port}",)
        assert Visitor(served.address).home == "/lab"
    words = r"--host: is '203\.0\.113\.1' .*an address of this machine"
    with pytest.raises(ConfigError, match=words), serve(host="203.0.113.1"):
        pass
