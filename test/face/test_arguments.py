"""Tests of invalid arguments of `import cam_rig`.

Each gives an error of one line with the name of the argument.
"""

import math
from functools import partial
from inspect import signature, unwrap
from pathlib import Path
from typing import get_type_hints

import numpy as np
import pytest

import cam_rig
from cam_rig import errors
from cam_rig.arguments import OPTION

CAM, RIG = cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2")
LAW = cam_rig.build_law(CAM)


#: Valid and invalid numbers of a rig: the damping is a text.
MIXED = {"mass": 1.3, "damping": "8"}
GOLDEN = str(Path(__file__).parents[2] / "bags" / "golden")


def test_error_of_an_invalid_argument():
    """The error of an invalid argument has its name, its value and the allowed values.

    If the argument must be the result of a function, the error has the name of that function.
    """
    jump, simulate = partial(cam_rig.jump_speed, LAW, RIG), partial(cam_rig.simulate, LAW, RIG)
    fit = partial(cam_rig.fit_rig, "jumps.csv", "poly345")
    law = "allowed: a Law, of build_law"
    number, text = "allowed: a finite number", "allowed: a text without NUL"
    seconds, motion = "allowed: above 0, to 60 s", "allowed: a motion, of simulate"
    for call, words in (
        (partial(LAW, 1.0, -1), "order is -1; allowed: 0, 1"),
        (partial(LAW, 1.0, 1.5), "order is 1.5; allowed: 0, 1"),
        *((partial(jump, duration=duration), seconds) for duration in (1e5, -1, 0)),
        (partial(jump, duration=True), f"duration: is True (bool); {number} or None"),
        (partial(jump, duration=math.nan), f"duration: is nan (float); {number} or None"),
        (partial(cam_rig.jump_speed, RIG, LAW), f"law: is RigConfig; {law}"),
        (partial(simulate, rpm=-100), "rpm: is -100 rpm; allowed: at least 0.01 rpm"),
        (partial(simulate, rpm="450"), f"rpm: is '450' (str); {number}"),
        (partial(simulate, rpm=10**5000), f"rpm: is int of more than 63 bits; {number}"),
        (partial(simulate, rpm=450, turns=None), "turns: is None (NoneType); allowed: a whole"),
        (partial(simulate, rpm=450, turns=100_000), "may have at most 2e+07 samples, got 6.4e+08"),
        (partial(simulate, rpm=450, model="two mass"), "is 'two mass' (did you mean 'two_mass'"),
        (partial(cam_rig.simulate, "poly34", RIG, rpm=450), "poly34.yaml: no such file (did you"),
        (partial(cam_rig.simulate, "conjugate", RIG, rpm=450), "allowed on a rig: a follower"),
        (partial(cam_rig.build_law, 3), f"cam: is 3 (int); {text} or a path or a cam"),
        (partial(fit, fix=MIXED), f"fix['damping']: is '8' (str); {number}"),
        (partial(fit, fix={"damping": math.nan}), f"fix['damping']: is nan (float); {number}"),
        (partial(fit, fix={1: 8.6}), f"a name in fix: is 1 (int); {text}"),
        (partial(cam_rig.sound_level, None), f"motion: is None (NoneType); {motion}"),
        (partial(cam_rig.load_cam, None), f"cam: is None (NoneType); {text} or a path"),
        (partial(cam_rig.load_cam, "poly34"), "poly34.yaml: no such file (did you mean 'poly345'"),
        (partial(cam_rig.contour, CAM, 3), "points must be between 36 and 1000000, got 3"),
        (partial(RIG.with_follower, preload=-1.0), "follower.preload: is -1 N; allowed"),
        (partial(RIG.with_follower, preloud=1.0), "follower.preloud: unknown key"),
        (partial(cam_rig.read_bag, "config"), "config: is not a bag"),
        (
            partial(cam_rig.read_bag, GOLDEN, "jump_two_mass"),
            "the cams must be those of scene jump_two",
        ),
    ):
        with pytest.raises(cam_rig.CamRigError) as refused:
            call()
        assert words in str(refused.value)


def test_numpy_numbers_are_accepted():
    """Functions accept NumPy numbers in place of Python numbers."""
    speed, turns = np.arange(300, 500, 50)[1], np.int64(2)
    assert cam_rig.simulate(LAW, RIG, rpm=speed, turns=turns).rpm == 350.0


def test_wrong_names_and_numbers_of_arguments():
    """An unknown or missing argument raises TypeError with its name."""
    with pytest.raises(TypeError, match="speed"):
        cam_rig.simulate(LAW, RIG, speed=450)
    with pytest.raises(TypeError, match="rig"):
        cam_rig.jump_speed(LAW)


def test_level_is_calibrated_only_for_the_measured_rig():
    """A sound level is marked as calibrated only for the rig that was measured.

    It is not calibrated for another follower, or if the cam would have to pull the follower.
    """
    rig = cam_rig.load_rig("tm21")
    assert cam_rig.sound_level(cam_rig.simulate(LAW, rig, rpm=300)).calibrated
    lighter = rig.with_follower(mass=1.0, preload=100.0)
    assert not cam_rig.sound_level(cam_rig.simulate(LAW, lighter, rpm=300)).calibrated
    pulled = cam_rig.simulate(LAW, rig, model="kinetostatic", rpm=800)
    assert not cam_rig.sound_level(pulled).calibrated


#: Values that are invalid for most arguments: texts, numbers and other objects.
INVALID = [
    *(None, True, False, 0, -1, 10**12, 2**63 - 1, 10**400, 10**5000, np.int64(-3), np.bool_(True)),
    *(-1.5, 0.5, 1e-300, 1e300, math.nan, math.inf, -math.inf, np.float64(math.nan), 1j),
    *("", "abc", "\0", "\ud800", "x" * 5000, "/dev/null", "../..", Path("a\0"), b"poly345"),
    *([], [None], ["a"], [math.nan], [10**400], (), {}, {"a": 1}, {1: 2}, set(), range(3)),
    *(np.array(3.0), np.array([math.nan]), np.array(["a"]), np.array([[0.3]]), np.array([])),
    *(object(), object, math),
]
FUNCTIONS = [name for name in cam_rig.__all__ if name[0].islower()]
#: Functions with a long computation, and what is replaced, so that only arguments are checked.
LONG = {"noise_study": ["cam_rig.studies.noise.study.study_noise"]}


@pytest.fixture(scope="module")
def valid_arguments(tmp_path_factory):
    """Valid arguments of each public function, for a short computation."""
    folder, angle = tmp_path_factory.mktemp("measured"), np.arange(0.0, 360.0, 5.0)
    lifts = np.column_stack([angle, 1e3 * LAW(np.radians(angle))])
    head = "angle [deg],lift [mm]"
    np.savetxt(folder / "lifts.csv", lifts, delimiter=",", header=head, comments="")
    jumps = ["preload [N],jump speed [rpm]", "20,344.9", "30.6,413.4", "45,417.2"]
    (folder / "jumps.csv").write_text("\n".join(jumps), encoding="utf-8")
    cam_text = cam_rig.electronic(CAM, "twincat").text
    (folder / "cam.st").write_text(cam_text, encoding="utf-8")
    levels = np.array([[200, 78.3], [250, 81.7], [300, 83.4], [350, 85.8], [400, 90.9]])
    on_tm21, on_rig = {"cams": "poly345", "rig": "tm21"}, {"law": LAW, "rig": RIG}
    fitted = {"damping": 8.6, "spring_stiffness": 4030.0}
    named = {
        "Law": {"name": "own", "breaks": LAW.breaks, "ordinates": LAW.ordinates},
        "bounce_map": on_rig
        | {"rpm": [450.0], "restitution": 0.5, "turns": 20, "transient_turns": 0},
        "build_law": {"cam": CAM},
        "campaign": {"study": "tolerance_poly345", "points": 1, "seed": 1}
        | {"out": tmp_path_factory.mktemp("out") / "campaign"},
        "check_contours": {"cams": "poly345"},
        "compare": {"bag": GOLDEN, "scene": "quick", "cam": "tm21"},
        "contact_stress": on_tm21 | {"rpm": 200.0},
        "contour": {"cam": CAM, "points": 36},
        "design": {"cam": CAM, "rig": RIG, "minimise": "peak_acceleration"}
        | {"pieces": 6, "joints": 1, "starts": 1, "points": 3},
        "electronic": {"cam": CAM, "points": 16, "interpolation": "cubic"},
        "fit_cam": {"tables": folder / "lifts.csv"},
        "fit_rig": {"source": folder / "jumps.csv", "cam": "poly345", "rig": "tm21"}
        | {"fix": fitted},
        "fit_sound": {"levels": levels, "scene": "tm21_sweep", "cam": "poly345"},
        "jump_speeds": on_tm21 | {"from_rest": 0.5},
        "jump_speed": on_rig | {"duration": 0.5},
        "law_summary": {"names": "poly345"},
        "list_cams": {},
        "list_laws": {"family": "start"},
        "list_rigs": {},
        "load_cam": {"cam": "poly345"},
        "load_rig": {"rig": "tm21"},
        "load_scene": {"scene": "quick"},
        "noise_study": {"scene": "quick", "rig": RIG},
        "order_spectrum": {"source": "poly345", "rpm": 300.0, "rig": "tm21"}
        | {"model": "one_mass", "orders": 5},
        "plot_law": {"law": LAW},
        "read_bag": {"bag": GOLDEN},
        "read_electronic": {"file": folder / "cam.st", "target": "twincat"},
        "run_scene": {"scene": "quick"},
        "simulate": on_rig | {"rpm": 450, "turns": 1},
        "sound_level": {"motion": cam_rig.simulate(LAW, RIG, rpm=450, turns=2)},
        "sweep": on_tm21 | {"rpm": [300.0], "turns": 2, "transient_turns": 1, "sample_rate": 1000},
        "vibration": on_tm21 | {"rpm": 300.0},
    }
    return {
        name: {
            key: parameter.default
            for key, parameter in signature(getattr(cam_rig, name)).parameters.items()
        }
        | arguments
        for name, arguments in named.items()
    }


#: Errors that are no ValueError: a missing file, an unwritable folder, a design without a law.
FILE_ERRORS = errors.BagError | errors.OutputError | errors.DesignError | errors.MissingLibraryError


def check_error_is_one_line(function, arguments):
    """Call a function and check that an error is a short CamRigError of one line."""
    try:
        function(**arguments)
    except cam_rig.CamRigError as error:
        assert "\n" not in str(error)
        assert 0 < len(str(error)) < 12_000  # the message may contain a path of 5000 characters
        assert isinstance(error, ValueError | FILE_ERRORS)
        assert not OPTION.search(str(error)), error  # an option, not a parameter


@pytest.mark.variants(2)
@pytest.mark.parametrize("name", ["Law", *FUNCTIONS])
def test_functions_raise_only_errors_of_cam_rig(valid_arguments, name, monkeypatch, tmp_path):
    """Each function accepts an invalid argument or raises a CamRigError of one line."""
    here = tmp_path / "a" / "b"  # some of the invalid values are writable paths
    here.mkdir(parents=True)
    monkeypatch.chdir(here)
    for long in LONG.get(name, ()):
        monkeypatch.setattr(long, lambda *_arguments, **_named: None)
    function = getattr(cam_rig, name)
    parameters = signature(function).parameters
    assert set(valid_arguments[name]) == set(parameters)
    for argument in valid_arguments[name]:
        for value in (value for value in INVALID if value is not parameters[argument].default):
            check_error_is_one_line(function, valid_arguments[name] | {argument: value})


def array_parameters(name):
    """Return the names of the parameters of a function that can be arrays."""
    hints = get_type_hints(unwrap(getattr(cam_rig, name)))
    return [key for key, hint in hints.items() if "ndarray" in str(hint) and key != "return"]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_empty_lists_and_matrices_are_refused(valid_arguments, name):
    """Empty lists and arrays with two axes raise ConfigError with the argument's name.

    An empty list of cams does not mean the default.
    """
    function, arguments = getattr(cam_rig, name), valid_arguments[name]
    for argument in array_parameters(name):
        for value in ([], np.array([]), np.array([[300.0, 350.0]]), np.full((2, 1), 0.3)):
            with pytest.raises(errors.ConfigError, match=rf"^{argument}\b"):
                function(**arguments | {argument: value})
    if "cams" in arguments:
        for value in ([], ()):
            with pytest.raises(errors.ConfigError, match="cam"):
                function(**arguments | {"cams": value})


@pytest.mark.parametrize("name", FUNCTIONS)
def test_wrong_type_is_a_type_error_and_nan_a_value_error(valid_arguments, name):
    """An argument of a wrong type raises TypeError, and NaN raises ValueError.

    Both are also CamRigErrors.
    """
    function, arguments = getattr(cam_rig, name), valid_arguments[name]
    for argument, value in arguments.items():
        with pytest.raises(TypeError) as refused:
            function(**arguments | {argument: object()})
        assert isinstance(refused.value, cam_rig.CamRigError)
        if isinstance(value, float):
            with pytest.raises(ValueError, match=f"{argument}: is nan"):
                function(**arguments | {argument: math.nan})


@pytest.mark.parametrize("make", [cam_rig.Cam, cam_rig.Rig])
def test_invalid_arguments_of_cam_and_rig(make, tmp_path, monkeypatch):
    """Methods of Cam and Rig raise only CamRigErrors of one line.

    The methods are the constructors, replace(), save() and those of the linear model.
    """
    monkeypatch.chdir(tmp_path)
    base = CAM if make is cam_rig.Cam else RIG
    sections = dict(base)
    calls = [partial(partial, make, **sections), partial(partial, base.replace), base.save]
    for name in sections:
        for value in INVALID:
            for call in calls[:2]:
                check_error_is_one_line(call(**{name: value}), {})
    for value in INVALID:
        check_error_is_one_line(partial(base.save, value), {})
        if make is cam_rig.Rig:
            check_error_is_one_line(partial(base.frequency_response, value), {})
            check_error_is_one_line(partial(base.state_space, value), {})
            for number in ("mass", "spring", "roller_share"):
                numbers = {"mass": 1.0, "spring": 1.0, "preload": 1.0} | {number: value}
                check_error_is_one_line(partial(make, **numbers), {})
                check_error_is_one_line(partial(base.replace, **{number: value}), {})


@pytest.mark.parametrize("every", [4, pytest.param(1, marks=pytest.mark.long)])
def test_invalid_arguments_of_methods_of_results(every, monkeypatch, tmp_path):
    """Methods of results raise only CamRigErrors of one line for invalid arguments."""
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
    for i, call in enumerate(calls):
        for value in INVALID[i % every :: every]:
            if isinstance(value, int) and abs(value) >= 2**63 and call is calls[-1]:
                continue  # Python refuses to convert so many digits to text
            check_error_is_one_line(partial(call, value), {})
