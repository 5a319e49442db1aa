"""Write docs/results.md: tables and keys of every result in JSON, CSV and pandas.

    .venv/bin/python tools/docs/results.py

``make docs`` runs it, and a test compares the page with the code.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import cam_rig
from cam_rig.show.result import Column, Result
from tools.docs.commands import verbs

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "results.md"
#: Commands of results whose schema differs from the name of the command.
COMMANDS_OF_SCHEMA = {
    "bounce_basins": "bounce --basins",
    "fit_arcs": "fit cam TABLES --shape arcs",
    "fit_jumps": "fit rig SOURCE CAM",
    "fit_rig": "fit rig SOURCE CAM",
    "fit_sound": "fit sound LEVELS SCENE",
    "fit_spline": "fit cam TABLES",
    "front": "design START --pareto QUANTITY",
    "law_rises": "law NAMES --rises",
    "panel_marks": "mark",
    "profile_measured": "profile CAM --from FILE",
    "simulate": "simulate, analyze",
}
#: Number of equal last columns of two tables from which on they are listed only once.
REPEATED = 4
#: Head of the table of columns.
TABLE = ("|key|unit|meaning|", "|---|---|---|")
HEAD = """# Results

This page lists every number that a command writes or a Python function returns.

A result consists of tables of records. `--json` writes its tables by their keys. `--csv` writes the
first table, and each other table into a file next to it. `to_pandas("key")` returns one table as a
`DataFrame`. All three use the keys and the SI units of this page, independent of the units on the
terminal. A value that is not a number is `null` in JSON and empty in CSV. A table of one record is
an object in JSON.

In JSON, `schema` contains the name and the version. The version increases when a key changes its
meaning or is removed. A new key does not increase it. `tools/docs/results.py` makes this page from
the code.

The name of a table is its key, followed by a row for each column. The meaning contains the
displayed heading if it differs from the key. A number without a unit is a ratio or a count.
"""


def results() -> list[type[Result]]:
    """Return every result class of the package, by its schema."""
    for file in sorted((ROOT / "cam_rig").rglob("*.py")):
        if 'schema = "cam_rig.' in file.read_text(encoding="utf-8"):
            import_module(".".join(file.relative_to(ROOT).with_suffix("").parts))
    own = (kind for kind in _subclasses(Result) if kind.__module__.startswith("cam_rig."))
    return sorted({kind for kind in own if kind.schema}, key=lambda kind: kind.schema)


def _subclasses(kind: type[Result]) -> Iterator[type[Result]]:
    for subclass in kind.__subclasses__():
        yield subclass
        yield from _subclasses(subclass)


def sources_of(result: type[Result]) -> list[str]:
    """Return the commands and the functions of `import cam_rig` that return a result."""
    _, name, _ = result.schema.split(".")
    functions = (getattr(cam_rig, word) for word in cam_rig.__all__ if word[0] != "_")
    calls = [
        f"cam_rig.{function.__name__}"
        for function in functions
        if inspect.isfunction(function)
        and result.__name__ in str(function.__annotations__.get("return")).split(" | ")
    ]
    named = {verb.replace("-", "_").replace(" ", "_"): verb for verb in verbs()}
    commands = COMMANDS_OF_SCHEMA.get(name, named.get(name, ""))
    return [f"cam-rig {command}" for command in commands.split(", ") if command] + calls


def page() -> str:
    """Return the whole page as Markdown."""
    return "\n\n".join([HEAD.strip(), *(section(result) for result in results())]) + "\n"


def section(result: type[Result]) -> str:
    """Return the section of a result: schema, commands and tables."""
    sources = ", ".join(f"`{source}`" for source in sources_of(result))
    first = inspect.cleandoc(result.__doc__ or "").split("\n\n")[0].replace("\n", " ")
    parts = [f"## {result.schema}", f"{sources}: {first}"]
    tables, before = [], dict[str, list[str]]()
    for key, columns in result.columns.items():
        rows = [_row(column) for column in columns]
        tables.append("\n".join([f"**{key}**", "", *TABLE, *_without_repeated(rows, before)]))
        before[key] = rows
    return "\n\n".join(part.replace("``", "`") for part in [*parts, *tables])


def _row(column: Column) -> str:
    """Return the row of a column: key, unit, and heading if it differs from the key."""
    unit = column.si_unit if column.si_unit not in ("1", column.key) else ""
    heading = re.sub(r"\s+", " ", column.heading.replace("{}", "…")).strip()
    texts = [heading, re.sub(r"\s+", " ", column.doc)]
    texts = [text for text in texts if text and not _words(text) <= _words(column.key)]
    return f"|`{column.key}`|{unit}|{': '.join(texts).replace('|', chr(92) + '|')}|"


def _words(text: str) -> set[str]:
    """Return the words of a key or of a heading."""
    parts = re.split(r"[\s_,-]+", text.lower().replace(".", ""))
    return {part for part in parts if part}


def _without_repeated(rows: list[str], before: dict[str, list[str]]) -> list[str]:
    """Return the rows without last rows that are equal to those of an earlier table."""
    for table, others in before.items():
        same = 0
        for row, other in zip(reversed(rows), reversed(others), strict=False):
            if row != other:
                break
            same += 1
        if same >= REPEATED:
            first = others[-same].split("`")[1]
            return [*rows[:-same], f"|from `{first}` on||as in {table}|"]
    return rows


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
