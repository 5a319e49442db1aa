"""Exceptions of the package, which all derive from `CamRigError`."""

from __future__ import annotations

import re
from collections.abc import Iterable

#: Exit code of a command that Ctrl-C ended, as in shells.
INTERRUPTED = 130
#: Number of characters kept from the start of a message that is too long.
HEAD_CHARACTERS = 700
#: Number of characters kept from the end of a message that is too long, which has the remedy.
TAIL_CHARACTERS = 300


#: Pattern of characters that control a terminal, or reverse the text direction. Tab and end of line
#: are not among them.
CONTROLS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]")


def printable(text: str) -> str:
    """Return a text with its control characters as escapes of Python.

    Titles and names come from files of other people and must not control a terminal.
    """
    return CONTROLS.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


class CamRigError(Exception):
    """Root of all errors that the rig raises on purpose.

    The message contains the name of the thing, its value, the limit and the remedy. An error of a
    wrong argument is also a ``ValueError``, or a ``TypeError`` if the type is wrong. A message
    longer than a screen, such as one with thousands of numbers, is shortened in the middle.

    Parameters
    ----------
    message : str
        Text of the error. Its control characters are escaped.

    Attributes
    ----------
    exit_code : int
        Exit code of a command that fails with this error.
    in_command : str
        Message for the command line, which names options. Functions of `import cam_rig` replace
        them by parameters in ``args``.

    Examples
    --------
    >>> import cam_rig
    >>> try:
    ...     cam_rig.load_cam("no_such_cam")
    ... except cam_rig.CamRigError as error:
    ...     error.exit_code
    2
    """

    exit_code = 1

    def __init__(self, message: str) -> None:
        message = printable(message)
        if len(message) > HEAD_CHARACTERS + TAIL_CHARACTERS:
            message = f"{message[:HEAD_CHARACTERS]} […] {message[-TAIL_CHARACTERS:]}"
        super().__init__(message)
        self.in_command = message


class ConfigError(CamRigError, ValueError):
    """Error in a YAML file or in an argument.

    The message contains the key or name, the value and the allowed values.
    """

    exit_code = 2


class ArgumentTypeError(ConfigError, TypeError):
    """Error of an argument that has a wrong type."""


class LawError(CamRigError, ValueError):
    """Error of a displacement law that cannot be built with the given numbers."""

    exit_code = 2


class ProfileError(CamRigError, ValueError):
    """Error of a cam contour that violates a limit of its geometry.

    The message contains the cam angle, the value and the limit.
    """


class ReachError(ProfileError):
    """Error of a follower that does not reach the base circle."""

    exit_code = 2


class DynamicsError(CamRigError, ValueError):
    """Error of a model that cannot compute the requested quantity."""


class DesignError(CamRigError):
    """Error of a design: its limits are incompatible, or its solver failed."""


class BagError(CamRigError, ValueError):
    """Error in a recording: missing, incomplete, or not made by the rig."""


class OutputError(CamRigError):
    """Error of a result that cannot be written to the requested path."""


class RunError(CamRigError):
    """Error of a run: a node or a worker process died, or did not answer."""


class RefusedError(CamRigError):
    """Error in a received message. The receiver rejects the message and continues."""


class MissingLibraryError(CamRigError):
    """Error of an optional library that is not installed.

    The message contains the command that installs it.
    """


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Return the most similar known name as " (did you mean 'x'?)", or an empty text."""
    import difflib  # only for an error

    similar = difflib.get_close_matches(name, list(names), 1)
    return f" (did you mean {similar[0]!r}?)" if similar else ""
