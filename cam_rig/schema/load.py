"""Reading YAML files into config models, with one-line errors that name file and key."""

from __future__ import annotations

import re
import sysconfig
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.files import MIB, read_bytes
from cam_rig.schema.cam import CamConfig
from cam_rig.schema.explain import explain, kind_of
from cam_rig.schema.published import PublishedNoise, PublishedTables
from cam_rig.schema.reading import TableReadings
from cam_rig.schema.rig import RigConfig
from cam_rig.schema.scene import SceneConfig
from cam_rig.schema.studies.factorial import FactorialConfig
from cam_rig.schema.yaml_text import parse_yaml

Config = TypeVar("Config", bound=BaseModel)
#: Bytes of a YAML file, at most.
MAX_BYTES = MIB
NAME = re.compile(r"[a-z][a-z0-9_]{0,99}")


def config_root() -> Path:
    """The shipped ``config`` folder: the source tree's, else the installed share folder's."""
    source = Path(__file__).parents[2] / "config"
    if source.is_dir():
        return source
    for parent in Path(__file__).parents:
        share = parent / "share" / "cam_rig" / "config"
        if share.is_dir():
            return share
    return Path(sysconfig.get_path("data")) / "share" / "cam_rig" / "config"


def named_path(folder: str, name: str | Path) -> Path:
    """The file that a path means; a word without folder and suffix is a shipped file's name.

    Parameters
    ----------
    folder : of ``config``, where the shipped files of its kind are
    """
    path = Path(name)
    return path if is_path(name) or _is_file(path) else config_root() / folder / f"{name}.yaml"


def is_path(name: str | Path) -> bool:
    """Whether a text can only be a path: it has a folder, or the suffix of a YAML file."""
    path = Path(name)
    return path.name != str(name) or path.suffix in (".yaml", ".yml")


def _is_file(path: Path) -> bool:
    """Whether there is a file at a path; a name that no file can have is none."""
    try:
        return path.is_file()
    except OSError:
        return False


def read_yaml(path: Path, most: int = MAX_BYTES) -> Any:
    """The one document of a YAML file of at most ``most`` bytes.

    Raises
    ------
    ConfigError : one line that names the file, and the line where there is one
    """
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
    """That there is no such file in any of these places, and what there is beside the last."""
    return f"{', '.join(map(str, paths))}: no such file{_neighbours(paths[-1])}"


def _neighbours(path: Path) -> str:
    """The YAML files there are beside one that is missing, the likeliest first."""
    there = sorted(p.stem for p in path.parent.glob("*.yaml"))
    return f"{did_you_mean(path.stem, there)}; there are: {', '.join(there)}" if there else ""


def load(path: Path, kind: type[Config]) -> Config:
    """Read and check one file.

    Raises
    ------
    ConfigError : one line that names file, key, value and what is allowed
    """
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
    """The folders that the names in a file refer to, the file's own before the shipped one.

    Parameters
    ----------
    here : what paths in the file are relative to: its folder
    """

    roots: tuple[Path, ...]
    here: Path = Path()

    @classmethod
    def beside(cls, scene: Path) -> Library:
        """For a scene in ``X/scenes/``: names are looked up in ``X``, then in ``config``."""
        own = scene.absolute().parent.parent
        return cls(tuple(dict.fromkeys((own, config_root()))), scene.parent)

    def path(self, folder: str, name: str) -> Path:
        """The file ``folder/name.yaml`` of the first root that has it.

        Raises
        ------
        ConfigError : the name is not a plain name
        """
        if not NAME.fullmatch(name):
            raise ConfigError(
                f"{folder}: is {name[:40]!r}; allowed: a name of up to 100 small letters, digits "
                "and _, a letter first"
            )
        candidates = [root / folder / f"{name}.yaml" for root in self.roots]
        return next((path for path in candidates if path.is_file()), candidates[-1])

    def file(self, folder: str, name: str) -> Path:
        """The file that a path means, or as `path` the one that a name does.

        Raises
        ------
        ConfigError : no file; all places that were looked at are named
        """
        if is_path(name):
            places = [self.here / name]
        else:
            self.path(folder, name)  # refuses what is no name
            places = [root / folder / f"{name}.yaml" for root in self.roots]
        found = next((path for path in places if path.is_file()), None)
        if found is None:
            raise ConfigError(_not_there(*places))
        return found


def load_cam(path: Path) -> CamConfig:
    """Read one file of ``config/cams/``."""
    return load(path, CamConfig)


def load_rig(path: Path) -> RigConfig:
    """Read one file of ``config/rigs/``."""
    return load(path, RigConfig)


def load_scene(path: Path) -> SceneConfig:
    """Read one file of ``config/scenes/``."""
    return load(path, SceneConfig)


def load_published(path: Path) -> PublishedNoise:
    """Read one file of ``config/published/``."""
    return load(path, PublishedNoise)


def load_tables(path: Path) -> PublishedTables:
    """Read one file of ``config/published/tables/``."""
    return load(path, PublishedTables)


def load_readings(path: Path) -> TableReadings:
    """Read one file of ``config/published/readings/``."""
    return load(path, TableReadings)


def load_factorial(path: Path) -> FactorialConfig:
    """Read one file of ``config/factorials/``."""
    return load(path, FactorialConfig)
