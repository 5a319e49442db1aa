"""`cam_rig.testing` as a package of somebody else's uses it: in a pytest of its own."""

import os
import re
import subprocess
import sys
from importlib.metadata import entry_points

import pytest

from cam_rig.errors import RunError
from cam_rig.messages.codec import stamp_ns

from ..docs.pages import DOCS, blocks

pytestmark = pytest.mark.ros
pytest_plugins = ["pytester"]
#: Of the pytest of somebody else; naming the rig's does no harm where it is found anyway.
PLUGINS = ("-p", "cam_rig.testing", "-p", "no:cacheprovider", "-p", "no:xdist")


def test_pytest_finds_it_by_itself():
    """By an entry point of the installed package; its name is the module's."""
    (found,) = entry_points(group="pytest11", name="cam_rig.testing")
    assert found.value == found.name


@pytest.mark.usefixtures("forked")
def test_the_rig_is_driven_listened_to_and_read(start_rig):
    """Commands, messages live, the run's end by itself, and the bag after it."""
    rig = start_rig("quick", autostart=False)
    assert rig.scene.name == "quick.yaml"
    pressures = rig.listen("/microphone/pressure")
    with pytest.raises(RunError, match="cam_drive: rpm: "):
        rig.set_parameter("cam_drive", "rpm", 1e9)
    assert "the cam turns" in rig.call("/cam_drive/start")
    assert rig.wait_for_tick(3) | {"rpm": 0} == {"tick": 3, "cam": "tm21", "rpm": 0}
    lost = rig.wait_for_message("/diagnostics", says_contact_lost)
    assert lost.header.stamp.sec >= 0
    rig.wait_until_done()
    with pytest.raises(RunError, match="tick 99: the run was over after tick 16"):
        rig.wait_for_tick(99)
    run = rig.read_bag()
    assert run.complete and rig.bag.is_dir()
    stamps = {stamp_ns(message.header.stamp) for message in pressures}  # some may be sent again
    assert stamps == {tick.stop_ns for tick in run.ticks}
    assert len(run.ticks) == 16
    assert rig.ticks[-1]["cam"] == "bezier15"


def says_contact_lost(message):
    return any(status.message == "contact lost" for status in message.status)


@pytest.mark.usefixtures("forked")
def test_a_node_that_died_is_named_with_its_last_line(start_rig, tmp_path):
    """Where the test waits, and at its end where it does not."""
    (tmp_path / "occupied").mkdir()
    rig = start_rig("quick", bag=tmp_path / "occupied")
    with pytest.raises(RunError, match=r"node recorder ended with code \d.*occupied"):
        rig.wait_for_tick(3)


@pytest.mark.usefixtures("forked")
def test_a_program_that_failed_is_named_with_its_last_line(start_rig):
    """Beside the rig, as a node of it."""
    rig = start_rig("quick", autostart=False)
    rig.start_program(sys.executable, "-c", "raise SystemExit('no lathe found')")
    with pytest.raises(RunError, match=r"ended with code 1: no lathe found"):
        rig.wait_for_tick(1)


@pytest.mark.usefixtures("forked")
def test_two_rigs_do_not_hear_each_other(start_rig):
    """Each has a domain, a bag and numbers of its own, and the caller's environment comes back."""
    before = dict(os.environ)
    with start_rig("quick") as one, start_rig("quick") as two:
        assert one.domain != two.domain and one.bag != two.bag
        one.wait_until_done()
        two.wait_until_done()
        runs = [rig.read_bag() for rig in (one, two)]
    assert [tick.pressure for tick in runs[0].ticks] == [tick.pressure for tick in runs[1].ticks]
    assert dict(os.environ) == before


def test_the_page_s_example_runs(pytester):
    """The test module of the page, in a pytest that knows nothing but the installed plugin."""
    example = next(c for lang, _, c in blocks(DOCS / "own_nodes.md") if "def test_" in c)
    pytester.makepyfile(example)
    done = pytester.runpytest_subprocess(*PLUGINS)
    done.assert_outcomes(passed=len(re.findall(r"^def test_", example, re.M)))


@pytest.mark.long
def test_nothing_is_left_whatever_a_test_does(pytester):
    """A failing test, a node killed unnoticed: both reported, and no process of theirs remains."""
    pytester.makepyfile(
        """
        import os
        from contextlib import suppress

        def test_fails(start_rig):
            rig = start_rig("quick", pacing="real_time")
            rig.wait_for_tick(1)
            raise AssertionError("of the test's own")

        def test_looks_away(start_rig):
            rig = start_rig("quick", pacing="real_time")
            rig.wait_for_tick(1)
            pid = rig.pids["follower"]
            os.kill(pid, 9)
            with suppress(FileNotFoundError):
                while " Z " not in open(f"/proc/{pid}/stat").read():
                    pass
        """
    )
    done = pytester.runpytest_subprocess(*PLUGINS)
    done.assert_outcomes(failed=1, passed=1, errors=1)
    text = done.stdout.str()
    assert "of the test's own" in text
    assert "node follower was ended by signal 9" in text
    assert "[cam_drive]" in text
    left = subprocess.run(
        ["pgrep", "-f", str(pytester.path)],
        capture_output=True,
        text=True,
        check=False,
        timeout=100,
    )
    assert left.stdout == ""
