"""Arguments and options that several commands have, each with one meaning and one help text."""

from pathlib import Path
from typing import Annotated

import typer

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
RigOfScene = Annotated[
    str | None,
    typer.Option(
        help="Rig file, or a name in config/rigs; by default the scene's, for cams the only one in "
        "the folder rigs beside theirs, else paper_table2."
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
Namespace = Annotated[
    str, typer.Option(help="Namespace of its nodes and topics, for two rigs side by side.")
]
Jobs = Annotated[
    int | None,
    typer.Option(metavar="N", min=1, max=1024, help="Processes; by default one a core."),
]
Dask = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Send the work to a Dask cluster: tcp://HOST:PORT, or its scheduler file.",
    ),
]
