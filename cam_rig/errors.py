"""The errors a user can meet. All share one root, so a command catches one type."""

from __future__ import annotations

import re
from collections.abc import Iterable

#: Exit code of a command that Ctrl-C ended, as shells have it.
INTERRUPTED = 130
#: Characters of a message that is too long, at its begin and at its end, which has the remedy.
BEGIN, END = 700, 300


#: Characters that a terminal obeys instead of printing them, without tab and end of line; and those
#: that reverse the direction of text.
CONTROLS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]")


def printable(text: str) -> str:
    """Return a text with its control characters as escapes of Python.

    Titles and names come from files of anybody, and must not command a terminal.
    """
    return CONTROLS.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


class CamRigError(Exception):
    """Root of every error the rig raises on purpose: thing, value, limit, and what to do about it.

    One that a wrong argument meets is also the ``ValueError``, or of another type the
    ``TypeError``, that Python's users expect. Of a message longer than a screen, as of a list of
    thousands of numbers, the middle is left out.
    """

    exit_code = 1

    def __init__(self, message: str) -> None:
        message = printable(message)
        if len(message) > BEGIN + END:
            message = f"{message[:BEGIN]} […] {message[-END:]}"
        super().__init__(message)
        #: As a command says it, with options; a function of `import cam_rig` says parameters.
        self.in_command = message


class ConfigError(CamRigError, ValueError):
    """A YAML file or an argument is wrong: the message names it, the value and what is allowed."""

    exit_code = 2


class ArgumentTypeError(ConfigError, TypeError):
    """An argument of a function is of another type than it takes."""


class LawError(CamRigError, ValueError):
    """A displacement law cannot exist with the numbers given."""

    exit_code = 2


class ProfileError(CamRigError, ValueError):
    """A cam cannot have this shape: the message gives the angle, the value and the limit."""


class ReachError(ProfileError):
    """A follower does not even reach the base circle with the numbers of its file."""

    exit_code = 2


class DynamicsError(CamRigError, ValueError):
    """A model was asked for something it cannot give."""


class DesignError(CamRigError):
    """A design has no result: its limits leave no law, or its solver found none."""


class BagError(CamRigError, ValueError):
    """A recording is missing, incomplete, or not one of ours."""


class OutputError(CamRigError):
    """A result cannot be written where it was asked for."""


class RunError(CamRigError):
    """A node of the graph died, or did not answer."""


class RefusedError(CamRigError):
    """A message that cannot be right: it is refused, and its receiver lives on."""


class MissingLibraryError(CamRigError):
    """A library is not installed that only part of the rig needs: the message says how to."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The likeliest of the known names, in brackets for an error; empty where none is near."""
    import difflib  # only for an error

    near = difflib.get_close_matches(name, list(known), 1)
    return f" (did you mean {near[0]!r}?)" if near else ""
