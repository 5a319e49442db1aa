"""``import cam_rig``: what it offers, that it is light, and that it gives what commands give."""

import doctest
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

import cam_rig
from cam_rig.errors import BagError, ConfigError
from cam_rig.show.result import notebook

#: Where the public names are: their docstrings have examples.
WITH_EXAMPLES = sorted({"cam_rig"} | {getattr(cam_rig, name).__module__ for name in cam_rig._HOMES})


@pytest.mark.variants(13)
@pytest.mark.parametrize("module", WITH_EXAMPLES)
def test_examples_in_docstrings_are_true(module, monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[2])
    assert doctest.testmod(import_module(module)).failed == 0


def test_every_public_function_has_an_example():
    functions = [getattr(cam_rig, name) for name in cam_rig.__all__ if name[0].islower()]
    assert functions
    assert [f.__name__ for f in functions if ">>> " not in f.__doc__] == []


def test_importing_it_imports_no_library():
    code = "import sys, cam_rig; print(sorted({'numpy', 'scipy', 'pydantic'} & set(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=100
    )
    assert done.stdout.strip() == "[]"


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'cam_rig' has no attribute 'simulat'"):
        cam_rig.simulat
    assert set(cam_rig.__all__) <= set(dir(cam_rig))


class Shell:
    """IPython as far as pictures are concerned: a printer for each type, by what it makes."""

    def __init__(self, known=()):
        self.printers = {"image/png": Printers(), "image/svg+xml": Printers(known)}
        self.display_formatter = SimpleNamespace(formatters=self.printers)


class Printers:
    """One of its formatters."""

    def __init__(self, known=()):
        self.type_printers = dict.fromkeys(known)

    def for_type(self, kind, function):
        self.type_printers[kind] = function


@pytest.mark.parametrize("known", [(), (Figure,)])
def test_a_notebook_shows_pictures(monkeypatch, known):
    law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    motion = cam_rig.simulate(law, cam_rig.load_rig("tm21"), rpm=60, turns=1, sample_rate=1000)
    figure, shell = motion.plot(), Shell(known)
    with monkeypatch.context() as patched:
        patched.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
        assert notebook(figure) is figure
    printers = shell.printers["image/png"].type_printers
    assert set(printers) == (set() if known else {Figure})
    assert all(printer(figure).startswith(b"\x89PNG") for printer in printers.values())


GOLDEN = Path(__file__).parents[2] / "bags" / "golden"


@pytest.fixture
def figures(monkeypatch):
    """Figures without a screen, all closed at the end."""
    monkeypatch.setitem(mpl.rcParams, "backend", "agg")
    yield
    mpl.pyplot.close("all")


@pytest.fixture(scope="module")
def law():
    return cam_rig.build_law(cam_rig.load_cam("poly345"))


@pytest.fixture(scope="module")
def rig():
    return cam_rig.load_rig("paper_table2")


def test_the_jump_speed_is_drawn_where_the_force_is_zero(law, rig, figures):
    found = cam_rig.jump_speed(law, rig)
    assert found.to_pandas()["rpm"].tolist() == [found.rpm]
    (axes,) = found.plot().axes
    rpm, force = axes.lines[0].get_data()
    assert np.interp(found.rpm, rpm, force) == pytest.approx(0.0, abs=0.2)


def test_a_rig_of_other_numbers_is_checked_as_its_file_is(rig):
    with pytest.raises(ConfigError, match=r"'paper_table2': follower.preload: is -1 N; allowed"):
        rig.with_follower(preload=-1.0)
    with pytest.raises(ConfigError, match=r"follower.preloud: unknown key.*did you mean 'preload'"):
        rig.with_follower(preloud=1.0)
    changed = rig.with_follower(roller_share=0.3)
    assert changed.follower.roller_share.si == 0.3
    assert rig.follower.roller_share.si == 0.4


def test_the_points_of_a_contour_are_as_many_as_asked_for_and_cannot_be_changed():
    shape = cam_rig.contour(cam_rig.load_cam("poly345"), points=90)
    assert shape.x.size == shape.y.size == 90
    assert shape.to_pandas()["x"].tolist() == shape.x.tolist()
    with pytest.raises(ValueError, match="read-only"):
        shape.x[0] = 0.0
    with pytest.raises(ConfigError, match="points: is 3; allowed: 36 to 1000000"):
        cam_rig.contour(cam_rig.load_cam("poly345"), points=3)


def test_a_conjugate_cam_has_two_contours(figures):
    shape = cam_rig.contour(cam_rig.load_cam("conjugate"), points=360)
    assert len(shape.discs) == 2
    assert shape.to_pandas()["disc"].nunique() == 2
    (legend,) = shape.plot(positions=12).legends
    assert "follower every 30°" in [text.get_text() for text in legend.get_texts()]
    with pytest.raises(ConfigError, match="positions: is 2; allowed: 3 to 720"):
        shape.plot(positions=2)


def test_a_bag_and_its_scene_give_one_run(figures):
    recording = cam_rig.read_bag(GOLDEN)
    computed = cam_rig.run_scene(recording.loaded)
    assert recording.complete and computed.complete
    assert recording.counts["/cam/state"] > 0 and computed.counts == {}
    table = recording.to_pandas()
    assert list(table)[:4] == ["cam", "rpm", "turns", "level"]
    assert table["level"].tolist()[:4] == recording.noise.curves["tm21"].level_db.tolist()
    (axes,) = recording.plot().axes
    assert axes.get_xlabel() == "cam speed [rpm]"
    recorded, again = recording.samples("tm21", 350), computed.samples("tm21", 350.0)
    away = np.abs(recorded.rows - again.rows).max(axis=1)
    assert (away <= 1e-11 * np.abs(again.rows).max(axis=1)).all()
    np.testing.assert_allclose(np.diff(recorded.time), 1e-3, rtol=0, atol=1e-12)
    with pytest.raises(ValueError, match="read-only"):
        recorded.force[0] = 1.0
    with pytest.raises(ConfigError, match=r"samples: tm21 at 360 rpm; allowed: tm21 at 200 rpm, "):
        recording.samples("tm21", 360)


def test_progress_is_told_tick_by_tick():
    told = []
    run = cam_rig.run_scene("quick", on_tick=lambda: told.append(1))
    assert len(told) == len(run.ticks) == 16


def test_a_name_that_is_not_there_lists_those_that_are(tmp_path):
    with pytest.raises(ConfigError, match=r"poly34.yaml: no such file \(did you mean 'poly345'"):
        cam_rig.load_cam("poly34")
    with pytest.raises(BagError):
        cam_rig.read_bag(tmp_path)
    path = Path(__file__).parents[2] / "config" / "cams" / "poly345.yaml"
    assert cam_rig.load_cam(path) == cam_rig.load_cam(str(path)) == cam_rig.load_cam("poly345")


def test_the_largest_waviness_is_that_of_the_command(figures):
    study = {
        "name": "wavy",
        "title": "waviness of a rigid follower",
        "base": {"cam": "poly345", "rig": "paper_table2"},
        "vary": {
            "profile.waviness.amplitude": {"values": [2], "unit": "um"},
            "profile.waviness.wavelength": {"range": [12, 60], "unit": "deg"},
            "profile.waviness.phase": {"range": [0, 360], "unit": "deg"},
        },
        "plan": {"kind": "sobol", "points": 8},
        "measures": ["jump_speed_rigid"],
        "limits": ["jump_speed_rigid>=350rpm"],
    }
    found = cam_rig.largest_waviness(study, 3)
    assert [one.outcome for one in found.wavelengths] == ["found"] * 3
    table = found.to_pandas()
    assert table.amplitude.is_monotonic_increasing and table.low.isna().all()
    again = cam_rig.largest_waviness(study, table.wavelength.to_numpy())
    assert again.to_pandas().equals(table)
    (axes,) = found.plot().axes
    assert axes.lines[0].get_ydata() == pytest.approx(table.amplitude * 1e6)
    with pytest.raises(ConfigError, match=r"is 500 deg; allowed: 0\.1 to 360 deg"):
        cam_rig.largest_waviness(study, [np.radians(500.0)])
    with pytest.raises(ConfigError, match="wavelengths: is 0; allowed"):
        cam_rig.largest_waviness(study, 0)
    with pytest.raises(ConfigError, match="needed for the largest waviness"):
        cam_rig.largest_waviness(study | {"limits": []}, 3)
