"""Tests of the export of a run: every sample with its cam, in each file format."""

import itertools
import tracemalloc

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from scipy.io import wavfile

import cam_rig
from cam_rig.bag import reader
from cam_rig.errors import ConfigError, OutputError
from cam_rig.messages import topics
from cam_rig.simulation import export as exporting
from cam_rig.simulation.export import COLUMNS, FORMATS, export
from cam_rig.simulation.simulate import simulate_ticks
from cam_rig.units import TURN

from ..conftest import GOLDEN

NUMBERS = [column.name for column in COLUMNS]


def read(path):
    """Return the columns of an exported file, read by pandas, pyarrow or NumPy."""
    if path.suffix == ".csv":
        return pd.read_csv(path)
    if path.suffix == ".parquet":
        return pq.read_table(path).to_pandas()
    with np.load(path) as archive:
        return pd.DataFrame({name: archive[name] for name in ["cam", *NUMBERS]})


@pytest.fixture(scope="module")
def run():
    """Run that is read from the golden bag, the reference recording in bags/golden."""
    return cam_rig.read_bag(GOLDEN)


@pytest.mark.parametrize("ending", [".csv", ".parquet", ".npz"])
def test_a_file_contains_every_sample_with_all_digits(tmp_path, run, ending):
    """A file contains each sample of the run with all digits, its cam and its speed.

    Other libraries read the CSV, Parquet and NumPy files.
    """
    run.export(tmp_path / f"all{ending}")
    table = read(tmp_path / f"all{ending}")
    ticks = list(run.blocks())
    for column, name in (("lift", "lift_m"), ("force", "force_N"), ("time", "time_s")):
        expected = np.concatenate([getattr(tick, column) for tick in ticks])
        np.testing.assert_array_equal(table[name], expected)
    assert list(dict.fromkeys(table["cam"])) == ["tm21", "bezier15"]
    steady = [c for c, _ in itertools.groupby(table["rpm"])]
    assert steady == [200.0, 300.0, 350.0, 400.0] * 2


def test_the_exported_angle_belongs_to_the_exported_lift(tmp_path, run):
    """In contact the exported lift is the law at the exported angle, to 1e-14 m.

    The columns angle_rad and angle_in_turn_rad differ by whole turns.
    """
    run.export(tmp_path / "a.npz")
    table = read(tmp_path / "a.npz")
    for cam, rows in table.groupby("cam"):
        in_contact = rows[rows["force_N"] > 0.0]
        law = run.loaded.laws[cam]
        error = law(in_contact["angle_in_turn_rad"].to_numpy()) - in_contact["lift_m"]
        assert np.abs(error).max() < 1e-14
    with np.load(tmp_path / "a.npz", allow_pickle=False) as archive:
        assert (str(archive["scene"]), str(archive["sample_rate_Hz"])) == ("quick", "1000")
    turns = (table["angle_rad"] - table["angle_in_turn_rad"]) / TURN
    assert np.abs(turns - np.round(turns)).max() < 1e-9
    assert table["angle_in_turn_rad"].between(0.0, TURN, inclusive="left").all()


def test_the_parquet_schema_contains_units(tmp_path, run):
    """A Parquet file contains the units of its columns and the sample rate."""
    run.export(tmp_path / "a.parquet")
    schema = pq.read_schema(tmp_path / "a.parquet")
    assert schema.field("force_N").metadata[b"unit"] == b"N"
    assert schema.field("acceleration_m_s2").metadata[b"unit"].decode() == "m/s²"
    assert schema.metadata[b"sample_rate_Hz"] == b"1000"
    assert schema.names[:3] == ["time_s", "cam", "rpm"]


def test_a_wav_has_one_channel_per_quantity(tmp_path, run):
    """A WAV file has one channel per quantity, in SI as 32-bit floats.

    Its comment lists the channels.
    """
    path = tmp_path / "a.wav"
    run.export(path)
    rate, data = wavfile.read(path)
    assert rate == 1000 and data.dtype == np.float32
    names = [NUMBERS[i] for i in exporting.CHANNELS]
    force = np.concatenate([tick.force for tick in run.blocks()])
    np.testing.assert_array_equal(data[:, names.index("force_N")], force.astype(np.float32))
    assert b"lift_m [m], velocity_m_s [m/s]" in path.read_bytes()[:600]
    assert path.stat().st_size == 8 + int.from_bytes(path.read_bytes()[4:8], "little")


def test_export_of_one_cam_at_one_speed(tmp_path, run):
    """`export` with cam and speed writes only their samples.

    Cam and speed that are not in the run are an error that lists those of the run. An unknown kind
    of file is an error too.
    """
    run.export(tmp_path / "a.csv", cam="tm21", rpm=400)
    table = read(tmp_path / "a.csv")
    assert set(table["cam"]) == {"tm21"} and set(table["rpm"]) == {400.0}
    np.testing.assert_array_equal(table["force_N"], run.samples("tm21", 400).force)
    with pytest.raises(ConfigError, match=r"no samples of tm21 at 360 rpm; allowed: tm21 at 200"):
        run.export(tmp_path / "b.csv", cam="tm21", rpm=360)
    with pytest.raises(ConfigError, match=r"run.txt: unknown kind of file; allowed: .parquet, "):
        run.export(tmp_path / "run.txt")
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]


def lossy(lost):
    """Return a reader of bag messages that skips some messages.

    `lost` contains pairs (topic, index of the message in the topic).
    """
    all_messages = reader.messages

    def messages(*arguments):
        counts = {}
        for topic, time, message in all_messages(*arguments):
            number = counts[topic] = counts.get(topic, -1) + 1
            if (topic, number) not in lost:
                yield topic, time, message

    return messages


@pytest.mark.parametrize("ending", FORMATS)
def test_lost_messages_are_gaps(tmp_path, run, monkeypatch, ending):
    """Samples of lost messages are missing in an export.

    All other samples keep their angles. The samples between two cam states are a tick. A lost cam
    state between two states of one speed has no effect. A lost state at a change of speed removes
    the ticks before and after it. A WAV file cannot have gaps, and is not written.
    """
    complete = {tick.time[0]: tick.angle for tick in run.blocks()}
    lost = {(topics.FOLLOWER_SAMPLES, 5), (topics.CAM_STATE, 1), (topics.CAM_STATE, 8)}
    monkeypatch.setattr(reader, "messages", lossy(lost))
    ticks = list(run.blocks())
    assert len(ticks) == 16 - 3
    for tick in ticks:
        np.testing.assert_allclose(tick.angle, complete[tick.time[0]], rtol=0, atol=1e-6)
    path = tmp_path / f"a{ending}"
    if ending == ".wav":
        with pytest.raises(OutputError, match=r"no samples from 1.\d+ to .* s; allowed: a sound"):
            run.export(path)
        assert not path.exists()
        return
    contents = export(path, run.blocks(), run.loaded)
    assert contents.gaps == 2
    assert contents.rows == sum(tick.time.size for tick in ticks) == len(read(path))


@pytest.mark.variants(3)
@pytest.mark.parametrize("ending", FORMATS)
def test_memory_does_not_grow_with_the_run(tmp_path, make_loaded_scene, monkeypatch, ending):
    """The export of a run ten times as long needs about the same memory.

    The growth is below a fifth of the additional samples.
    """
    monkeypatch.setattr(exporting, "CHUNK_ROWS", 1000)
    peaks = []
    for turns in (4, 4, 40):  # the first run imports libraries
        loaded = make_loaded_scene(speeds=[60], turns=turns, sample_rate=1000, cams=["poly345"])
        tracemalloc.start()
        contents = export(tmp_path / f"a{ending}", simulate_ticks(loaded), loaded)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert contents.rows == turns * 1000
    assert peaks[2] < peaks[1] + 0.2 * 36_000 * 8 * len(NUMBERS)


def test_a_wav_larger_than_its_format_is_an_error(tmp_path, run, monkeypatch):
    """A WAV file above 4 GiB, the limit of its format, is refused with a remedy."""
    monkeypatch.setattr(exporting, "MAX_BYTES", 10_000)
    with pytest.raises(
        OutputError, match=r"more than 4 GiB; allowed: less in a WAV file, so select"
    ):
        run.export(tmp_path / "a.wav")
