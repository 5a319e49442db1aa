"""Who installs the rig finds every library it imports: with pip, with rosdep, by the README."""

import ast
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).parents[1]
#: rosdep keys of the libraries whose key is not python3-<name>.
KEYS = {
    "lz4": "mcap-ros2-support",
    "mcap": "mcap-ros2-support",
    "pillow": "python3-pil",
    "pyyaml": "python3-yaml",
    "rosbags": "python3-rosbags-pip",
    "zstandard": "mcap-ros2-support",
}
#: Libraries whose import has another name than the package.
IMPORTED_AS = {"PIL": "pillow", "rerun": "rerun-sdk", "sksundae": "scikit-sundae", "yaml": "pyyaml"}
#: What only the makers of reference numbers import.
MAKERS = {"mpmath"}
IMPORTED_AS |= {"mkdocs": "mkdocs-material", "griffe": "mkdocstrings"}
IMPORTED_AS |= {"ruamel": "ruamel.yaml", "pydantic_core": "pydantic", "mpl_toolkits": "matplotlib"}


def lists_of_setup():
    """The lists of names in setup.py."""
    tree = ast.parse((ROOT / "setup.py").read_text())
    found = {}
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.List):
            names = [re.split(r"[>=\[]", str(ast.literal_eval(e)))[0] for e in node.value.elts]
            found[node.targets[0].id] = set(names)
    return found


def declared():
    """The rosdep keys of package.xml, and what its comments say has none."""
    text = (ROOT / "package.xml").read_text()
    keys = {e.text for e in ElementTree.fromstring(text).iter("exec_depend")}
    without = re.findall(r"No rosdep keys? exists? for [^:]*: pip install ([^>]*?)\. -->", text)
    return keys, [set(words.split()) for words in without]


def imported(folder="cam_rig"):
    """Top-level names that a folder imports, without Python's own and the project's."""
    names = set()
    for path in (ROOT / folder).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                names.add(node.module.split(".")[0])
    return names - set(sys.stdlib_module_names) - {"cam_rig", "tools"}


def test_what_is_imported_is_declared():
    """By setup.py or, for ROS's own packages, by package.xml."""
    lists, (keys, _) = lists_of_setup(), declared()
    known = lists["RUNTIME"] | lists["BENCH"] | keys
    missing = {n for n in imported() if IMPORTED_AS.get(n, n) not in known}
    assert missing - {"builtin_interfaces"} == MAKERS <= lists["TEST"]


def test_what_the_tools_import_is_declared():
    """By setup.py: what draws and builds the documents is no part of the package."""
    lists = lists_of_setup()
    known = lists["RUNTIME"] | lists["TEST"] | lists["DOCS"]
    assert {IMPORTED_AS.get(n, n) for n in imported("tools")} <= known


def test_rosdep_and_pip_install_the_same():
    """Every library of setup.py has a rosdep key in package.xml, or is named as one that has none;
    no key is left of one that is needed no more.
    """
    runtime, (keys, (without, *_)) = lists_of_setup()["RUNTIME"], declared()
    by_key = {KEYS.get(name, f"python3-{name}") for name in runtime - without}
    assert by_key <= keys
    assert {key for key in keys if key.startswith("python3-")} <= by_key
    assert without <= runtime


def test_the_documents_name_what_rosdep_cannot_install():
    """The line of pip for ROS 2 has every library without a key."""
    page = (ROOT / "docs" / "nodes.md").read_text(encoding="utf-8")
    line = re.search(r"pip install (.*?)\s+# no rosdep key", page)
    named = {re.split(r"[>=]", word.strip("'"))[0] for word in line[1].split()}
    _, (without, *_) = declared()
    assert without <= named <= without | {"pydantic"}
