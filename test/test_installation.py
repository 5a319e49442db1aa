"""What installs the rig on ROS 2 agrees with the project: requirements, Dockerfile, the page.

No image is built here. What can be wrong in one without being built is: a file or a library that is
not there, a version that nobody tried, steps other than the page's.
"""

import json
import os
import re
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import yaml

from .test_packages import ROOT, lists_of_setup

DOCKER = ROOT / "docker"
PAGE = (ROOT / "docs" / "installation.md").read_text(encoding="utf-8")
#: Libraries of setup.py that Ubuntu 24.04 has in a version that is new enough.
FROM_UBUNTU = {"ezdxf", "jinja2", "matplotlib", "numpy", "pyyaml", "rich", "scipy", "shapely"}
#: Debian packages that a step needs beside ROS's own image, and rosdep's keys.
APT = {"python3-venv"}


def pinned(path):
    """Versions by name."""
    return dict(re.findall(r"^([\w.-]+)==(\S+)", path.read_text(encoding="utf-8"), re.M))


def instructions():
    """Of the Dockerfile: each with its words, lines joined."""
    text = (DOCKER / "Dockerfile").read_text(encoding="utf-8")
    text = re.sub(r"^#.*\n", "", text, flags=re.M).replace("\\\n", " ")
    return [line.split(maxsplit=1) for line in text.splitlines() if line]


def steps():
    """The single commands of all RUN lines."""
    runs = [words for kind, words in instructions() if kind == "RUN"]
    return [re.sub(r"\s+", " ", step).strip() for run in runs for step in run.split("&&")]


def copied():
    """What the Dockerfile copies, by its source."""
    found = {}
    for kind, words in instructions():
        if kind == "COPY":
            *sources, target = [word for word in words.split() if not word.startswith("--")]
            found |= dict.fromkeys(sources, target)
    return found


def test_pip_installs_what_ubuntu_has_not_in_the_versions_of_the_lock():
    """Every library of the rig comes from one of both, but for those that need NumPy 2, what
    serves them alone, and numba, without which the same results take longer."""
    lists, asked = lists_of_setup(), pinned(ROOT / "requirements-ros.txt")
    assert asked.items() <= pinned(ROOT / "requirements.lock").items()
    left_out = {"numba", "pyarrow", "rerun-sdk", "salib"}
    assert set(asked) | FROM_UBUNTU == (lists["CORE"] | lists["ALL"]) - left_out
    assert not set(asked) & FROM_UBUNTU


def test_the_page_gives_the_versions_of_the_lock():
    """All that it tells to install with pip, and none of what was not asked for."""
    said = dict(re.findall(r"([\w-]+)==([\w.]+)", PAGE))
    assert said.items() <= pinned(ROOT / "requirements.lock").items()
    assert set(pinned(ROOT / "requirements-ros.txt")) <= set(said)


def test_all_that_the_image_copies_is_there():
    """And all that setup.py reads is copied to where it is looked for."""
    sources = copied()
    assert all((ROOT / source).exists() for source in sources)
    setup = (ROOT / "setup.py").read_text(encoding="utf-8")
    needed = {"cam_rig", "package.xml", "resource", "setup.py", "setup.cfg"}
    needed |= set(re.findall(r'\*share\("(\w+)"\)', setup))
    assert needed <= set(sources)
    for name in needed:
        target = sources[name]
        assert target in {"src/cam_rig/", f"src/cam_rig/{name}"}
        assert (ROOT / name).is_file() == target.endswith("/")


def test_the_image_takes_the_steps_of_the_page():
    """rosdep, the environment, pip and colcon, with the same options."""
    done = [step.replace("apt-get", "apt") for step in steps()]
    for step in ("rosdep install", "python3 -m venv", "venv/bin/python -m"):
        taken = [one for one in done if one.startswith(step)]
        assert taken
        for command in taken:
            plain = command.replace(" --no-cache-dir", "").replace(" --symlink-install", "")
            assert plain in PAGE.replace(" --symlink-install", ""), command


def test_the_image_installs_nothing_unknown():
    """From apt what the page names, from pip the requirements; every skipped key is one of ours."""
    apt = [step for step in steps() if step.startswith("apt-get install")]
    names = {word for step in apt for word in step.split()[2:] if not word.startswith("-")}
    assert names == APT
    assert all(f" {name}" in PAGE for name in names)
    pip = [step for step in steps() if " pip install" in step]
    assert pip and all(re.search(r"-r src/cam_rig/requirements-ros\.txt$", step) for step in pip)
    package = ElementTree.parse(ROOT / "package.xml")
    keys = {e.text for kind in ("exec_depend", "test_depend") for e in package.iter(kind)}
    skipped = set(re.findall(r'--skip-keys "([^"]*)"', PAGE)[0].split())
    skipped |= set(re.findall(r"--skip-keys ([\w.-]+)", PAGE))
    assert skipped and skipped <= keys


def test_the_image_starts_a_launch_file_that_there_is():
    """On a base of a distribution that the page names, through a script that a shell can read."""
    found = dict(instructions())
    assert found["FROM"] == "ros:${DISTRO}-ros-base"
    assert found["ARG"] == "DISTRO=kilted"
    assert "Kilted and Jazzy" in PAGE
    assert json.loads(found["ENTRYPOINT"]) == [copied()["docker/entrypoint.sh"]]
    _, _, package, launch, *_ = json.loads(found["CMD"])
    assert package == "cam_rig" and (ROOT / "launch" / launch).is_file()
    entry = DOCKER / "entrypoint.sh"
    assert os.access(entry, os.X_OK)
    subprocess.run(["bash", "-n", str(entry)], check=True, timeout=100)


def test_compose_builds_that_image():
    """With its arguments, room in shared memory, and the bags outside."""
    (rig,) = yaml.safe_load((DOCKER / "compose.yaml").read_text(encoding="utf-8"))[
        "services"
    ].values()
    context = (DOCKER / rig["build"]["context"]).resolve()
    assert context == ROOT
    assert (context / rig["build"]["dockerfile"]) == DOCKER / "Dockerfile"
    assert set(rig["build"]["args"]) == {"DISTRO"}
    assert rig["shm_size"] == "256m"
    (volume,) = rig["volumes"]
    assert (
        Path(volume.split(":")[1])
        in Path(json.loads(dict(instructions())["CMD"])[-1].split("=")[1]).parents
    )
