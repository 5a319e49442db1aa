"""Base class of cams and rigs, which come from a YAML file or from Python code."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

from pydantic import Field, ValidationError

from cam_rig.schema.explain import python_error, validate_in_python
from cam_rig.schema.quantity import Strict

#: Name of a cam, rig or scene, which is also that of its file without the suffix.
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]


class NamedConfig(Strict):
    """Config with a name and a title.

    Parameters
    ----------
    name : str
        Name of the config, and of its file: small letters, digits and _.
    title : str or None
        Title in figures and reports (default: the name).
    """

    #: Kind of the config in messages.
    kind: ClassVar[str]

    name: Name
    title: str

    def __init__(self, name: str, title: str | None, **sections: Any) -> None:
        try:
            super().__init__(name=name, title=name if title is None else title, **sections)
        except ValidationError as error:
            raise python_error(self.kind, name, error, type(self)) from None

    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]  # as in Strict

    def _replaced(self, data: dict[str, Any]) -> Self:
        """Return a new config of this class, made of the values that Python code gives."""
        return validate_in_python(type(self), data, self.kind)

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the config to a file atomically.

        The written cam or rig has the name of the file. The points of a measured law are written
        to a .csv file of the same name.

        Parameters
        ----------
        path : str or Path
            Path of the file, which ends in .yaml.
        overwrite : bool
            True if existing files are replaced (default: False).

        Raises
        ------
        ConfigError
            If the name of the file is not valid.
        OutputError
            If the file cannot be written, or exists and `overwrite` is False.

        Examples
        --------
        >>> import tempfile, cam_rig
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     cam_rig.load_cam("poly345").replace(lift="30 mm").save(f"{folder}/mine.yaml")
        ...     print(cam_rig.load_cam(f"{folder}/mine.yaml"))
        Cam('mine': lift 30 mm, roller, 5 segments)
        """
        from cam_rig.schema.load import save_model

        save_model(self, path, overwrite)
