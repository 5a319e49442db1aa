"""Errors on the command lines of the studies: one line on stderr, and no file."""

import pytest

from ..cli.conftest import GOLDEN, call
from .fit_cam.test_command import GL110

JERK = "design poly345 --minimise peak_jerk --pieces 6 --joints C2"
SHARED = "--keep dwells,lift"
TORQUE = "design poly345 --minimise shaft_torque@300rpm"
TABLE = "mass_kg,spring_N/mm,rpm\n0,2,336.8\n0,4.03,449.8\n0,8,622.6\n1,2,257.2\n1,8,469.7\n"
FIT = "fit rig jumps.csv poly345"
COMPARE = f"compare {GOLDEN} quick"
REFUSED = [
    ("bounce nothing", 2, "nothing"),
    (
        "bounce tm21 --basins --rpm 420,430",
        2,
        "--basins requires one speed, such as --rpm 420; got 2",
    ),
    ("bounce worked_example_constant_velocity", 2, "jump speed of 0 rpm"),
    ("bounce conjugate", 2, "conjugate"),
    ("bounce tm21 --rpm 400 --parameter mass --values x", 2, "--values must be 0.5, or 0.3,0.5"),
    ("bounce tm21 --rpm 400 --model two_mass --basins", 2, "--basins requires one mass"),
    ("campaign tolerance_poly345 --points 1e12", 2, "--points: is '1e12'; allowed: a whole number"),
    ("campaign tolerance_poly345 --points 1000000000", 2, "may have at most 1e8 points, got 1e9"),
    ("campaign tolerance_poly345 --jobs 0", 2, "--jobs: is '0'; allowed: greater than or"),
    ("campaign tolerance_poly345 --dask nowhere", 2, "allowed: an address"),
    (
        "campaign tolerance_poly345 --dask tcp://127.0.0.1:1 --jobs 2",
        2,
        "cannot be combined with --dask",
    ),
    (f"{COMPARE} --offset 3", 2, "an offset of 3° requires --topics"),
    (f"{COMPARE} --topics angle=/a&lift=/b", 2, "has cams tm21, bezier15; choose one with --cam"),
    (
        f"{COMPARE} --topics angle=/a&lift=/b --namespace x",
        2,
        "namespace cannot be combined with --topics",
    ),
    (f"{COMPARE} --topics angle=/a", 2, "must name the angle and at least one"),
    (f"{COMPARE} --cam tm12", 2, "has no cam 'tm12'; allowed: tm21, bezier15"),
    (f"{COMPARE} --save a.txt", 2, "a.txt: unknown kind of recording; allowed: .rrd"),
    (f"{COMPARE} --plot a.txt", 2, "unknown kind of picture"),
    ("design poly345", 2, "exactly one goal is required"),
    ("design poly345 --minimise jump_speed", 2, "use maximise, because"),
    ("design poly345 --maximise shaft_torque@300rpm", 2, "use minimise, because"),
    ("design poly345 --minimise peak_jerk --joints 3", 2, "joints must be C1 to C6, got '3'"),
    (
        "design poly345 --minimise peak_jerk --pieces 0",
        2,
        "pieces must be between 1 and 200, got 0",
    ),
    (
        "design bezier15 --minimise peak_jerk --keep dwells,lift",
        2,
        "requires a cam with two or more events",
    ),
    ("design flat --minimise pressure_angle", 2, "pressure angle does not depend on the law"),
    ("design tm21 --maximise jump_speed_steady --rig tm21", 2, "jump_speed_rigid"),
    ("design poly345 --maximise jump_speed --limit shaft_torque@300rpm<=6Nm", 2, "as a limit"),
    (f"{JERK} --keep dwells", 2, "keep must be events,dwells,lift or dwells,lift or"),
    (f"{JERK} --limit event_angle@1<=90deg", 2, "requires free events; use --keep"),
    (f"{JERK} --keep lift --limit event_angle@3<=90deg", 2, "has 2 events"),
    (
        f"{JERK} {SHARED} --limit event_angle@1<=90deg --limit event_angle@2<=90deg",
        2,
        "no spans of the events satisfy",
    ),
    (
        f"{JERK} {SHARED} --limit peak_acceleration<=20mm/rad^2 --starts 1",
        1,
        "no law was found at any of the spans",
    ),
    (f"{JERK} --limit radius_of_curvature>=80mm", 1, "a dwell of 'poly345' exceeds it for"),
    (f"{JERK} --limit shaft_torque@300rpm<=1Nm --starts 1", 1, "no law was found that satisfies"),
    (f"{JERK} --limit lift@150deg<=1mm", 1, "no law of the class satisfies"),
    (f"{JERK} --out a.yml", 2, "ends in .yaml"),
    (f"{JERK} --pareto peak_jerk --out a.yaml", 2, "cannot be combined with --out"),
    (f"{JERK} --pareto peak_jerk", 2, "must be another quantity than the goal"),
    (
        f"{JERK} --pareto peak_acceleration --points 2",
        2,
        "--points must be between 3 and 200, got 2",
    ),
    (f"{JERK} --pareto event_angle@1 {SHARED}", 2, "cannot be combined with --keep"),
    (f"{TORQUE} --starts 0", 2, "starts must be between 1 and"),
    (f"{TORQUE} --seed -1", 2, "seed must be 0 or above"),
    (f"{FIT} --fix mas=1", 2, "did you mean"),
    (f"{FIT} --fix mass=nan", 2, "--fix: mass must be a finite number in SI, got 'nan'"),
    (f"{FIT} --fix mass=1 --fix mass=2", 2, "--fix mass is repeated; remove one"),
    (f"{FIT} --fix mass=-1", 2, "mass must be between"),
    (f"{FIT} --topics angle=/a.b", 2, "--topics cannot be combined with a table"),
    (f"{FIT} --tolerance 0", 2, "--tolerance must be above 0 rpm"),
    (f"{FIT} --out rig.txt", 2, "yaml"),
    (f"{FIT} --csv - --json -", 2, "both write to stdout"),
    ("fit cam lifts.csv --out cam.txt", 2, "--out: is cam.txt; allowed: a name"),
    ("fit cam lifts.csv lifts.csv", 2, "2 files; allowed: one for a spline, several"),
    ("fit cam lifts.csv --shape arcs", 2, "no base circle, two equal flanks and a"),
    (f"fit cam {GL110}", 2, "name it with --column ('lift_a_mm', 'lift_b_mm'), or take all"),
    (f"fit cam {GL110} --shape arcs --tolerance 1", 2, "--tolerance cannot be combined"),
    (f"fit cam {GL110} --shape arcs --base-radius 50", 2, "allowed: below base"),
    ("new My&Cam --from-csv lifts.csv", 2, "name: is 'My Cam'"),
    ("new mine --from-csv lifts.csv --base-radius 0", 2, "base_radius: is 0; allowed: above 0"),
]


@pytest.mark.parametrize(("line", "code", "words"), REFUSED, ids=[line for line, *_ in REFUSED])
@pytest.mark.usefixtures("lift_table")
def test_an_error_is_one_line_and_writes_no_file(tmp_path, monkeypatch, line, code, words):
    """An invalid command line of a study ends with one line and its exit code.

    The line contains the value and the allowed values. No file is written.
    """
    monkeypatch.chdir(tmp_path)
    (tmp_path / "jumps.csv").write_text(TABLE, encoding="utf-8")
    result = call(*(argument.replace("&", " ") for argument in line.split()))
    assert (result.exit_code, result.stdout) == (code, ""), result.output
    assert words in result.stderr and len(result.stderr.strip().splitlines()) == 1
    assert {path.name for path in tmp_path.iterdir()} == {"jumps.csv", "lifts.csv"}
