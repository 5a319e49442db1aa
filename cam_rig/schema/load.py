"""Reading and writing of YAML files, with one-line errors that name file and key."""

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

from pydantic import BaseModel

from cam_rig.arguments import check_arguments
from cam_rig.errors import ConfigError, OutputError, did_you_mean
from cam_rig.files import MIB, atomic_write, check_writable, read_bytes
from cam_rig.schema.cam import CamConfig
from cam_rig.schema.explain import describe_type, validate_data, validate_in_python
from cam_rig.schema.published import PublishedNoise, PublishedTables
from cam_rig.schema.quantity import Quantity
from cam_rig.schema.rig import RigConfig
from cam_rig.schema.scene import SceneConfig
from cam_rig.schema.yaml_text import parse_yaml

Config = TypeVar("Config", bound=BaseModel)
#: Largest size of a YAML file in bytes.
MAX_BYTES = MIB
#: Pattern of the name of a config file, without its suffix.
NAME = re.compile(r"[a-z][a-z0-9_]{0,99}")
#: Pattern of a top-level key of a YAML file.
TOP_LEVEL_KEY = re.compile(r"(?m)^(\w+):")


def config_root() -> Path:
    """Return the shipped folder ``config``, of the source tree or the installation."""
    shared, parents = Path("share/cam_rig/config"), Path(__file__).parents
    folders = [parents[2] / "config", *(parent / shared for parent in parents)]
    folder = next((folder for folder in folders if folder.is_dir()), None)
    return folder or Path(sysconfig.get_path("data")) / shared


def resolve_path(folder: str, name: str | Path) -> Path:
    """Return the path of a config file from its path or its shipped name.

    `name` is the path of a file. If there is no such file, a name without folder and suffix is that
    of a file in the folder `folder` of ``config``.
    """
    path = Path(name)
    return path if is_path(name) or file_exists(path) else config_root() / folder / f"{name}.yaml"


def file_exists(path: Path) -> bool:
    """Return True if a file exists."""
    with suppress(OSError):  # the name may be too long
        return path.is_file()
    return False


def is_path(name: str | Path) -> bool:
    """Return True if a text is a path: it has a folder, or the suffix of a YAML file."""
    path = Path(name)
    return path.name != str(name) or path.suffix in (".yaml", ".yml")


def read_yaml(path: Path, max_bytes: int = MAX_BYTES) -> Any:
    """Return the only document of a YAML file of at most `max_bytes`.

    Raise ConfigError if the file cannot be read, or is not YAML.
    """
    try:
        return parse_yaml(read_bytes(path, max_bytes).decode("utf-8-sig"))
    except FileNotFoundError:
        raise ConfigError(_missing_text(path)) from None
    except IsADirectoryError:
        raise ConfigError(f"{path}: is a folder; allowed: a YAML file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read ({error})") from None
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def _missing_text(*paths: Path) -> str:
    """Return the message for a missing file, with the names of existing files."""
    names = sorted({p.stem for path in paths for p in path.parent.glob("*.yaml")})
    listing = f"{did_you_mean(paths[-1].stem, names)}; there are: {', '.join(names)}"
    return f"{', '.join(map(str, paths))}: no such file{listing if names else ''}"


def _first_file(paths: list[Path]) -> Path:
    """Return the first path that is a file. Raise ConfigError if no path is a file."""
    path = next((path for path in paths if path.is_file()), None)
    if path is None:
        raise ConfigError(_missing_text(*paths))
    return path


def load(path: Path, kind: type[Config]) -> Config:
    """Read a config file and validate its content.

    Parameters
    ----------
    path : Path
        Path of the file.
    kind : subclass of BaseModel
        Config model of the file.

    Returns
    -------
    Config
        Object of the model.

    Raises
    ------
    ConfigError
        If the file cannot be read, or a key or value is wrong. The message names the file and the
        key.
    """
    data = read_yaml(path)
    if not isinstance(data, dict):
        raise ConfigError(
            f"{path}: contains {describe_type(data)}; allowed: a mapping with the keys "
            f"{', '.join(kind.model_fields)}"
        )
    return validate_data(kind, data, path, path.parent)


@dataclass(frozen=True)
class Library:
    """Folders in which names of files are searched for, in this order."""

    roots: tuple[Path, ...]  #: folders like ``config``
    folder: Path = Path()  #: folder of the file, to which paths in it are relative
    neighbours: tuple[Path, ...] = ()  #: folders whose cams and rigs are not in subfolders

    @classmethod
    def next_to(cls, *files: Path, folder: Path = Path()) -> Library:
        """Return the folders for files in ``X/scenes/`` or ``X/cams/``.

        These are ``X``, the folders of the files themselves, and ``config``.
        """
        roots = [file.absolute().parent.parent for file in files]
        neighbours = dict.fromkeys(file.absolute().parent for file in files)
        return cls(tuple(dict.fromkeys((*roots, config_root()))), folder, tuple(neighbours))

    @classmethod
    def for_scene(cls, scene: Path) -> Library:
        """Return the folders for a scene, see `next_to`."""
        return cls.next_to(scene, folder=scene.parent)

    def path(self, folder: str, name: str) -> Path:
        """Return the path of ``folder/name.yaml`` in the first root that contains it.

        Raise ConfigError if `name` is not a plain name, or the file does not exist.
        """
        return _first_file(self._candidates(folder, name))

    def file(self, folder: str, name: str) -> Path:
        """Return the path of an existing file from its path or its name, see `path`."""
        paths = [self.folder / name] if is_path(name) else self._candidates(folder, name)
        return _first_file(paths)

    def _candidates(self, folder: str, name: str) -> list[Path]:
        """Return the possible paths of ``folder/name.yaml``."""
        if not NAME.fullmatch(name):
            raise ConfigError(
                f"{folder}: is {name[:40]!r}; allowed: a name of up to 100 small letters, digits "
                "and _, a letter first"
            )
        *roots, shipped = [root / folder / f"{name}.yaml" for root in self.roots]
        near = [path / f"{name}.yaml" for path in self.neighbours]
        return [*roots, *(path for path in near if is_kind(path, folder)), shipped]


#: Folder of a kind of file -> top-level keys that it has, and keys that it has not.
KEYS_OF_KIND = {"cams": ({"segments"}, set[str]()), "rigs": ({"follower"}, {"segments"})}


def is_kind(path: Path, folder: str) -> bool:
    """Return True if a file has the keys of a cam or rig, by the name of the kind's folder.

    The file is not validated.
    """
    required, excluded = KEYS_OF_KIND.get(folder, (set[str](), set[str]()))
    if not required or not file_exists(path) or path.stat().st_size > MAX_BYTES:
        return False
    with suppress(OSError):
        keys = set(TOP_LEVEL_KEY.findall(path.read_text(encoding="utf-8-sig", errors="replace")))
        return required <= keys and not excluded & keys
    return False


# Functions of a path that read and validate a file of a folder of ``config``.
load_cam = partial(load, kind=CamConfig)
load_rig = partial(load, kind=RigConfig)
load_scene = partial(load, kind=SceneConfig)
load_published = partial(load, kind=PublishedNoise)
load_tables = partial(load, kind=PublishedTables)
# Functions that return the path of a file that is given by its path, or by its shipped name.
scene_path = partial(resolve_path, "scenes")
cam_path = partial(resolve_path, "cams")
rig_path = partial(resolve_path, "rigs")


def resolve_rig_path(rig: str | Path, *files: Path) -> Path:
    """Return the path of a rig's file from its path or its name.

    A name is searched for in the folders of rigs next to those of `files`, which are scenes or
    cams, then next to the files themselves, then in ``config/rigs``.
    """
    path = resolve_path("rigs", rig)
    if path == Path(rig) or not files:
        return path
    return Library.next_to(*files).path("rigs", str(rig))


def rigs_next_to(*cams: Path) -> list[Path]:
    """Return the files of rigs in the folders ``../rigs`` and ``.`` of cam files."""
    folders = dict.fromkeys(cam.parent.parent / "rigs" for cam in cams)
    rigs = [file for folder in folders for file in sorted(folder.glob("*.yaml"))]
    for folder in dict.fromkeys(cam.parent for cam in cams):
        rigs += [file for file in sorted(folder.glob("*.yaml")) if is_kind(file, "rigs")]
    return rigs


def tables_path() -> Path:
    """Return the path of the file with the tables of the paper."""
    return config_root() / "published" / "tables" / "paper.yaml"


def find_scene(names: Sequence[Any] | None) -> Path | None:
    """Return the path of the scene if `names` is one scene, or None if they are cams.

    `names` is a scene if it has one item, the name or path of a YAML file with a schedule.
    """
    if not names or len(names) > 1 or not isinstance(names[0], str | Path):
        return None
    path = scene_path(names[0])
    data = read_yaml(path) if file_exists(path) else None
    is_scene = isinstance(data, dict) and not data.keys().isdisjoint({"schedule", "program"})
    return path if is_scene else None


#: Keys of a quantity that describe the origin of its number.
ORIGIN_NOTES = frozenset({"source", "residual"})


def has_shipped_motion(cam: CamConfig, without: frozenset[str] = ORIGIN_NOTES) -> bool:
    """Return True if lift and segments of a cam are those of the shipped cam.

    The shipped cam is that of the same name. Keys in `without` are not compared.
    """
    path = config_root() / "cams" / f"{cam.name}.yaml"
    if not path.is_file():
        return False
    motion, shipped = (plain_data([c.lift, c.segments], without) for c in (cam, load_cam(path)))
    return bool(motion == shipped)


def plain_data(value: Any, without: frozenset[str]) -> Any:
    """Convert models, mappings and lists to plain data, without the keys in `without`."""
    if isinstance(value, BaseModel):
        value = value.model_dump()
    if isinstance(value, dict):
        return {k: plain_data(v, without) for k, v in value.items() if k not in without}
    return [plain_data(v, without) for v in value] if isinstance(value, list | tuple) else value


def quantity_data(
    origin: str, value: float | list[float], unit: str, source: str, residual: str = ""
) -> dict[str, Any]:
    """Return a number as the mapping of a YAML file, with its unit and origin.

    `origin` is given, assumed or identified.
    """
    fit = {"residual": residual} if residual else {}
    return {origin: value, "unit": unit, "source": source, **fit}


def assumed_numbers(section: BaseModel, source: str) -> dict[str, Any]:
    """Return the numbers of a rig's section as assumed numbers of a file.

    They are used for another rig, for which they were not measured. `source` is the reason.
    """
    return {
        key: quantity_data("assumed", number.raw, number.unit, source)
        for key, number in section
        if isinstance(number, Quantity)
    }


def to_yaml(data: dict[str, Any]) -> str:
    """Return a config file as text. Each quantity is one line."""
    return "\n".join(_lines(data, 0)) + "\n"


def file_data(model: BaseModel) -> dict[str, Any]:
    """Convert a model to the plain data of its YAML file.

    None and empty texts, lists and mappings are left out.
    """
    data: dict[str, Any] = _without_empty(model.model_dump(exclude_none=True))
    return data


def _without_empty(value: Any) -> Any:
    """Return plain data without empty texts, lists and mappings."""
    if isinstance(value, dict):
        items = ((key, _without_empty(item)) for key, item in value.items())
        return {key: item for key, item in items if item not in ("", [], {})}
    return [_without_empty(item) for item in value] if isinstance(value, list | tuple) else value


@check_arguments
def save_model(model: BaseModel, path: str | Path, overwrite: bool = False) -> None:
    """Write the file of a cam or a rig, see `CamConfig.save`.

    The points of laws ``table`` are written to a .csv file of the same name.
    """
    target = Path(path)
    if target.suffix != ".yaml":
        raise ConfigError(f"{target}: unknown kind of file; allowed: a name that ends in .yaml")
    renamed = {**dict(model), "name": target.stem}
    data = file_data(validate_in_python(type(model), renamed, str(target)))
    check_writable(target)
    points = target.with_suffix(".csv")
    tables = [segment for segment in data.get("segments", ()) if "file" in segment]
    for file in (target, points) if tables else (target,):
        if file.exists() and not overwrite:
            raise OutputError(
                f"{file}: exists already, not overwriting; name another, or set overwrite=True"
            )
    for segment in tables:
        table, segment["file"] = segment["file"], points.name
        rows = zip(table["angles"], table["lifts"], strict=True)
        text = "angle_rad,lift_m\n" + "".join(f"{a!r},{s!r}\n" for a, s in rows)
        with atomic_write(points) as part:
            part.write_text(text, encoding="utf-8")
    with atomic_write(target) as part:
        part.write_text(to_yaml(data), encoding="utf-8")


def _lines(data: dict[str, Any], indent: int) -> list[str]:
    """Return the lines of a mapping in block style, indented."""
    space, out = " " * indent, []
    for key, value in data.items():
        if isinstance(value, dict) and "unit" not in value:
            out += [f"{space}{key}:", *_lines(value, indent + 2)]
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            out.append(f"{space}{key}:")
            for item in value:
                first, *others = _lines(item, indent + 4)
                out += [f"{space}  - {first.lstrip()}", *others]
        else:
            out.append(f"{space}{key}: {_flow(value)}")
    return out


def _flow(value: Any) -> str:
    """Return a value in flow style, as one line. Texts are quoted as in JSON."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, str) and value.replace("_", "").isalnum() and not value[0].isdigit():
        return value
    return json.dumps(value, ensure_ascii=False)


def validate_cam(data: dict[str, Any]) -> CamConfig:
    """Return the cam of the content of a file. Raise ConfigError if it is wrong."""
    return validate_data(CamConfig, data, data["name"])
