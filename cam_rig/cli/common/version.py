"""What `cam-rig --version` prints: what is installed, read without importing it."""

from __future__ import annotations

import os
import re
from importlib.metadata import PackageNotFoundError, distributions, version
from pathlib import Path

import typer

MISSING = "not installed"


def print_versions(wanted: bool) -> None:
    """Print one line each and end, where the option is given."""
    if wanted:
        typer.echo("\n".join(f"{name} {found}" for name, found in versions().items()))
        raise typer.Exit


def versions() -> dict[str, str]:
    """Versions by name: the package, the viewer, and rclpy with its ROS distribution."""
    rclpy = _installed("rclpy")
    return {
        "cam_rig": _installed("cam_rig"),
        "rerun": _installed("rerun-sdk"),
        "rclpy": rclpy if rclpy == MISSING else f"{rclpy} (ROS 2 {_distribution()})",
    }


def _installed(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return MISSING


def _distribution() -> str:
    """The ROS distribution: of the wheels, of the sourced installation, or of the folder."""
    wheels = (re.fullmatch(r"ros-([a-z]+)-rclpy", d.name) for d in distributions() if d.name)
    if found := next((match for match in wheels if match), None):
        return found[1]
    if sourced := os.environ.get("ROS_DISTRO"):
        return sourced
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    return next((Path(p).name for p in prefixes if "ros" in Path(p).parts), "of unknown name")
