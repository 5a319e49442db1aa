"""The package keeps its layout: a name is defined once, and files and functions stay readable."""

import ast
import tomllib
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = {path: path.read_text(encoding="utf-8") for path in (ROOT / "cam_rig").rglob("*.py")}
MAX_FILE, MAX_FUNCTION = 450, 60
#: Where a statement has others.
PARTS = ("body", "orelse", "handlers", "finalbody", "cases")


def defined(node):
    """The classes and functions in a module, also in each other."""
    for child in (one for part in PARTS for one in getattr(node, part, ())):
        if isinstance(child, ast.ClassDef | ast.FunctionDef):
            yield child
        yield from defined(child)


@pytest.fixture(scope="module")
def nodes():
    """Every class and function of the package, with its file."""
    return [(path, node) for path, text in PACKAGE.items() for node in defined(ast.parse(text))]


def test_a_class_name_is_defined_once(nodes):
    """Who reads or searches for a class finds the one there is."""
    names = Counter(node.name for _, node in nodes if isinstance(node, ast.ClassDef))
    assert {name: count for name, count in names.items() if count > 1} == {}


def test_no_file_is_too_long_to_read():
    """One thought a file: at most 450 lines."""
    lines = {str(path): len(text.splitlines()) for path, text in PACKAGE.items()}
    assert {path: count for path, count in lines.items() if count > MAX_FILE} == {}


def test_no_function_is_longer_than_a_screen(nodes):
    """At most 60 lines, its docstring included."""
    assert {
        f"{path}:{node.name}": node.end_lineno - node.lineno + 1
        for path, node in nodes
        if isinstance(node, ast.FunctionDef) and node.end_lineno - node.lineno >= MAX_FUNCTION
    } == {}


def test_no_name_is_sought_among_too_many():
    """A folder below the package's own holds at most 20 entries, its __init__ included."""
    folders = [path for path in (ROOT / "cam_rig").rglob("*") if path.is_dir()]
    counts = {
        str(folder): len([p for p in folder.iterdir() if p.suffix == ".py" or p.is_dir()])
        for folder in folders
        if folder.name != "__pycache__"
    }
    assert {folder: count for folder, count in counts.items() if count > 20} == {}


def test_every_slice_is_under_the_contract_of_slices():
    """Whoever adds a folder to the experiments or the fits names it where imports are checked."""
    read = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (containers,) = (
        set(one["containers"])
        for one in read["tool"]["importlinter"]["contracts"]
        if "(command)" in one.get("layers", ())
    )
    slices = {
        ".".join(path.parent.relative_to(ROOT).parts)
        for room in ("paper", "measured")
        for path in (ROOT / "cam_rig" / room).glob("*/command.py")
    }
    assert slices - containers == set()
