"""What a viewer that follows a run has got at every moment: nothing is ahead of the curves."""

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
from cam_rig.viewer.process import free_port, listening, stream_address
from cam_rig.viewer.quantities import ACCELERATION_LINE as ACCELERATION
from cam_rig.viewer.quantities import FORCE_LINE as FORCE
from cam_rig.viewer.quantities import LAW, ZERO
from cam_rig.viewer.quantities import LIFT_LINE as LIFT
from cam_rig.viewer.quantities import VELOCITY_LINE as VELOCITY
from cam_rig.viewer.recording import LiveView, live_window, screen_bucket
from cam_rig.viewer.timeline import FramePace

from .conftest import told

pytestmark = pytest.mark.filterwarnings("ignore:RRD file has no footer")
CURVES = [f"/{line.entity}" for line in (LIFT, LAW, VELOCITY, ACCELERATION, FORCE, ZERO)]
#: So short that the small run is several of them.
MIN_WINDOW_S = 0.2


def show(bag, address, flush=False):
    """The small run as its nodes would tell it, as fast as it can be drawn."""
    picture = LiveView(bag.loaded, address)
    for _ in told(picture, bag):
        if flush:
            picture.flush()
    picture.close()


@pytest.fixture(scope="module")
def arrived(bag, tmp_path_factory):
    """The pieces of a live picture in the order in which Rerun's own server took them."""
    path, port = tmp_path_factory.mktemp("live") / "live.rrd", free_port()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(live, "MIN_WINDOW_S", MIN_WINDOW_S)
        arguments = ("--serve-grpc", "--port", str(port), "--save", str(path))
        with listening(*arguments, ports=(port,)):
            show(bag, stream_address(port))
            while not (chunks := written(path, bag.samples[0, -1])):
                time.sleep(0.05)
    return chunks


def times_of(parts):
    """Rig times (ns) of everything in the parts of one recording."""
    readers, found = [RrdReader(part) for part in parts], dict[str, list[int]]()
    assert len({str(recording) for reader in readers for recording in reader.recordings()}) == 1
    for chunk in (chunk for reader in readers for chunk in reader.stream().to_chunks()):
        batch, times = chunk.to_record_batch(), found.setdefault(chunk.entity_path, [])
        if "rig_time" in batch.schema.names:
            times += batch.column("rig_time").cast("int64").to_pylist()
    return {path: sorted(times) for path, times in found.items()}


def test_a_long_picture_goes_on_in_parts(bag, tmp_path, monkeypatch):
    """Put together they are the same recording as in one: nothing is lost where a part ends."""
    monkeypatch.setattr(live, "MIN_WINDOW_S", MIN_WINDOW_S)
    monkeypatch.setattr(page_module, "KEPT_PARTS", 10_000)
    folders = []
    for most in (1 << 30, 1 << 12):
        monkeypatch.setattr(page_module, "MAX_PART", most)
        folders.append(tmp_path / str(most))
        folders[-1].mkdir()
        show(bag, str(folders[-1]), flush=True)
    one, many = (sorted(folder.glob("*.rrd")) for folder in folders)
    assert (len(one), len(many) > 3) == (1, True)
    whole, parts = (times_of(paths) for paths in (one, many))
    assert set(parts) == set(whole)
    for curve in CURVES:
        assert parts[curve] == whole[curve] and whole[curve]


def written(path, end):
    """What the server has written, once every curve is at its end (s) and the run is over."""
    try:
        chunks = list(RrdReader(path).stream().to_chunks())
    except RuntimeError:  # it ends in the middle of what is being written
        return []
    there = {chunk.entity_path for chunk in chunks if newest(chunk) > end - 1e-3}
    over = any("finished" in words for words in results(chunks))
    return chunks if over and there.issuperset(CURVES) else []


def results(chunks):
    """The heads of the table of results, in their order."""
    found = rows(chunks, "/results", "TextDocument:text")
    return [str(words[0]).partition("\n")[0] for _, words in found if words]


def newest(chunk):
    """The newest rig time (s) in a piece, none where it holds at every time."""
    batch = chunk.to_record_batch()
    if "rig_time" not in batch.schema.names:
        return -np.inf
    return float(np.max(batch.column("rig_time").cast("int64").to_numpy())) * 1e-9


def test_nothing_leads_the_curves_by_more_than_is_shown(bag, arrived):
    """Neither the cursor, by more than the window, nor bars, pictures, words and points at all."""
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


def test_the_results_say_whether_the_run_goes_on(arrived):
    """Running up to the last, which says finished."""
    heads = results(arrived)
    assert heads[-1] == "# Results, finished"
    assert set(heads[:-1]) == {"# Results, running"}


def test_nothing_of_a_cam_stands_beside_the_next(bag, arrived):
    """From the state on at which it turns, its caption stands, without a reading or a curve."""
    changes = [state.time_ns for state in cam_states(bag.loaded.scene)][::4][:-1]
    captions = rows(arrived, "/turn/caption", "Points2D:labels")
    assert [time for time, _ in captions] == changes
    titles = [cam.title for cam in bag.loaded.cams.values()]
    named = [words[0] for _, words in captions]
    assert named == [f"{title}, {rpm} rpm" for title in titles for rpm in (300, 700)]
    readings = rows(arrived, "/scene_readings", "TextDocument:text")
    begun = [words[0] for time, words in readings if time in changes]
    assert len(begun) == 4
    assert all("mm" not in words and "rpm" in words for words in begun)
    curves = rows(arrived, "/turn/force/follower/0", "LineStrips2D:strips")
    assert [strips for time, strips in curves if time in changes[1:]] == [[], [], []]


def rows(chunks, entity, column):
    """Rig times (ns) of an entity and what a column has there, in order of time."""
    found = []
    for batch in (chunk.to_record_batch() for chunk in chunks if chunk.entity_path == entity):
        if "rig_time" in batch.schema.names and column in batch.schema.names:
            times = batch.column("rig_time").cast("int64").to_pylist()
            found += zip(times, batch.column(column).to_pylist(), strict=True)
    return sorted(found, key=lambda row: row[0])


def test_a_curve_has_two_points_a_place_of_the_screen():
    """A thousand places across the window, one sample at least; a window has two ticks."""
    assert live_window(0.1) == live.MIN_WINDOW_S and live_window(2.0) == 4.0
    for rate in (500.0, 12_000.0, 48_000.0):
        bucket = screen_bucket(2.0, rate)
        assert 2.0 * rate / bucket <= 1000.0 + 1e-9 or bucket == 1


def test_pictures_of_a_paced_run_come_evenly_between_its_ticks(bag, monkeypatch):
    """At half real time 20 a second or more, a tick and 0.35 s behind the drive at most."""
    now, factor = [100.0], 0.5
    sent = {}

    def note(_, entity, indexes, columns):
        times = [rr.TimeColumn.as_arrow_array(index).cast("int64").to_numpy() for index in indexes]
        sent.setdefault(entity, []).append((now[0], float(np.max(times[0])) / NS))

    monkeypatch.setattr(live, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(live, "FramePace", partial(FramePace, clock=lambda: now[0]))
    monkeypatch.setattr(live, "TIMEOUT_S", 0.1)
    monkeypatch.setattr(rr.RecordingStream, "send_columns", note)
    view = LiveView(bag.loaded, stream_address(free_port()))
    view.set_pace(factor)
    for state in told(view, bag):
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


# -- how much is sent to a page: never late for long, never needlessly slow -------------------

STEP_S = 0.25


class Page:
    """A page that draws so many pictures a second, its clock, and what waits for it."""

    def __init__(self, speed):
        self.speed, self.now, self.waiting = speed, 0.0, 0.0
        self.pace = FramePace(self.behind, lambda: self.now)

    def behind(self):
        return self.waiting / self.speed

    def go_on(self):
        """So many pictures come in a step of wall time, and so many are drawn."""
        self.now += STEP_S
        if self.pace.is_due():
            self.waiting += self.pace.chosen(1000).size
        self.waiting = max(0.0, self.waiting - self.speed * STEP_S)


@pytest.mark.parametrize("speed", [1.5, 3.0, 7.0, 20.0])
def test_a_slow_page_is_never_late_for_long(speed):
    """Whatever it can draw: two seconds at most in a quarter of an hour; and it is used."""
    page, late, rates = Page(speed), 0.0, list[float]()
    for _ in range(int(900 / STEP_S)):
        page.go_on()
        late = max(late, page.behind())
        rates.append(page.pace.rate)
    assert late <= 2.0 + STEP_S
    assert min(rates) >= timeline.MIN_RATE and max(rates) <= timeline.MAX_RATE
    assert np.mean(rates) >= 0.5 * speed


def test_a_page_that_becomes_slower_is_sent_less_and_more_again():
    """Another program takes its time away for a minute; two pictures a second are left."""
    page = Page(60.0)
    slow = dict.fromkeys(range(60, 120), 2.0)
    rates = {}
    for i in range(int(240 / STEP_S)):
        page.speed = slow.get(int(i * STEP_S), 60.0)
        page.go_on()
        rates[i * STEP_S] = page.pace.rate
    assert rates[59.0] == timeline.MAX_RATE
    assert max(rate for at, rate in rates.items() if 80.0 < at < 120.0) <= 5.0
    assert rates[239.0] == timeline.MAX_RATE


def test_a_late_page_is_given_time_to_show_a_slower_rate():
    """Its delay is of what was sent before: once it is late, the rate falls once per while."""
    page = Page(60.0)
    while page.pace.rate < timeline.MAX_RATE:
        page.go_on()
    page.waiting = 60.0 * (timeline.LATE_S + 0.5)
    page.speed, changes = 60.0, list[tuple[float, float]]()
    for _ in range(int(timeline.SETTLE_S / STEP_S)):
        before = page.pace.rate
        page.go_on()
        page.waiting = 60.0 * (timeline.LATE_S + 0.5)
        if page.pace.rate != before:
            changes.append((before, page.pace.rate))
    assert len(changes) == 1
    assert changes[0][1] <= 0.5 * changes[0][0]


def test_where_nobody_knows_the_delay_the_rate_stays():
    """Of a page that shows nothing yet, or is neither late nor in time; a window gets every one."""
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


def test_no_more_pictures_are_sent_than_a_screen_shows():
    """Of many as many as fit into the time since the last, evenly, the newest always."""
    now = iter([0.0, 0.1, 0.1, 10.0])
    pace = FramePace(None, lambda: next(now))
    assert pace.chosen(100).size == 3 and pace.chosen(100).tolist() == [99]
    assert pace.chosen(100).tolist() == list(range(100))
