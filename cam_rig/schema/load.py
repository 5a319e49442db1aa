"""Reading YAML files into config models, with one-line errors that name file and key."""

from __future__ import annotations

import json
import re
import sysconfig
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from cam_rig.arguments import checked
from cam_rig.errors import ConfigError, OutputError, did_you_mean
from cam_rig.files import MIB, check_place, read_bytes, writing
from cam_rig.schema.cam import CamConfig
from cam_rig.schema.explain import explain, kind_of, validate_in_python
from cam_rig.schema.published import PublishedNoise, PublishedTables
from cam_rig.schema.quantity import Quantity
from cam_rig.schema.rig import RigConfig
from cam_rig.schema.scene import SceneConfig
from cam_rig.schema.yaml_text import parse_yaml

Config = TypeVar("Config", bound=BaseModel)
#: Bytes of a YAML file, at most.
MAX_BYTES = MIB
NAME = re.compile(r"[a-z][a-z0-9_]{0,99}")


def config_root() -> Path:
    """The shipped ``config`` folder: the source tree's, else the installed share folder's."""
    shared, above = Path("share/cam_rig/config"), Path(__file__).parents
    places = [above[2] / "config", *(parent / shared for parent in above)]
    found = next((place for place in places if place.is_dir()), None)
    return found or Path(sysconfig.get_path("data")) / shared


def named_path(folder: str, name: str | Path) -> Path:
    """The file that a path means; a word without folder and suffix is one's of a config folder."""
    path = Path(name)
    return path if is_path(name) or is_there(path) else config_root() / folder / f"{name}.yaml"


def is_there(path: Path) -> bool:
    """Whether there is such a file: none has a name that is too long."""
    with suppress(OSError):
        return path.is_file()
    return False


def is_path(name: str | Path) -> bool:
    """Whether a text can only be a path: it has a folder, or the suffix of a YAML file."""
    path = Path(name)
    return path.name != str(name) or path.suffix in (".yaml", ".yml")


def read_yaml(path: Path, most: int = MAX_BYTES) -> Any:
    """The one document of a YAML file of at most ``most`` bytes."""
    try:
        return parse_yaml(read_bytes(path, most).decode("utf-8-sig"))
    except FileNotFoundError:
        raise ConfigError(_not_there(path)) from None
    except IsADirectoryError:
        raise ConfigError(f"{path}: is a folder; allowed: a YAML file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read ({error})") from None
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def _not_there(*paths: Path) -> str:
    """That there is no such file in any of these places, and what there is in their folders."""
    there = sorted({p.stem for path in paths for p in path.parent.glob("*.yaml")})
    known = f"{did_you_mean(paths[-1].stem, there)}; there are: {', '.join(there)}" if there else ""
    return f"{', '.join(map(str, paths))}: no such file{known}"


def _first(places: list[Path]) -> Path:
    """The first of some places in which there is a file."""
    found = next((path for path in places if path.is_file()), None)
    if found is None:
        raise ConfigError(_not_there(*places))
    return found


def load(path: Path, kind: type[Config]) -> Config:
    """Read and check one file."""
    data = read_yaml(path)
    if not isinstance(data, dict):
        raise ConfigError(
            f"{path}: holds {kind_of(data)}; allowed: a mapping with the keys "
            f"{', '.join(kind.model_fields)}"
        )
    try:
        return kind.model_validate(data, context={"folder": path.parent})
    except ValidationError as error:
        raise ConfigError(f"{path}: {explain(error, kind)}") from None


@dataclass(frozen=True)
class Library:
    """The folders that the names in a file refer to, the file's own before the shipped one."""

    roots: tuple[Path, ...]
    here: Path = Path()  # what paths in the file are relative to: its folder

    @classmethod
    def beside(cls, scene: Path) -> Library:
        """For a scene in ``X/scenes/``: names are looked up in ``X``, then in ``config``."""
        own = scene.absolute().parent.parent
        return cls(tuple(dict.fromkeys((own, config_root()))), scene.parent)

    def path(self, folder: str, name: str) -> Path:
        """The file ``folder/name.yaml`` of the first root that has it; it must be a plain name."""
        return _first(self._places(folder, name))

    def file(self, folder: str, name: str) -> Path:
        """The file that a path means, or as `path` the one that a name does; it must be there."""
        return _first([self.here / name] if is_path(name) else self._places(folder, name))

    def _places(self, folder: str, name: str) -> list[Path]:
        if not NAME.fullmatch(name):
            raise ConfigError(
                f"{folder}: is {name[:40]!r}; allowed: a name of up to 100 small letters, digits "
                "and _, a letter first"
            )
        return [root / folder / f"{name}.yaml" for root in self.roots]


# One file of a folder of ``config``, read and checked.
load_cam = partial(load, kind=CamConfig)
load_rig = partial(load, kind=RigConfig)
load_scene = partial(load, kind=SceneConfig)
load_published = partial(load, kind=PublishedNoise)
load_tables = partial(load, kind=PublishedTables)
# Its path: of a path that a command is given, or of the name of a shipped one.
scene_path = partial(named_path, "scenes")
cam_path = partial(named_path, "cams")
rig_path = partial(named_path, "rigs")


def rig_beside(rig: str | Path, scene: Path) -> Path:
    """A rig by its path, or by its name beside a scene, then in ``config/rigs``."""
    path = named_path("rigs", rig)
    return path if path == Path(rig) else Library.beside(scene).path("rigs", str(rig))


def tables_path() -> Path:
    """The paper's tables as data."""
    return config_root() / "published" / "tables" / "paper.yaml"


def one_scene(names: Sequence[Any] | None) -> Path | None:
    """The scene's file that is named in place of cams; None where cams are, by name or as such."""
    if not names or len(names) > 1 or not isinstance(names[0], str | Path):
        return None
    path = scene_path(names[0])
    data = read_yaml(path) if is_there(path) else None
    return path if isinstance(data, dict) and "program" in data else None


#: Keys of a config file that say where a number comes from.
WORDS = frozenset({"source", "residual"})


def same_as_shipped(cam: CamConfig, without: frozenset[str] = WORDS) -> bool:
    """Whether a cam moves as the shipped one of its name does."""
    path = config_root() / "cams" / f"{cam.name}.yaml"
    if not path.is_file():
        return False
    one, other = (bare([each.lift, each.segments], without) for each in (cam, load_cam(path)))
    return bool(one == other)


def bare(value: Any, without: frozenset[str]) -> Any:
    """Plain data without some of its keys."""
    if isinstance(value, BaseModel):
        value = value.model_dump()
    if isinstance(value, dict):
        return {k: bare(v, without) for k, v in value.items() if k not in without}
    return [bare(v, without) for v in value] if isinstance(value, list | tuple) else value


def quantity(
    origin: str, value: float | list[float], unit: str, source: str, residual: str = ""
) -> dict[str, Any]:
    """A number as the rig's files have it."""
    words = {"residual": residual} if residual else {}
    return {origin: value, "unit": unit, "source": source, **words}


def assumed_numbers(section: BaseModel, source: str) -> dict[str, Any]:
    """The numbers of a rig's follower or radiation as another's file has them: all assumed."""
    return {
        key: quantity("assumed", number.raw, number.unit, source)
        for key, number in section
        if isinstance(number, Quantity)
    }


def to_yaml(data: dict[str, Any]) -> str:
    """A file of the rig: a number is one line, and so is a follower's or a segment's key."""
    return "\n".join(_lines(data, 0)) + "\n"


def file_data(model: BaseModel) -> dict[str, Any]:
    """What a model's file holds: nothing that is left out, no empty words."""
    found: dict[str, Any] = _without_empty(model.model_dump(exclude_none=True))
    return found


def _without_empty(value: Any) -> Any:
    if isinstance(value, dict):
        kept = ((key, _without_empty(one)) for key, one in value.items())
        return {key: one for key, one in kept if one not in ("", [], {})}
    return [_without_empty(one) for one in value] if isinstance(value, list | tuple) else value


@checked
def save_model(model: BaseModel, path: str | Path, overwrite: bool = False) -> None:
    """Write a cam or a rig under the name of its file, a table's points beside it."""
    target = Path(path)
    if target.suffix != ".yaml":
        raise ConfigError(f"{target}: unknown kind of file; allowed: a name that ends in .yaml")
    named = validate_in_python(type(model), {**dict(model), "name": target.stem}, str(target))
    data = file_data(named)
    check_place(target)
    points = target.with_suffix(".csv")
    tables = [segment for segment in data.get("segments", ()) if "file" in segment]
    for file in (target, points) if tables else (target,):
        if file.exists() and not overwrite:
            raise OutputError(
                f"{file}: exists already, not overwriting; name another, or say overwrite=True"
            )
    for segment in tables:
        table, segment["file"] = segment["file"], points.name
        rows = zip(table["angles"], table["lifts"], strict=True)
        text = "angle_rad,lift_m\n" + "".join(f"{a!r},{s!r}\n" for a, s in rows)
        with writing(points) as part:
            part.write_text(text, encoding="utf-8")
    with writing(target) as part:
        part.write_text(to_yaml(data), encoding="utf-8")


def _lines(data: dict[str, Any], indent: int) -> list[str]:
    space, out = " " * indent, []
    for key, value in data.items():
        if isinstance(value, dict) and "unit" not in value:
            out += [f"{space}{key}:", *_lines(value, indent + 2)]
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            out.append(f"{space}{key}:")
            for item in value:
                first, *rest = _lines(item, indent + 4)
                out += [f"{space}  - {first.lstrip()}", *rest]
        else:
            out.append(f"{space}{key}: {_flow(value)}")
    return out


def _flow(value: Any) -> str:
    """A value in one line; JSON's texts are YAML's."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, str) and value.replace("_", "").isalnum() and not value[0].isdigit():
        return value
    return json.dumps(value, ensure_ascii=False)


def valid_cam(data: dict[str, Any]) -> CamConfig:
    """The cam that a file of this content has."""
    try:
        return CamConfig.model_validate(data)
    except ValidationError as error:
        raise ConfigError(f"{data['name']}: {explain(error, CamConfig)}") from None
