"""Tests of the live view of a run: nothing displayed is ahead of the curves.

These are bars, pictures and texts.
"""

import time
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from cam_rig.errors import CamRigError
from cam_rig.simulation.schedule import cam_states
from cam_rig.units import NS
from cam_rig.viewer import page as page_module
from cam_rig.viewer import recording as live
from cam_rig.viewer import timeline
from cam_rig.viewer.process import find_free_port, listening, stream_address
from cam_rig.viewer.quantities import ACCELERATION_LINE as ACCELERATION
from cam_rig.viewer.quantities import FORCE_LINE as FORCE
from cam_rig.viewer.quantities import LAW, ZERO
from cam_rig.viewer.quantities import LIFT_LINE as LIFT
from cam_rig.viewer.quantities import VELOCITY_LINE as VELOCITY
from cam_rig.viewer.recording import LiveView, live_window, screen_bucket
from cam_rig.viewer.timeline import FramePace

from .conftest import play

pytestmark = pytest.mark.filterwarnings("ignore:RRD file has no footer")
CURVES = [f"/{line.entity}" for line in (LIFT, LAW, VELOCITY, ACCELERATION, FORCE, ZERO)]
#: Shortest time (s) of the curves that are sent together in these tests, so that the small run is
#: sent in several parts ("windows").
MIN_WINDOW_S = 0.2


def show(bag, address, flush=False):
    """Pass the small run to a live view as fast as possible."""
    picture = LiveView(bag.loaded, address)
    for _ in play(picture, bag):
        if flush:
            picture.flush()
    picture.close()


@pytest.fixture(scope="module")
def arrived(bag, tmp_path_factory):
    """Chunks (parts) of a live view's recording, as received by a server.

    They are in the order of arrival.
    """
    path, port = tmp_path_factory.mktemp("live") / "live.rrd", find_free_port()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(live, "MIN_WINDOW_S", MIN_WINDOW_S)
        arguments = ("--serve-grpc", "--port", str(port), "--save", str(path))
        with listening(*arguments, ports=(port,)):
            show(bag, stream_address(port))
            while not (chunks := written(path, bag.samples[0, -1])):
                time.sleep(0.05)
    return chunks


def times_of(parts):
    """Return the sorted times (ns) of each entity in all parts of a recording."""
    readers, by_entity = [RrdReader(part) for part in parts], dict[str, list[int]]()
    assert len({str(recording) for reader in readers for recording in reader.recordings()}) == 1
    for chunk in (chunk for reader in readers for chunk in reader.stream().to_chunks()):
        batch, times = chunk.to_record_batch(), by_entity.setdefault(chunk.entity_path, [])
        if "rig_time" in batch.schema.names:
            times += batch.column("rig_time").cast("int64").to_pylist()
    return {path: sorted(times) for path, times in by_entity.items()}


def test_a_long_recording_is_written_in_parts(bag, tmp_path, monkeypatch):
    """The files of a long recording together contain the data of a single file."""
    monkeypatch.setattr(live, "MIN_WINDOW_S", MIN_WINDOW_S)
    monkeypatch.setattr(page_module, "KEPT_PARTS", 10_000)
    folders = []
    for max_part in (1 << 30, 1 << 12):
        monkeypatch.setattr(page_module, "MAX_PART", max_part)
        folders.append(tmp_path / str(max_part))
        folders[-1].mkdir()
        show(bag, str(folders[-1]), flush=True)
    single, many = (sorted(folder.glob("*.rrd")) for folder in folders)
    assert (len(single), len(many) > 3) == (1, True)
    whole, parts = (times_of(paths) for paths in (single, many))
    assert set(parts) == set(whole)
    for curve in CURVES:
        assert parts[curve] == whole[curve] and whole[curve]


def written(path, end):
    """Return the chunks of a recording once it is complete, before that no chunk.

    It is complete if each curve reaches `end` (s) and the run is finished.
    """
    try:
        chunks = list(RrdReader(path).stream().to_chunks())
    except RuntimeError:  # the file ends within a chunk
        return []
    complete = {chunk.entity_path for chunk in chunks if newest(chunk) > end - 1e-3}
    is_over = any("finished" in words for words in results(chunks))
    return chunks if is_over and complete.issuperset(CURVES) else []


def results(chunks):
    """Return the headings of the table of results in recording chunks, by time."""
    texts = rows(chunks, "/results", "TextDocument:text")
    return [str(words[0]).partition("\n")[0] for _, words in texts if words]


def newest(chunk):
    """Return the newest rig time (s) in a chunk of a recording.

    It is −inf for a chunk without times, which applies to every time.
    """
    batch = chunk.to_record_batch()
    if "rig_time" not in batch.schema.names:
        return -np.inf
    return float(np.max(batch.column("rig_time").cast("int64").to_numpy())) * 1e-9


def test_the_cursor_stays_within_the_window_of_the_curves(bag, arrived):
    """No bar, picture, text or point of a live view is ahead of the curves.

    Curves are sent in windows, parts of 0.2 s here. The viewer's time cursor is at most one window
    ahead of the slowest curve.
    """
    reached, cursor, lead, others = dict.fromkeys(CURVES, 0.0), 0.0, 0.0, 0
    for chunk in arrived:
        if chunk.entity_path in reached:
            reached[chunk.entity_path] = max(reached[chunk.entity_path], newest(chunk))
        elif not chunk.entity_path.startswith("/plots/") and newest(chunk) > 0.0:
            others += 1
            assert newest(chunk) <= min(reached.values()) + 1e-3, chunk.entity_path
        cursor = max(cursor, newest(chunk))
        lead = max(lead, cursor - min(reached.values()))
    assert others > 20
    end = bag.samples[0, -1]
    assert end > 5.0 * MIN_WINDOW_S
    assert min(reached.values()) == pytest.approx(end, abs=1e-3)
    assert 0.0 < lead <= MIN_WINDOW_S + 1e-9


def test_the_results_report_the_state_of_the_run(arrived):
    """The heading of the viewer's results is "running" until the end, then "finished"."""
    heads = results(arrived)
    assert heads[-1] == "# Results, finished"
    assert set(heads[:-1]) == {"# Results, running"}


def test_a_change_of_cam_or_speed_clears_the_chart(bag, arrived):
    """At a change of cam or speed a turn chart gets a new caption and no old data."""
    changes = [state.time_ns for state in cam_states(bag.loaded.scene)][::4][:-1]
    captions = rows(arrived, "/turn/caption", "Points2D:labels")
    assert [time for time, _ in captions] == changes
    titles = [cam.title for cam in bag.loaded.cams.values()]
    named = [words[0] for _, words in captions]
    assert named == [f"{title}, {rpm} rpm" for title in titles for rpm in (300, 700)]
    readings = rows(arrived, "/scene_readings", "TextDocument:text")
    first_readings = [words[0] for time, words in readings if time in changes]
    assert len(first_readings) == 4
    assert all("mm" not in words and "rpm" in words for words in first_readings)
    curves = rows(arrived, "/turn/force/follower/0", "LineStrips2D:strips")
    assert [strips for time, strips in curves if time in changes[1:]] == [[], [], []]


def rows(chunks, entity, column):
    """Return (time in ns, value) of an entity's column in recording chunks, by time."""
    pairs = []
    for batch in (chunk.to_record_batch() for chunk in chunks if chunk.entity_path == entity):
        if "rig_time" in batch.schema.names and column in batch.schema.names:
            times = batch.column("rig_time").cast("int64").to_pylist()
            pairs += zip(times, batch.column(column).to_pylist(), strict=True)
    return sorted(pairs, key=lambda row: row[0])


def test_a_curve_has_two_points_per_position_of_the_screen():
    """A window of a live view's curves has at most a thousand buckets of samples.

    A window is the time whose curves are sent together, at least two ticks (intervals between cam
    states). Each bucket gives two points, as many as a screen can display.
    """
    assert live_window(0.1) == live.MIN_WINDOW_S and live_window(2.0) == 4.0
    for rate in (500.0, 12_000.0, 48_000.0):
        bucket = screen_bucket(2.0, rate)
        assert 2.0 * rate / bucket <= 1000.0 + 1e-9 or bucket == 1


def test_pictures_of_a_paced_run_are_sent_evenly_between_its_ticks(bag, monkeypatch):
    """At half real-time speed pictures are sent evenly, 20 per second.

    They are at most a tick (interval between cam states) and 0.35 s late, and never ahead of the
    curves.
    """
    now, factor = [100.0], 0.5
    sent = {}

    def record(_, entity, indexes, columns):
        times = [rr.TimeColumn.as_arrow_array(index).cast("int64").to_numpy() for index in indexes]
        sent.setdefault(entity, []).append((now[0], float(np.max(times[0])) / NS))

    monkeypatch.setattr(live, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(live, "FramePace", partial(FramePace, clock=lambda: now[0]))
    monkeypatch.setattr(live, "TIMEOUT_S", 0.1)
    monkeypatch.setattr(rr.RecordingStream, "send_columns", record)
    view = LiveView(bag.loaded, stream_address(find_free_port()))
    view.set_pace(factor)
    for state in play(view, bag):
        while now[0] < 100.0 + state.time_ns / NS / factor:
            now[0] += 1.0 / 60.0
            view.flush()
    wall, picture = np.array(sent["scene/rig/cam"]).T
    assert len(wall) > 20 and np.quantile(np.diff(wall), 0.9) <= 1.0 / 20.0 + 1e-6
    behind = wall - 100.0 - picture / factor
    assert behind.min() > 0.0 and behind.max() <= 0.2 + 0.35
    curve_wall, curve = np.array(sent[f"{LIFT.entity}"]).T
    reached = np.maximum.accumulate(curve)[np.searchsorted(curve_wall, wall, "right") - 1]
    assert (picture <= reached + 1e-3).all()
    with pytest.raises(CamRigError, match="the viewer has gone"):
        view.close()


# -- rate of the pictures: a page is not late for long and not slower than necessary

STEP_S = 0.25


class Page:
    """Simulated viewer page that draws `speed` pictures per second.

    It has a clock and a queue of pictures that are not yet drawn.
    """

    def __init__(self, speed):
        self.speed, self.now, self.waiting = speed, 0.0, 0.0
        self.pace = FramePace(self.behind, lambda: self.now)

    def behind(self):
        return self.waiting / self.speed

    def advance(self):
        """Send pictures if they are due, and draw some, in a step of wall-clock time."""
        self.now += STEP_S
        if self.pace.is_due():
            self.waiting += self.pace.chosen(1000).size
        self.waiting = max(0.0, self.waiting - self.speed * STEP_S)


@pytest.mark.parametrize("speed", [1.5, 3.0, 7.0, 20.0])
def test_a_slow_page_is_never_late_for_long(speed):
    """A slow viewer page is at most 2 s late in 15 minutes.

    On average at least half of the pictures that it can draw are sent.
    """
    page, late, rates = Page(speed), 0.0, list[float]()
    for _ in range(int(900 / STEP_S)):
        page.advance()
        late = max(late, page.behind())
        rates.append(page.pace.rate)
    assert late <= 2.0 + STEP_S
    assert min(rates) >= timeline.MIN_RATE and max(rates) <= timeline.MAX_RATE
    assert np.mean(rates) >= 0.5 * speed


def test_the_rate_follows_a_page_that_is_slow_for_a_while():
    """The rate of pictures falls while the page is slow, and then rises again.

    For one minute the page draws only two pictures per second.
    """
    page = Page(60.0)
    slow = dict.fromkeys(range(60, 120), 2.0)
    rates = {}
    for i in range(int(240 / STEP_S)):
        page.speed = slow.get(int(i * STEP_S), 60.0)
        page.advance()
        rates[i * STEP_S] = page.pace.rate
    assert rates[59.0] == timeline.MAX_RATE
    assert max(rate for at, rate in rates.items() if 80.0 < at < 120.0) <= 5.0
    assert rates[239.0] == timeline.MAX_RATE


def test_the_rate_is_constant_if_the_delay_is_unknown():
    """The rate of pictures is constant if the delay of the viewer's page is unknown.

    It is constant also for a page that is neither late nor in time, and for a native window.
    """
    now, between = [0.0], 0.5 * (timeline.LATE_S + timeline.IN_TIME_S) + 1.0 / timeline.MIN_RATE
    for behind, rate in (
        (lambda: between, timeline.MIN_RATE),
        (None, timeline.MAX_RATE),
        (lambda: None, timeline.MIN_RATE),
    ):
        pace = FramePace(behind, lambda: now[0])
        assert pace.rate == rate
        for now[0] in np.arange(0.0, 100.0, 0.25):
            pace.is_due()
        assert pace.rate == rate


def test_no_more_pictures_are_sent_than_a_screen_displays():
    """The viewer's pictures are limited to the rate that a screen displays.

    Their number follows from the time since the last pictures. The newest picture is always sent.
    """
    now = iter([0.0, 0.1, 0.1, 10.0])
    pace = FramePace(None, lambda: next(now))
    assert pace.chosen(100).size == 3 and pace.chosen(100).tolist() == [99]
    assert pace.chosen(100).tolist() == list(range(100))
