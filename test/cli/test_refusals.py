"""Invalid command lines: one error line, an exit code, no traceback, no file."""

import inspect

import pytest
import typer

from cam_rig.cli.main import COMMANDS, app, command, summary
from tools.docs.commands import verbs

from .conftest import call, data_of, done

#: Command line, exit code, and part of its error line (empty: typer prints the usage instead).
REFUSED = [
    ("urdf quick --cam conjugate", 2, "conjugate"),
    ("simulate no_such_scene", 2, "no_such_scene.yaml: no such file; there are: "),
    ("run no_such_scene --bag {tmp}/bag", 2, "no such file"),
    ("run quick --bag {tmp}", 1, "exists already, not overwriting"),
    ("run quick --bag {tmp}/bag --wait-for-client", 2, "--wait-for-client requires a viewer"),
    ("simulate --nonsense", 2, ""),
    ("simulte quick", 2, "'simulte' is not a command (did you mean 'simulate'?)"),
    ("xyzzy", 2, "'xyzzy' is not a command; cam-rig --help lists the commands"),
    ("simulate quick --plot {tmp}/a.xyz", 2, "unknown kind of picture; allowed: .png"),
    ("simulate quick --json /proc/none/a.json", 1, "/proc/none/a.json: cannot be"),
    ("export quick --to {tmp}/a.xlsx", 2, "allowed: .parquet, .csv, .npz, .wav"),
    ("export quick --rpm 222 --to {tmp}/a.csv", 2, "no samples of a cam at 222 rpm"),
    ("export quik --to {tmp}/a.csv", 2, "quik: is neither a bag nor a scene: "),
    ("law poly354", 2, "no such cam or rise (did you mean 'poly345'?); cams: arcs_"),
    ("law poly345 bezier8start", 2, "did you mean 'bezier8_start'?"),
    ("law poly345 cycloidal poly345", 2, "'poly345' is repeated; remove one"),
    ("law bezier15 bezier9", 2, "'bezier15' is a cam, 'bezier9' is a rise; cams and rises cannot"),
    ("law bezier15 --rises", 2, "and --rises requires rises; cams and rises cannot be"),
    ("law poly345 {tmp}/none.yaml", 2, "cam-rig: {tmp}/none.yaml: no such file"),
    ("law poly345 --out {tmp}/a.xyz", 2, "unknown kind of picture; allowed: .png"),
    ("law", 2, ""),
    ("laws --family strat", 2, "--family must be one of polynomial, start"),
    ("noise --rig tm21", 2, "follower.roller_share, follower.stem_damping: are missing"),
    ("fit sound {tmp}/none.csv quick", 2, "none.csv: no such file"),
    ("listen quick --out {tmp}/a.mp3", 2, "the sound file must end in .wav"),
    ("listen quick --out {tmp}/a.wav --cam no", 2, "has no cam 'no'"),
    ("listen quick --out /proc/none/a.wav", 1, "/proc/none/a.wav: cannot be"),
    ("listen quick --out {tmp}/a.wav --rpm 0", 2, "--rpm: is '0'; allowed: greater than"),
    ("listen quick --seconds 3 --out {tmp}/a.wav", 2, "--seconds requires --rpm"),
    ("report quick --out {tmp}/a.pdf", 2, "unknown kind of page; allowed: .html, .md"),
    ("report quick --out /dev/null/a.html", 1, "/dev/null is not a writable folder"),
    ("report no_such --out {tmp}/a.html", 2, "no such file"),
    ("profile", 2, "at least one cam file"),
    ("profile no_such_cam", 2, "no_such_cam.yaml: no such file; there are: arcs_centres"),
    ("profile flat --out {tmp}/a.step", 2, "must end in .dxf or .svg or .csv"),
    ("profile flat tm21 --out {tmp}/a.dxf", 2, "--out and --plot require one cam, got 2"),
    ("profile flat --pitch", 2, "--pitch and --cutter need --out"),
    ("profile tm21 --pitch --cutter 3 --out {tmp}/a.dxf", 2, "--pitch cannot be combined with"),
    ("profile tm21 --cutter -3 --out {tmp}/a.dxf", 2, "--cutter must be above 0 mm, got -3"),
    ("profile tm21 --cutter 600 --out {tmp}/a.dxf", 1, "concave radius of curvature 507"),
    (
        "profile tm21 --tolerance 0 --out {tmp}/a.dxf",
        2,
        "--tolerance must be at least 0.0001 µm, got 0",
    ),
    ("profile tm21 --tolerance 3", 2, "--tolerance requires --out FILE.dxf or"),
    ("profile tm21 --points 99 --out {tmp}/a.dxf", 2, "--points requires --out FILE.csv"),
    ("profile tm21 --from {tmp}/none.csv", 2, "none.csv: no such file"),
    ("profile tm21 --from a.csv --plot {tmp}/a.png", 2, "--from cannot be combined with --plot,"),
    ("profile tm21 --from {tmp}/none.png", 2, "must end in .dxf or .csv"),
    ("profile tm21 --out /proc/none/a.dxf", 1, "cannot be written"),
    ("jump poly345 poly345", 2, "is named twice"),
    ("jump conjugate", 2, "follower.type is 'conjugate'; allowed on a rig"),
    ("jump worked_example_constant_velocity", 1, "one slope; contact is lost at any speed"),
    ("jump --rig no_such_rig", 2, "no_such_rig.yaml: no such file"),
    ("jump --from-rest -1", 2, "the run from rest lasts -1 s; allowed: above 0"),
    ("jump --steady --ramp 100", 2, "cannot be combined; use one of them"),
    ("jump --ramp 350 --plot {tmp}/a.png", 2, "--plot cannot be combined with --ramp"),
    ("orders poly354", 2, "poly354: no such cam or scene (did you mean 'poly345'?)"),
    ("orders poly345 --cam tm21", 2, "--cam requires a scene, got the cam poly345"),
    ("orders poly345 --rpm 0", 2, "--rpm 0: allowed: 300, or 200,300, or 200:400:10"),
    ("orders poly345 --save a.png", 2, "a.png: unknown kind of recording; allowed: .rrd"),
    ("contact conjugate --plot {tmp}/a.png", 2, "closing spring"),
    ("vibration worked_example_constant_velocity", 1, "or a rig without a shaft"),
]


@pytest.mark.parametrize(("line", "code", "words"), REFUSED, ids=[line for line, *_ in REFUSED])
def test_invalid_command_line_is_one_line_and_writes_no_file(tmp_path, line, code, words):
    """An invalid command line ends with its exit code, one error line and no file."""
    result = call(*line.format(tmp=tmp_path).split())
    assert result.exit_code == code and words.format(tmp=tmp_path) in result.stderr
    assert result.stderr.count("cam-rig: ") == bool(words), result.stderr
    assert "Traceback" not in result.stderr and list(tmp_path.iterdir()) == []


def test_list_of_commands_has_the_first_sentence_of_each():
    """The list of commands has the first paragraph of each command's help."""
    for name in COMMANDS:
        first, *_ = inspect.cleandoc(command(name).help).split("\n\n")
        assert summary(name) == first.replace("\n", " ")


def test_json_of_simulate():
    """The JSON of `simulate tm21_sweep` has all speeds, levels and the crossing.

    The levels agree with published levels within the limits of the comparison.
    """
    data = data_of("simulate", "tm21_sweep")
    assert set(data) == {
        "schema",
        "speeds",
        "summary",
        "noise",
        "levels",
        "crossing",
        "run",
        "messages",
    }
    assert [len({row["cam"] for row in data["speeds"]}), len(data["speeds"])] == [3, 63]
    assert {type(row["torque_mean"]) for row in data["speeds"]} == {float}
    cams = {row["cam"]: row for row in data["noise"]}
    assert {name: cam["role"] for name, cam in cams.items()} == {
        "tm21": "identified",
        "poly345": "calibrated",
        "bezier15": "predicted",
    }
    assert len({row["rpm"] for row in data["levels"]}) == len(data["levels"]) / 3 == 21
    assert all(None not in cam.values() for cam in cams.values())
    assert cams["poly345"]["rms_difference"] <= 1.0 and cams["bezier15"]["rms_difference"] <= 1.0
    assert cams["tm21"]["rms_difference"] <= 2.5
    assert data["crossing"]["rpm"] == pytest.approx(335.0, abs=15.0)


def test_urdf_on_stdout_equals_the_file(tmp_path):
    """`urdf` prints the text that --out writes, with the cam of --cam.

    The base circle of poly345 is 65 mm.
    """
    printed = done("urdf", "tm21_sweep", "--cam", "poly345")
    assert '<cylinder radius="0.065"' in printed.stdout
    call("urdf", "tm21_sweep", "--cam", "poly345", "--out", tmp_path / "new" / "rig.urdf")
    assert (tmp_path / "new" / "rig.urdf").read_text(encoding="utf-8") == printed.stdout


ROOT = typer.main.get_command(app)
OPTIONS = [
    pytest.param(name, option, id=f"{name} {max(option.opts, key=len)}")
    for name, verb in verbs().items()
    for option in verb.params
    if option.param_type_name == "option" and not option.multiple and not option.is_eager
]


def test_options_include_those_of_command_groups():
    """The list of options that the next test uses contains those of subcommands."""
    assert len(OPTIONS) > 150
    assert "fit cam" in verbs()


@pytest.mark.variants(24)
@pytest.mark.parametrize(("verb", "option"), OPTIONS)
def test_repeated_option_is_refused(verb, option, capsys):
    """An option that occurs twice ends the command with one line that states it."""
    name = max(option.opts, key=len)
    once = [name] if option.is_flag else [name, *["1"] * option.nargs]
    with pytest.raises(SystemExit) as end:
        ROOT.main([*verb.split(), *once, *once], prog_name="cam-rig")
    assert end.value.code == 2
    assert capsys.readouterr().err == f"cam-rig: {name} must occur once, got it 2 times\n"


def test_help_has_priority_over_errors():
    """--help succeeds although another option is repeated."""
    done("jump", "--rig", "a", "--rig", "b", "--help")
