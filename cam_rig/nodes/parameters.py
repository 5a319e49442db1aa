"""Declaring parameters: type, default, description, and whether they may change."""

from __future__ import annotations

from pathlib import Path

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from cam_rig.schema.load import config_root


def declare_text(node: Node, name: str, default: str, description: str, live: bool = False) -> str:
    """Declare a text parameter and return its value."""
    descriptor = ParameterDescriptor(description=description, read_only=not live)
    value: str = node.declare_parameter(name, default, descriptor).value
    return value


def declare_flag(node: Node, name: str, default: bool, description: str) -> bool:
    """Declare a true-or-false parameter and return its value."""
    descriptor = ParameterDescriptor(description=description, read_only=True)
    value: bool = node.declare_parameter(name, default, descriptor).value
    return value


def declare_number(node: Node, name: str, default: float, description: str) -> float:
    """Declare a number and return its value."""
    descriptor = ParameterDescriptor(description=description, read_only=True)
    value: float = node.declare_parameter(name, default, descriptor).value
    return value


def declare_names(node: Node, name: str, default: list[str], description: str) -> list[str]:
    """Declare a list of names and return its value."""
    descriptor = ParameterDescriptor(description=description, read_only=True)
    value: list[str] = node.declare_parameter(name, default, descriptor).value
    return list(value)


def declare_scene(node: Node) -> Path:
    """Declare ``scene``, the file every node takes its numbers from."""
    default = config_root() / "scenes" / "tm21_sweep.yaml"
    return Path(declare_text(node, "scene", str(default), "scene file (YAML)"))
