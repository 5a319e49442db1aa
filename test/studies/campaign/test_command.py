"""Tests of `cam-rig campaign`: tables, files, figures, errors and resumption.

A campaign is a batch of simulations with varied inputs, described by a study file.
"""

import json
import signal
import subprocess
import sys
from contextlib import contextmanager
from functools import partial

import duckdb
import numpy as np
import pytest
from ruamel.yaml import YAML

from cam_rig.schema.load import config_root
from cam_rig.show.result import NULL_PROGRESS
from cam_rig.studies.campaign import command as module
from cam_rig.studies.campaign.campaign import BatchRows, measure_batch, open_campaign
from cam_rig.studies.campaign.command import CampaignProgress
from cam_rig.studies.campaign.dataset import CampaignDataset

from ...cli import conftest as cli
from ...processes import until

call, done = (partial(one, "campaign") for one in (cli.call, cli.done))
shipped = partial(cli.load, "campaigns")


@pytest.fixture
def study(tmp_path):
    """Function that writes a shipped campaign file with changed entries.

    It returns the path.
    """

    def write(name="tolerance_poly345", **parts):
        path = tmp_path / "campaigns" / "study.yaml"
        path.parent.mkdir(exist_ok=True)
        with path.open("w", encoding="utf-8") as file:
            YAML(typ="safe").dump(shipped(name) | parts, file)
        return path

    return write


@pytest.mark.variants(1)
@pytest.mark.parametrize("name", ["jump_map", "tolerance_poly345", "noise_map"])
def test_shipped_studies_run_and_draw(study, tmp_path, name):
    """Each shipped campaign, with few points, writes Parquet, JSON, CSV and a figure."""
    data, out = shipped(name), tmp_path / "rows"
    for variation in data["vary"].values():
        if "count" in variation:
            variation["count"] = 2
    arguments = ["--points", 8] if data["plan"]["kind"] == "sobol" else []
    plot, csv = tmp_path / "a.png", tmp_path / "a.csv"
    written = ["--out", out, "--plot", plot, "--csv", csv, "--json", "-"]
    result = done(study(name, vary=data["vary"]), "--jobs", 1, *arguments, *written)
    data_written = json.loads(result.stdout)
    counted = duckdb.sql(f"select count(*), min(status) from '{out}/*.parquet'").fetchall()
    assert counted == [(data_written["campaign"]["points"], "ok")]
    assert data_written["campaign"]["failed"] == 0
    assert plot.read_bytes().startswith(b"\x89PNG")
    first = "quantiles" if arguments else "extremes"
    assert csv.read_text(encoding="utf-8").split("\n")[0] == ",".join(data_written[first][0])
    assert data["title"] in result.stderr


CAMPAIGN = [sys.executable, "-m", "cam_rig.cli.main", "campaign"]


@contextmanager
def started(command, **options):
    """Start a process and kill it when the context ends."""
    with subprocess.Popen(command, **options) as process:
        try:
            yield process
        finally:
            process.kill()


SPREAD = {"uniform": 1, "unit": "um"}


def wavy(wavelength):
    """Return the `vary` entry of a waviness of 2 µm with a varied wavelength (°)."""
    return {
        "vary": {
            "profile.waviness.amplitude": {"values": [2], "unit": "um"},
            "profile.waviness.wavelength": wavelength | {"unit": "deg"},
        }
    }


BAD = (
    ({"vary": {"rig.follower.preloda": {"uniform": 1, "unit": "N"}}}, "did you mean"),
    ({"vary": {"rig.follower.preload": {"uniform": -1, "unit": "N"}}}, "greater than or equal"),
    (
        {"vary": {"rig.follower.preload": {"uniform": 1, "unit": "kg"}}},
        "the unit must be one of %, N",
    ),
    ({"vary": {"rig.follower.preload": {"uniform": 1, "unit": "bar"}}}, "must be % or one of"),
    ({"vary": {"rig.follower.preload": {"unit": "N"}}}, "exactly one of"),
    ({"vary": {"rig.follower.preload": {"range": [2, 1], "unit": "N"}}}, "rising"),
    (
        {"vary": {"profile.waviness.amplitude": {"uniform": 1, "unit": "um"}}},
        "requires profile",
    ),
    ({"vary": {"profile.size": {"uniform": 1, "unit": "%"}}}, "0 in the base"),
    ({"vary": {"profile.size.amplitude": SPREAD}}, "did you mean 'profile.size'?"),
    ({"vary": {"profile.eccentricity": SPREAD}}, "one of profile.eccentricity.amplitude, "),
    (wavy({"values": [0]}), "must be between 0.1 and 360 deg, got 0"),
    (wavy({"normal": 1, "mean": 500}), "must be between 0.1 and 360 deg, got 500"),
    ({"measures": ["sound_level@1e9rpm"], "limits": []}, "must be between 0.01 and 100000 rpm"),
    ({"measures": ["sound_level"], "limits": []}, "has no speed or angle"),
    ({"measures": ["residual_vibration@300rpm"], "limits": []}, "'residual_vibration_steady'"),
    ({"measures": ["jump_speed", "jump_speed"], "limits": []}, "is repeated"),
    ({"limits": ["twist@300rpm<=1deg"]}, "a limit must be on one of the measures"),
    ({"plan": {"kind": "sobol", "points": 10**12}}, "may have at most 1e8 points, got 1e12"),
    ({"plan": {"kind": "sobol", "points": 0}}, "plan.points"),
    ({"plan": {"kind": "shares", "points": 9}}, "a power of 2"),
    ({"plan": {"kind": "grid"}}, "must have values, or a range"),
    ({"base": {"cam": "poly345"}}, "requires a scene, or a cam and a rig"),
    ({"base": {"cam": "My Cam", "rig": "tm21"}}, "or the path of a .yaml file"),
    ({"base": {"cam": "mine/none.yaml", "rig": "tm21"}}, "mine/none.yaml: no such file"),
)


def test_bad_studies_are_refused_in_one_line(study, tmp_path):
    """An invalid campaign file ends with exit code 2 and one line.

    The line has the wrong key or value. No output folder is created.
    """
    for parts, words in BAD:
        result = call(study(**parts), "--out", tmp_path / "rows")
        assert (result.exit_code, result.stderr.count("\n")) == (2, 1), words
        assert words in result.stderr
        assert not (tmp_path / "rows").exists()


@pytest.mark.long
def test_a_campaign_without_a_valid_point_fails_with_the_reason(study, tmp_path):
    """A campaign in which every point is invalid fails with the reason and its count.

    If only some points are invalid, the campaign succeeds and lists the reason in its JSON.
    """
    mass, out = {"range": [-3, -1], "unit": "kg"}, tmp_path / "rows"
    parts = {"plan": {"kind": "sobol", "points": 8}, "measures": ["jump_speed_rigid"], "limits": []}
    path = study(vary={"rig.follower.mass": mass}, **parts)
    failed = call(path, "--out", out, "--jobs", 1)
    assert failed.exit_code == 1
    assert "8 of 8 points could not be computed: follower.mass: is -" in failed.stderr
    assert "allowed: greater than 0 kg (8)" in failed.stderr
    assert failed.stderr.count("\n") == 1
    path = study(vary={"rig.follower.mass": mass | {"range": [-1, 3]}}, **parts)
    some = done(path, "--out", tmp_path / "some", "--jobs", 1, "--json", "-")
    assert "2 of 8 points could not be computed: follower.mass: is" in some.stderr
    (reason,) = json.loads(some.stdout)["reasons"]
    assert (reason["points"], "greater than 0 kg" in reason["reason"]) == (2, True)


@pytest.mark.long
def test_a_cam_and_a_rig_by_their_paths(study, tmp_path):
    """A campaign that names cam and rig by file path gives the same rows as by name.

    A relative path is relative to the campaign file's folder. The error for a missing cam lists
    both paths searched.
    """
    folder_of_study = tmp_path / "campaigns" / "mine"
    folder_of_study.mkdir(parents=True)
    for folder, name in (("cams", "poly345"), ("rigs", "paper_table2")):
        text = (config_root() / folder / f"{name}.yaml").read_text(encoding="utf-8")
        (folder_of_study / f"{name}.yaml").write_text(text, encoding="utf-8")
    parts = {"plan": {"kind": "sobol", "points": 4}, "measures": ["jump_speed_rigid"], "limits": []}
    paths = {"cam": "mine/poly345.yaml", "rig": str(folder_of_study / "paper_table2.yaml")}
    columns = []
    for name, base in (("own", paths), ("shipped", shipped("tolerance_poly345")["base"])):
        path = study(base=base, **parts)
        done(path, "--out", tmp_path / name, "--jobs", 1)
        dataset = CampaignDataset(tmp_path / name, open_campaign(path))
        columns.append(dataset.column("jump_speed_rigid_rpm").tolist())
    assert columns[0] == columns[1]
    missing = call(study(base={"cam": "mine", "rig": "tm21"}, **parts))
    assert f"{tmp_path}/cams/mine.yaml, {config_root()}/cams/mine.yaml: no such" in missing.stderr


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_resume_completes_an_interrupted_campaign(study, tmp_path, number):
    """A campaign that is stopped by a signal and then resumed has the same rows.

    They are compared with those of an uninterrupted run. After SIGINT and SIGTERM the last line
    states the command that continues it.
    """
    path, out = study(plan={"kind": "sobol", "points": 32, "seed": 2}), tmp_path / "rows"
    arguments = [str(path), "--jobs", "1", "--out", str(out)]
    with started([*CAMPAIGN, *arguments], stderr=subprocess.PIPE, text=True) as run:
        until(lambda: list(out.glob("*.parquet")))
        run.send_signal(number)
        _, words = run.communicate(timeout=100)
    dataset = CampaignDataset(out, open_campaign(path))
    assert 0 < len(dataset.column("point")) < 32
    if number != signal.SIGKILL:
        assert run.returncode == 128 + number
        assert "leaked" not in words and "Traceback" not in words
        assert "continue with: cam-rig campaign" in words.strip().splitlines()[-1]
        assert "--resume" in words
    done(path, "--out", out, "--resume", "--jobs", 1)
    whole = tmp_path / "whole"
    done(path, "--out", whole, "--jobs", 2)
    other = CampaignDataset(whole, dataset.campaign)
    for name in ("point", "rig_follower_preload", "jump_speed_rpm"):
        assert dataset.column(name).tolist() == other.column(name).tolist()


@pytest.mark.long
@pytest.mark.slow
def test_a_lost_scheduler_ends_the_run_with_one_line(study, tmp_path):
    """If the Dask scheduler is killed, the command ends with exit code 1.

    One line states the loss and the command that continues. The finished points are kept.
    """
    path, out = study(plan={"kind": "sobol", "points": 400, "seed": 2}), tmp_path / "rows"
    file = tmp_path / "scheduler.json"
    arguments = ["--scheduler-file", str(file), "--no-dashboard"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    python = [sys.executable, "-m"]
    with started(
        [
            *python,
            "distributed.cli.dask_scheduler",
            *arguments,
            "--host",
            "127.0.0.1",
            "--port",
            "0",
        ],
        **quiet,
    ) as scheduler:
        until(file.exists)
        with started(
            [*python, "distributed.cli.dask_worker", *arguments, "--nthreads", "1"], **quiet
        ):
            command_arguments = [str(path), "--out", str(out), "--dask", str(file)]
            with started([*CAMPAIGN, *command_arguments], stderr=subprocess.PIPE, text=True) as run:
                until(lambda: list(out.glob("*.parquet")))
                scheduler.kill()
                _, words = run.communicate(timeout=100)
    assert run.returncode == 1
    assert "the scheduler is gone" in words
    assert "continue with: cam-rig campaign" in words
    assert words.count("cam-rig: ") == 1 and "Traceback" not in words
    assert len(CampaignDataset(out, open_campaign(path)).column("point")) > 0


def test_a_folder_with_rows_is_not_overwritten(study, tmp_path):
    """A campaign folder with rows is accepted only with --resume.

    The study must be unchanged. The error states which number of the plan differs.
    """
    path, out = study(plan={"kind": "sobol", "points": 2}), tmp_path / "rows"
    dataset = CampaignDataset(out, open_campaign(path))
    with dataset.open(False):
        dataset.write(measure_batch(dataset.campaign, 0, 2))
    assert "--resume to continue" in call(path, "--out", out).stderr
    other = call(path, "--out", out, "--resume", "--seed", 9)
    assert "is of another study" in other.stderr
    assert "plan.seed is 9, was 1; allowed" in other.stderr
    assert other.exit_code == 2
    assert "plan.points is 5, was 2;" in call(path, "--out", out, "--resume", "--points", 5).stderr


@pytest.fixture
def batches(study, tmp_path):
    """Dataset of a campaign of 1000 points, and a function that adds rows to it.

    The function writes random jump speeds for a range of points.
    """
    plan = {"kind": "sobol", "points": 1000}
    path = study(plan=plan, measures=["jump_speed_rigid"], limits=[])
    dataset = CampaignDataset(tmp_path / "rows", open_campaign(path))
    random = np.random.default_rng(1)

    def write(first, last):
        inputs = dataset.campaign.draws.rows(first, last)
        speeds = random.uniform(400.0, 500.0, (last - first, 1))
        dataset.write(BatchRows(first, last, 1.0, inputs, speeds, ("",) * (last - first)))

    return dataset, write


def test_the_log_line_has_rate_time_left_and_size(batches, monkeypatch):
    """The periodic log line has the number of points, rate, time left and file size.

    The rate excludes the first batch, which includes the start of the workers. Here 50 points in 20
    s are 2.5 points/s, and the remaining 940 points need 376 s.
    """
    (dataset, write), now, lines = batches, [0.0], []
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(module, "say", lines.append)
    with dataset.open(False):
        progress = CampaignProgress(dataset, NULL_PROGRESS)
        for time_, first, last in ((1.0, 0, 10), (9.0, 10, 30), (21.0, 30, 60), (30.0, 60, 80)):
            write(first, last)
            now[0] = time_
            progress.advance(last - first)
    (line,) = lines
    name = dataset.campaign.config.name
    assert line.startswith(f"{name}: 60 of 1000 points, 2.5 points/s, 6.3 min left, ")
    assert " of about " in line


def test_the_final_size_is_extrapolated(batches):
    """The final size of a campaign's files is estimated from the first batches.

    A batch is a group of points. The error is below 20 %.
    """
    dataset, write = batches
    with dataset.open(False):
        for first, last in ((0, 1), (1, 101), (101, 201)):
            write(first, last)
        _, about = dataset.size()
        for first in range(201, 1000, 100):
            write(first, min(first + 100, 1000))
        whole, same = dataset.size()
    assert whole == same == sum(path.stat().st_size for path in dataset.folder.glob("*.parquet"))
    assert about == pytest.approx(whole, rel=0.2)
