"""Writing identified numbers back into a YAML file, keeping its comments and layout."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from cam_rig.errors import ConfigError


def set_identified(
    path: Path, numbers: dict[tuple[str | int, ...], float], source: str, residual: str
) -> None:
    """Put numbers in as ``identified``, with source and residual; the file is replaced whole.

    Parameters
    ----------
    numbers : key path -> number, in the unit the file already has there

    Raises
    ------
    ConfigError : the file cannot be written
    """
    yaml = YAML()
    yaml.width = 4096
    yaml.preserve_quotes = True
    yaml.indent(mapping=2, sequence=4, offset=2)
    data = yaml.load(path)
    for keys, number in numbers.items():
        node: Any = data
        for key in keys:
            node = node[key]
        for origin in ("given", "assumed"):
            node.pop(origin, None)
        if "identified" not in node:
            node.insert(0, "identified", number)
        node["identified"] = number
        node["source"], node["residual"] = source, residual
    part = path.with_suffix(".yaml.part")
    try:
        with part.open("w", encoding="utf-8") as stream:
            yaml.dump(data, stream)
        os.replace(part, path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written ({error.strerror})") from None
    finally:
        part.unlink(missing_ok=True)
