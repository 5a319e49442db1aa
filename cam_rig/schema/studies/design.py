"""A design file: a goal, limits and a class of laws, beside the cam and the rig they are for."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field, model_validator

from cam_rig.schema.load import load, read_yaml
from cam_rig.schema.quantity import Strict


class ClassConfig(Strict):
    """B-splines of a degree in equal pieces of each event; ``joints`` such as C3."""

    pieces: int = Field(default=16, strict=True)
    joints: str = "C3"
    degree: int | None = Field(default=None, strict=True)


class DesignConfig(Strict):
    """One design file; ``start`` and ``rig`` are files (from where one is), or shipped names."""

    start: str
    rig: str = "paper_table2"
    name: str | None = Field(default=None, pattern=r"^[a-z][a-z0-9_]*$")
    minimise: str | None = None
    maximise: str | None = None
    limits: list[str] = Field(default_factory=list)
    keep: list[str] = Field(default_factory=lambda: ["events", "dwells", "lift"])
    starts: int = Field(default=8, strict=True)
    seed: int = Field(default=1, strict=True)
    class_: ClassConfig = Field(default=ClassConfig(), alias="class")

    @model_validator(mode="after")
    def _one_goal(self) -> DesignConfig:
        if (self.minimise is None) == (self.maximise is None):
            raise ValueError("minimise, maximise: allowed: exactly one of them")
        return self


def load_design(path: Path) -> DesignConfig:
    """Read a design file.

    Raises
    ------
    ConfigError : one line that names file, key, value and what is allowed
    """
    return load(path, DesignConfig)


def is_design(path: Path) -> bool:
    """Whether a file is a design and not a cam."""
    if not path.is_file():
        return False
    data = read_yaml(path)
    return isinstance(data, dict) and "start" in data
