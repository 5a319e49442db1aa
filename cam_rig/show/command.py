"""What a command writes: plots, JSON and CSV, written whole or not at all."""

from __future__ import annotations

import inspect
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer
from typer.core import TyperCommand

from cam_rig.errors import INTERRUPTED, CamRigError, ConfigError
from cam_rig.extras import libraries_named, require, source_date
from cam_rig.files import check_place, writing
from cam_rig.interrupts import raised
from cam_rig.show.result import Progress as Steps
from cam_rig.show.result import Result
from cam_rig.show.terminal import console, say, show

# What all verbs share: where words and tables go, and how errors end a command.

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.progress import Progress


@contextmanager
def user_errors() -> Iterator[None]:
    """End the command with one line and the error's code, or an interrupt's; no more is caught."""
    try:
        source_date()  # libraries that a command imports end at what is none
        with libraries_named(), raised():
            yield
    except CamRigError as error:
        print(f"cam-rig: {error.in_command}", file=sys.stderr)
        raise typer.Exit(error.exit_code) from None
    except KeyboardInterrupt as interrupt:
        print(f"cam-rig: {str(interrupt) or 'interrupted'}", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None


def progress_bar() -> Progress:
    """A bar with ticks done, ticks in all and the time left."""
    from rich import progress  # a tenth of what `--help` costs

    columns = (progress.BarColumn(), progress.MofNCompleteColumn(), progress.TimeRemainingColumn())
    words = progress.TextColumn("{task.description}")
    return progress.Progress(words, *columns, console=console, transient=True)


class Bar(Steps):
    """Tells how far a computation is by a bar, on a terminal."""

    def __init__(self) -> None:
        self._bar: Progress | None = None
        self._task: Any = None

    def begin(self, total: int | None, words: str = "") -> None:
        """A bar of its own in place of the one before; none where there is no terminal."""
        if self._bar is not None:
            self._bar.remove_task(self._task)
        elif console.is_terminal:
            self._bar = progress_bar()
            self._bar.start()
        if self._bar is not None:
            self._task = self._bar.add_task(words, total=total)

    def advance(self, steps: int = 1) -> None:
        """So many more are done."""
        if self._bar is not None:
            self._bar.advance(self._task, steps)

    def tell(self, words: str) -> None:
        """What is at work now."""
        if self._bar is not None:
            self._bar.update(self._task, description=words)

    def end(self) -> None:
        """Take it away."""
        if self._bar is not None:
            self._bar.stop()


#: Kinds of picture a plot can be written as.
PICTURES = (".png", ".svg", ".pdf", ".jpg")
#: In place of a file.
STDOUT = Path("-")


def write_plot(target: Path, figure: Callable[[], Figure]) -> None:
    """Draw a figure into a file, of any kind that matplotlib knows; say where it is."""
    from cam_rig.show.figure import write

    with writing(target) as part:
        write(figure(), part)
    console.print(f"plot: {target}", markup=False, soft_wrap=True)


def write_json(data: dict[str, Any], target: str | None) -> None:
    """Write JSON to a file, to stdout for ``-``, nowhere for None."""
    text = json.dumps(data, indent=2)
    if target == "-":
        print(text)
    elif target is not None:
        with writing(Path(target)) as part:
            part.write_text(text + "\n", encoding="utf-8")


def check_outputs(json_target: str | None, plot: Path | None, csv: Path | None = None) -> None:
    """Refuse, before anything runs, what could not be written afterwards."""
    if json_target == "-" and csv == STDOUT:
        raise ConfigError("--json - and --csv -: both go to stdout; allowed: one of them there")
    if plot is not None and plot.suffix.lower() not in PICTURES:
        raise ConfigError(f"{plot}: unknown kind of picture; allowed: {', '.join(PICTURES)}")
    if plot is not None:
        require("matplotlib")
    for target in (plot, csv, None if json_target is None else Path(json_target)):
        if target not in (None, STDOUT):
            check_place(target)


def check_recording(target: Path) -> None:
    """Refuse, before anything is computed, a Rerun recording that could not be written."""
    require("rerun")
    check_place(target)
    if target.suffix != ".rrd":
        raise ConfigError(f"{target}: unknown kind of recording; allowed: .rrd")


def write_tables(result: Result, target: Path) -> None:
    """Write the first table as CSV, to stdout for ``-``; each other into a file beside it."""
    first, *others = result.tables()
    if target == STDOUT:
        print(first.to_csv(), end="")
        return
    beside = {target.with_suffix(f".{t.key}{target.suffix}"): t for t in others if t.records}
    for path, table in ({target: first} | beside).items():
        with writing(path) as part:
            part.write_text(table.to_csv(), encoding="utf-8")
    if beside:
        say(f"csv: {target}; further tables: {', '.join(map(str, beside))}")


def say_assumed(assumed: Iterable[str]) -> None:
    """Print what no reading tells."""
    say(*(f"assumed: {words}" for words in assumed))


class Command(TyperCommand):
    """As typer's, but that it refuses an option that stands twice where the last would be taken."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Values of the options and arguments; ``--help`` comes first."""
        stand = Counter(self.make_parser(ctx).parse_args(list(args))[2])
        twice = [one for one, count in stand.items() if count > 1 and not one.multiple]
        if twice and not any(one.is_eager for one in stand):
            name = max(twice[0].opts, key=len)
            print(
                f"cam-rig: {name}: stands {stand[twice[0]]} times; allowed: once", file=sys.stderr
            )
            raise typer.Exit(ConfigError.exit_code)
        return super().parse_args(ctx, args)


DEFAULT_SCENE = "tm21_sweep"


# Arguments and options that several commands have, each with one meaning and one help text.

Scene = Annotated[str, typer.Argument(help="Scene file, or a name in config/scenes.")]
SceneOption = Annotated[str, typer.Option(help="Scene file, or a name in config/scenes.")]
TableCams = Annotated[
    list[str] | None,
    typer.Argument(help="Cam files, or names in config/cams; by default those of Table 2."),
]
CamsOrScene = Annotated[
    list[str] | None,
    typer.Argument(
        help="Cam files, or names in config/cams; or one scene: its cams on its rig. By default "
        "the cams of Table 2."
    ),
]
Rig = Annotated[str, typer.Option(help="Rig file, or a name in config/rigs.")]
RigOfCam = Annotated[
    str | None,
    typer.Option(
        help="Rig file, or a name in config/rigs; by default the only one in rigs beside "
        "the cam, else paper_table2."
    ),
]
RigOfScene = Annotated[
    str | None,
    typer.Option(
        help="Rig file, or a name in config/rigs; by default the scene's, for cams the only one in "
        "rigs beside them, else paper_table2."
    ),
]
OtherRig = Annotated[
    str | None, typer.Option("--rig", help="Rig file, or a name in config/rigs; the scene's.")
]
SceneOfBag = Annotated[
    str | None,
    typer.Option(help="Scene that was run, for a bag without one (made by `ros2 bag record`)."),
]
Plot = Annotated[Path | None, typer.Option(help="Write the plot (PNG, SVG, PDF).")]
Csv = Annotated[
    Path | None,
    typer.Option("--csv", metavar="FILE", help="Write the tables as CSV; - for stdout."),
]
Json = Annotated[
    str | None, typer.Option("--json", metavar="FILE", help="Write JSON; - for stdout.")
]
RigOfBag = Annotated[
    str | None, typer.Option("--namespace", help="One rig of a bag that holds several: /rig2.")
]
Namespace = Annotated[
    str, typer.Option(help="Namespace of its nodes and topics, for two rigs side by side.")
]
Jobs = Annotated[
    int | None, typer.Option(metavar="N", min=1, max=1024, help="Processes; by default one a core.")
]
Dask = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Send the work to a Dask cluster: tcp://HOST:PORT, or its scheduler file.",
    ),
]


#: Wall time (s) from line to line on a page's delay, where there is no terminal for a bar.
LINE_EVERY_S = 10.0
#: The options that a command has by what its result can be written as.
OUTPUTS = {"plot": Plot, "csv": Csv, "json": Json}


def command(*outputs: str) -> Callable[[Callable[..., Any]], Callable[..., None]]:
    """Make a function that returns a `Result` a command, with options for those of `OUTPUTS`.

    Targets are looked at before the function runs, and an error that a user can mend ends it in one
    line. The tables are shown, then written as asked. A parameter ``progress`` is no option: it is
    a `Bar`. One named as an output is its target, for a function that may have to refuse it. None
    of a function is a result that it has shown itself.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., None]:
        known = dict(inspect.signature(function).parameters)
        told = known.pop("progress", None) is not None
        looked_at = [name for name in OUTPUTS if known.pop(name, None) is not None]

        @wraps(function)
        def run(**asked: Any) -> None:
            targets = {name: asked.pop(name, None) for name in OUTPUTS}
            plot, csv, target = targets.values()
            asked |= {name: targets[name] for name in looked_at}
            with user_errors():
                check_outputs(target, plot, csv)
                bar = Bar()
                try:
                    result = function(**asked, **({"progress": bar} if told else {}))
                finally:
                    bar.end()
                give_out(result, plot, csv, target)

        options = {name: OUTPUTS[name] for name in outputs}
        hints = get_type_hints(_without(function), vars(inspect.getmodule(function)), None, True)
        run.__annotations__ = hints | options
        run.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
            [one.replace(annotation=hints[name]) for name, one in known.items()]
            + [
                inspect.Parameter(
                    name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=one
                )
                for name, one in options.items()
            ]
        )
        del run.__wrapped__  # type: ignore[attr-defined]  # else typer reads its signature
        return run

    return decorate


def _without(function: Callable[..., Any]) -> Any:
    """What a function is annotated with, but for the types that only its body imports."""
    names = {
        name: hint
        for name, hint in function.__annotations__.items()
        if name not in ("return", "progress", *OUTPUTS)
    }
    return type("Annotated", (), {"__annotations__": names})


def give_out(
    result: Result | None, plot: Path | None, csv: Path | None, json_target: str | None
) -> None:
    """Show a result, write it as asked, and end with its exit code."""
    if result is None:
        return
    show(*result.to_show())
    say(*result.summary())
    say_assumed(result.assumed)
    if csv is not None:
        write_tables(result, csv)
    if plot is not None:
        write_plot(plot, result.plot)
    if json_target is not None:
        write_json(result.data(), json_target)
    if code := INTERRUPTED if result.interrupted else result.exit_code:
        raise typer.Exit(code)
