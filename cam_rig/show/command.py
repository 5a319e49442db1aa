"""Commands that print a result and write it as a plot, JSON or CSV.

A file is written completely or not at all.
"""

from __future__ import annotations

import inspect
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer
from typer.core import TyperCommand

from cam_rig.errors import INTERRUPTED, CamRigError, ConfigError, printable
from cam_rig.extras import friendly_import_errors, require, source_date
from cam_rig.files import atomic_write, check_writable
from cam_rig.interrupts import raise_signals
from cam_rig.show.result import Progress, Result
from cam_rig.show.terminal import console, say, show

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.progress import Progress as RichProgress

#: Suffixes of the files that a plot can be written to.
PICTURE_SUFFIXES = (".png", ".svg", ".pdf", ".jpg")
#: Output path by which the user selects standard output.
STDOUT = Path("-")
#: Wall-clock time between progress lines, in s, if there is no terminal for a bar.
LOG_PERIOD_S = 10.0


@contextmanager
def user_errors() -> Iterator[None]:
    """Exit the command with one line on stderr after a `CamRigError` or an interrupt.

    The exit code is that of the error. Any other exception propagates.
    """
    try:
        source_date()  # checked first, because an invalid date makes imports fail
        with friendly_import_errors(), raise_signals():
            yield
    except CamRigError as error:
        print(f"cam-rig: {printable(error.in_command)}", file=sys.stderr)
        raise typer.Exit(error.exit_code) from None
    except KeyboardInterrupt as interrupt:
        print(f"cam-rig: {str(interrupt) or 'interrupted'}", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None


def make_progress_bar() -> RichProgress:
    """Return a progress bar with completed steps, total steps and remaining time."""
    from rich import progress  # only on use: a tenth of the time of `--help`

    columns = (progress.BarColumn(), progress.MofNCompleteColumn(), progress.TimeRemainingColumn())
    description = progress.TextColumn("{task.description}")
    return progress.Progress(description, *columns, console=console, transient=True)


class ProgressBar(Progress):
    """Progress bar of a command. It is not displayed unless stderr is a terminal."""

    def __init__(self) -> None:
        self._bar: RichProgress | None = None
        self._task: Any = None

    def start(self, total: int | None, description: str = "") -> None:
        """Start a task of `total` steps (None: unknown), which replaces the previous task."""
        if self._bar is not None:
            self._bar.remove_task(self._task)
        elif console.is_terminal:
            self._bar = make_progress_bar()
            self._bar.start()
        if self._bar is not None:
            self._task = self._bar.add_task(printable(description), total=total)

    def advance(self, steps: int = 1) -> None:
        """Report completed steps of the present task to the progress bar."""
        if self._bar is not None:
            self._bar.advance(self._task, steps)

    def describe(self, description: str) -> None:
        """Display a text next to the bar, such as the current item or the best result."""
        if self._bar is not None:
            self._bar.update(self._task, description=printable(description))

    def stop(self) -> None:
        """Remove the progress bar from the terminal."""
        if self._bar is not None:
            self._bar.stop()


def write_plot(target: Path, figure: Callable[[], Figure]) -> None:
    """Draw a figure, write it to a file, and print its path."""
    from cam_rig.show.figure import write

    with atomic_write(target) as part:
        write(figure(), part)
    say(f"plot: {target}")


def write_json(data: dict[str, Any], target: str | None) -> None:
    """Write JSON to a file, or to stdout for ``-``. Without a target, write nothing."""
    text = json.dumps(data, indent=2)
    if target == "-":
        print(text)
    elif target is not None:
        with atomic_write(Path(target)) as part:
            part.write_text(text + "\n", encoding="utf-8")


def check_outputs(json_target: str | None, plot: Path | None, csv: Path | None = None) -> None:
    """Check, before the computation, that all outputs can be written.

    Raises
    ------
    ConfigError
        If a target cannot be written, matplotlib is not installed, or two targets are stdout.
    """
    if json_target == "-" and csv == STDOUT:
        raise ConfigError("--json - cannot be combined with --csv -: both write to stdout")
    if plot is not None and plot.suffix.lower() not in PICTURE_SUFFIXES:
        raise ConfigError(
            f"{plot}: unknown kind of picture; allowed: {', '.join(PICTURE_SUFFIXES)}"
        )
    if plot is not None:
        require("matplotlib")
    for target in (plot, csv, None if json_target is None else Path(json_target)):
        if target not in (None, STDOUT):
            check_writable(target)


def check_recording(target: Path) -> None:
    """Check, before the computation, that a Rerun recording can be written."""
    require("rerun")
    check_writable(target)
    if target.suffix != ".rrd":
        raise ConfigError(f"{target}: unknown kind of recording; allowed: .rrd")


def write_tables(result: Result, target: Path) -> None:
    """Write the tables of a result as CSV.

    The first table is written to `target`, the others to ``TARGET.KEY.csv`` if they have records.
    With ``-`` only the first is written, to stdout.
    """
    first, *others = result.tables()
    if target == STDOUT:
        print(first.to_csv(), end="")
        return
    further = {target.with_suffix(f".{t.key}{target.suffix}"): t for t in others if t.records}
    for path, table in ({target: first} | further).items():
        with atomic_write(path) as part:
            part.write_text(table.to_csv(), encoding="utf-8")
    if further:
        say(f"csv: {target}; further tables: {', '.join(map(str, further))}")


def echo_assumptions(assumptions: Iterable[str]) -> None:
    """Print the assumptions that no reading supports.

    Each is a sentence on a number in a written file that was assumed, not measured.
    """
    say(*(f"assumed: {text}" for text in assumptions))


class StrictCommand(TyperCommand):
    """Typer command that rejects a repeated option instead of using its last value."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments. Exit with an error if an option is repeated."""
        counts = Counter(self.make_parser(ctx).parse_args(list(args))[2])
        repeated = [p for p, count in counts.items() if count > 1 and not p.multiple]
        if repeated and not any(p.is_eager for p in counts):
            name, count = max(repeated[0].opts, key=len), counts[repeated[0]]
            print(f"cam-rig: {name} must occur once, got it {count} times", file=sys.stderr)
            raise typer.Exit(ConfigError.exit_code)
        return super().parse_args(ctx, args)


#: Name of the scene that a command uses if its argument for the scene is missing.
DEFAULT_SCENE = "tm21_sweep"

# Arguments and options shared by several commands, each with one meaning and one help text.

Scene = Annotated[str, typer.Argument(help="Scene file, or a name in config/scenes.")]
CamsOrScene = Annotated[
    list[str] | None,
    typer.Argument(
        help="Cam files, or names in config/cams, or one scene: its cams on its rig. By default "
        "the cams of Table 2."
    ),
]
Rig = Annotated[str, typer.Option(help="Rig file, or a name in config/rigs.")]
RigOfCam = Annotated[
    str | None,
    typer.Option(
        "--rig",
        help="Rig file, or a name in config/rigs (default: the only one next to the cam, else that "
        "of the cam's name; for shipped cams paper_table2).",
    ),
]
RigOfScene = Annotated[
    str | None,
    typer.Option(
        "--rig",
        help="Rig file, or a name in config/rigs (default: the scene's; for cams the only one next "
        "to them, else that of the cam's name; for shipped cams paper_table2).",
    ),
]
OtherRig = Annotated[
    str | None,
    typer.Option("--rig", help="Rig file, or a name in config/rigs (default: the scene's)."),
]
ShowTable = Annotated[
    bool, typer.Option("--table", help="Display every speed, and the regressions of the levels.")
]
SceneOfBag = Annotated[
    str | None,
    typer.Option(help="Scene that was run, for a bag without one (made by `ros2 bag record`)."),
]
Plot = Annotated[Path | None, typer.Option(help="Write the plot (PNG, SVG, PDF).")]
Csv = Annotated[
    Path | None,
    typer.Option("--csv", metavar="FILE", help="Write the tables as CSV (-: stdout)."),
]
Json = Annotated[str | None, typer.Option("--json", metavar="FILE", help="Write JSON (-: stdout).")]
RigOfBag = Annotated[
    str | None, typer.Option("--namespace", help="One rig of a bag with several rigs: /rig2.")
]
Namespace = Annotated[
    str, typer.Option(help="Namespace of its nodes and topics, for two rigs side by side.")
]
Jobs = Annotated[
    int | None,
    typer.Option(metavar="N", min=1, max=1024, help="Processes (default: one per core)."),
]
Dask = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Send the work to a Dask cluster: tcp://HOST:PORT, or its scheduler file.",
    ),
]

#: Declaration of each output option of the commands, by name. A command has the options for those
#: formats in which its result can be written.
OUTPUT_OPTIONS = {"plot": Plot, "csv": Csv, "json": Json}


def command(*outputs: str) -> Callable[[Callable[..., Any]], Callable[..., None]]:
    """Turn a function that returns a `Result` into the callback of a Typer command.

    The command checks its output targets, calls the function, prints the tables and writes the
    outputs. A `CamRigError` ends it with one line on stderr.

    Parameters
    ----------
    *outputs : str
        Keys of `OUTPUT_OPTIONS` to add as options.

    Notes
    -----
    A parameter `progress` of the function receives a `ProgressBar`. A parameter named as an output
    receives its target, which the function may reject. The function returns None if it has printed
    its result itself.

    Examples
    --------
    >>> @command("json", "csv")
    ... def laws(names: list[str]) -> LawsResult:
    ...     return list_laws(names)
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., None]:
        parameters = dict(inspect.signature(function).parameters)
        takes_progress = parameters.pop("progress", None) is not None
        forwarded_outputs = [n for n in OUTPUT_OPTIONS if parameters.pop(n, None) is not None]

        @wraps(function)
        def run(**kwargs: Any) -> None:
            targets = {name: kwargs.pop(name, None) for name in OUTPUT_OPTIONS}
            plot, csv, json_target = targets.values()
            kwargs |= {name: targets[name] for name in forwarded_outputs}
            with user_errors():
                check_outputs(json_target, plot, csv)
                bar = ProgressBar()
                try:
                    result = function(**kwargs, **({"progress": bar} if takes_progress else {}))
                finally:
                    bar.stop()
                write_outputs(result, plot, csv, json_target)

        _set_signature(run, function, parameters, outputs)
        return run

    return decorate


def _set_signature(
    run: Any,
    function: Callable[..., Any],
    parameters: Mapping[str, inspect.Parameter],
    outputs: Iterable[str],
) -> None:
    """Set the signature that Typer reads: the function's, then output options.

    Typer derives arguments and options from the signature and the evaluated annotations of a
    callback. The wrapper `run` takes ``**kwargs``, so both are rebuilt here, without `progress` and
    the forwarded outputs. Only the annotations of `parameters` are evaluated: others, such as the
    return type, may name classes that are imported for type checkers only. The function in
    ``__wrapped__`` does not matter, because `inspect.signature` prefers ``__signature__``.
    """
    annotated = SimpleNamespace(
        __annotations__={name: function.__annotations__[name] for name in parameters}
    )
    hints = get_type_hints(annotated, vars(inspect.getmodule(function)), include_extras=True)
    options = {name: OUTPUT_OPTIONS[name] for name in outputs}
    run.__annotations__ = hints | options
    kind = inspect.Parameter.KEYWORD_ONLY
    run.__signature__ = inspect.Signature(
        [p.replace(annotation=hints[name]) for name, p in parameters.items()]
        + [inspect.Parameter(n, kind, default=None, annotation=o) for n, o in options.items()]
    )


def write_outputs(
    result: Result | None, plot: Path | None, csv: Path | None, json_target: str | None
) -> None:
    """Print a result, write its outputs, and exit with its exit code unless it is 0."""
    if result is None:
        return
    if result.subject:
        say(result.subject)
    show(*result.to_display())
    say(*result.summary())
    echo_assumptions(result.assumed)
    if csv is not None:
        write_tables(result, csv)
    if plot is not None:
        write_plot(plot, result.plot)
    if json_target is not None:
        write_json(result.data(), json_target)
    if code := INTERRUPTED if result.interrupted else result.exit_code:
        raise typer.Exit(code)
