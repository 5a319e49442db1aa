"""Whatever a public function is given wrongly, only a CamRigError comes out, in one line."""

import math
from functools import partial
from inspect import signature
from pathlib import Path

import numpy as np
import pytest

import cam_rig

#: Texts, numbers and things, most of them wrong wherever they are given.
WRONG = [
    *(None, True, False, 0, -1, 10**12, 2**63 - 1, 10**400, 10**5000, np.int64(-3), np.bool_(True)),
    *(-1.5, 0.5, 1e-300, 1e300, math.nan, math.inf, -math.inf, np.float64(math.nan), 1j),
    *("", "abc", "\0", "\ud800", "x" * 5000, "/dev/null", "../..", Path("a\0"), b"poly345"),
    *([], [None], ["a"], [math.nan], [10**400], (), {}, {"a": 1}, {1: 2}, set(), range(3)),
    *(np.array(3.0), np.array([math.nan]), np.array(["a"]), np.array([[0.3]]), np.array([])),
    *(object(), object, math),
]
FUNCTIONS = [name for name in cam_rig.__all__ if name[0].islower()]
GOLDEN = str(Path(__file__).parents[2] / "bags" / "golden")
CAM = cam_rig.load_cam("poly345")
RIG = cam_rig.load_rig("paper_table2")
LAW = cam_rig.build_law(CAM)


@pytest.fixture(scope="module")
def right(tmp_path_factory):
    """Arguments of every function that are right, and cheap."""
    motion = cam_rig.simulate(LAW, RIG, rpm=450, turns=2)
    points = {"points": 1, "seed": 1, "executor": None}
    made = {
        "Law": {
            "name": "own",
            "breaks": LAW.breaks,
            "ordinates": LAW.ordinates,
            "repeats": True,
            "known": None,
        },
        "build_law": {"cam": CAM},
        "campaign": {"study": "tolerance_poly345", "resume": False, "workers": 1, **points},
        "compare_run": {"bag": GOLDEN, "scene": "quick", "cam": "tm21"}
        | dict.fromkeys(("topics", "namespace", "offset_deg")),
        "contour": {"cam": CAM, "points": 36},
        "design": {"cam": CAM, "rig": RIG, "minimise": "peak_acceleration", "maximise": None}
        | {"limits": (), "pieces": 6, "joints": 1, "degree": None, "starts": 1, "seed": 1}
        | {"keep": ("dwells", "events", "lift")},
        "jump_speed": {"law": LAW, "rig": RIG, "duration": 0.5},
        "largest_waviness": {"study": "tolerance_poly345", "wavelengths": [0.31], **points},
        "load_cam": {"cam": "poly345"},
        "load_rig": {"rig": "tm21"},
        "load_scene": {"scene": "quick"},
        "read_bag": {"bag": GOLDEN, "scene": None},
        "run_scene": {"scene": "quick", "on_tick": lambda: None},
        "simulate": {"law": LAW, "rig": RIG, "model": "one_mass", "rpm": 450, "turns": 1}
        | {"sample_rate": 48_000, "ramp": None},
        "sound_level": {"motion": motion, "settle_turns": 1},
    }
    made["campaign"]["out"] = tmp_path_factory.mktemp("out") / "campaign"
    return made


def refuses_in_one_line(function, arguments):
    """Calls; a refusal is the rig's own, of one line, short. Anything else is an error here."""
    try:
        function(**arguments)
    except cam_rig.CamRigError as error:
        assert "\n" not in str(error)
        assert 0 < len(str(error)) < 12_000  # a path of 5000 characters is named


@pytest.mark.variants(2)
@pytest.mark.slow
@pytest.mark.parametrize("name", ["Law", *FUNCTIONS])
def test_only_errors_of_the_rig_come_out(right, name, monkeypatch, tmp_path):
    """Every argument of every public function, with every wrong value, one at a time."""
    here = tmp_path / "a" / "b"  # some of the wrong values are places that can be written
    here.mkdir(parents=True)
    monkeypatch.chdir(here)
    function = getattr(cam_rig, name)
    parameters = signature(function).parameters
    assert set(right[name]) == set(parameters)
    for argument in right[name]:
        for value in (one for one in WRONG if one is not parameters[argument].default):
            refuses_in_one_line(function, right[name] | {argument: value})


def test_what_their_results_are_asked(right, monkeypatch, tmp_path):
    """Methods that take something, as well; a follower's number too."""
    monkeypatch.chdir(tmp_path)
    run = cam_rig.read_bag(GOLDEN)
    shape = cam_rig.contour(CAM, 36)
    calls = [
        (lambda value: shape.plot(positions=value)),
        (lambda value: run.samples(value, 400)),
        (lambda value: run.samples("tm21", value)),
        run.export,
        (lambda value: run.export(tmp_path / "a.npz", cam=value, rpm=400.0)),
        (lambda value: run.export(tmp_path / "a.npz", cam="tm21", rpm=value)),
        (lambda value: RIG.with_follower(preload=value)),
        (lambda value: RIG.with_follower(**{str(value)[:9]: 1.0})),
    ]
    for call in calls:
        for value in WRONG:
            if isinstance(value, int) and abs(value) >= 2**63 and call is calls[-1]:
                continue  # Python writes no text of so many digits
            refuses_in_one_line(partial(call, value), {})
