"""Conversion of the signals that end a command into an exception at a safe point.

A handler that raises immediately can leave import locks taken, worker processes without a parent
and temporary folders on the disk. An interrupt therefore waits until the running functions of
`UNINTERRUPTED` have returned: an import, the entry and the exit of a `with` block, the start of a
worker. It is raised once, in the line after them. Later signals do not disturb the cleanup. The
exit code of the command is then 128 plus the number of the first signal, as in shells.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import wraps
from threading import Thread
from types import CodeType, FrameType
from typing import Any, TypeVar, cast

#: Signals that end a command: Ctrl-C, the end of a service, a closed terminal.
STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
#: Names of functions that are completed before an interrupt is raised.
UNINTERRUPTED = {
    "__enter__",
    "__exit__",
    "NodeProcess.__init__",
    "ProcessPoolExecutor.submit",
    "_BaseExitStack.enter_context",
}
#: Prefix of the file names of Python's import code. An interrupt waits for this code as well.
IMPORT_CODE = "<frozen importlib"
#: Longest wall time (s) after a signal until a library must return to Python. Only Python code can
#: raise the interrupt. After this time the process is ended.
UNWIND_S = 4.0
#: Longest further wall time (s) for the cleanup of a command, such as closing a recording, which
#: can take seconds. After this time the process is ended.
CLEANUP_S = 60.0
Function = TypeVar("Function", bound=Callable[..., Any])
#: Code of the functions that `interruptible` has wrapped. An interrupt is raised in them at once.
_interruptible: set[CodeType] = set()


class Interrupted(KeyboardInterrupt):
    """Interrupt by a signal. The message contains the signal's name."""

    def __init__(self, number: int) -> None:
        super().__init__(f"interrupted by {signal.Signals(number).name}")


class _Interrupt:
    """State of the first signal that this process has received."""

    def __init__(self) -> None:
        self.number: int | None = None  # of the first signal
        self.enabled = False  # True within `raise_signals`
        self.has_raised = False

    def receive(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal: store it, and raise an interrupt if interrupts are enabled.

        ``number`` is that of the signal, and ``frame`` the interrupted frame.
        """
        self.number = self.number or number
        if self.enabled and not self.has_raised:
            self.deliver(frame)

    def deliver(self, frame: FrameType | None, outermost: FrameType | None = None) -> None:
        """Raise the interrupt now, or after the running functions of `UNINTERRUPTED`.

        `frame` is the interrupted frame. The interrupt is raised in the line after the outermost of
        these functions.
        """
        while frame is not None and frame.f_code not in _interruptible:
            code = frame.f_code
            is_named = code.co_name in UNINTERRUPTED or code.co_qualname in UNINTERRUPTED
            if is_named or code.co_filename.startswith(IMPORT_CODE):
                outermost = frame
            frame = frame.f_back
        if outermost is None:
            self.throw()
        elif outermost.f_back is not None:
            outermost.f_back.f_trace = self.throw_from_trace
            # Frames are traced only if a trace function is set. A Python function would double the
            # time of an import.
            anything: Any = Exception()
            sys.settrace(anything.__init__)

    def throw_from_trace(self, *_event: object) -> None:
        """Stop tracing, and raise the interrupt in the traced line."""
        sys.settrace(None)
        if self.enabled and not self.has_raised:
            self.throw()

    def throw(self) -> None:
        """Raise the interrupt for a received signal now."""
        assert self.number is not None
        self.has_raised = True
        raise Interrupted(self.number)

    def retry(self, lost: sys.UnraisableHookArgs) -> None:
        """Raise an interrupt again that was lost because a destructor was running."""
        if not isinstance(lost.exc_value, Interrupted):
            sys.__unraisablehook__(lost)
        elif self.enabled:
            self.has_raised = False
            self.deliver(sys._getframe(1), sys._getframe())

    def watch(self, pipe: int) -> None:
        """End the process if it hangs after a signal.

        The interpreter writes the signal's number to the pipe.
        """
        number = os.read(pipe, 1)[0]
        time.sleep(UNWIND_S)
        if self.number is not None:
            time.sleep(CLEANUP_S)
        os._exit(128 + number)

    def end(self) -> None:
        """Exit with the code of the first signal, if there was a signal.

        Later signals are ignored. The interpreter resets handlers before it unloads modules, and
        the default handler would kill a command that has ended.
        """
        for number in STOPPING:
            signal.signal(number, signal.SIG_IGN)
        if self.number is not None:
            for stream in (sys.stdout, sys.stderr):
                with suppress(OSError, ValueError):  # its reader is gone, or it is closed
                    stream.flush()
            os._exit(128 + self.number)


_interrupt = _Interrupt()


def handle_signals() -> None:
    """Install the handlers of the signals that end a command.

    They store the signal, and raise it within `raise_signals`.

    A signal that is ignored on purpose (`nohup`) stays ignored. Ctrl-C is handled in any case,
    because scripts ignore it for the commands that they put into the background.
    """
    for number in STOPPING:
        if number == signal.SIGINT or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt.receive)
    read_end, write_end = os.pipe()
    os.set_blocking(write_end, False)
    signal.set_wakeup_fd(write_end, warn_on_full_buffer=False)
    Thread(target=_interrupt.watch, args=(read_end,), daemon=True).start()
    sys.unraisablehook = _interrupt.retry
    atexit.register(_interrupt.end)


@contextmanager
def raise_signals() -> Iterator[None]:
    """Raise signals within this context, also one that came before it.

    Outside of the context a signal is only stored.
    """
    _interrupt.enabled = True
    try:
        if _interrupt.number is not None and not _interrupt.has_raised:
            _interrupt.throw()
        yield
    except (SystemError, TypeError, ValueError):
        # Compiled code may replace the interrupt by such an error, as matplotlib's paths do.
        if _interrupt.has_raised:
            _interrupt.throw()
        raise
    finally:
        _interrupt.enabled = False


def interruptible(function: Function) -> Function:
    """Return a function in which an interrupt is raised at once.

    It is for functions that wait in the entry of a `with` block. Otherwise the interrupt would be
    raised only after the entry.
    """

    @wraps(function)
    def call(*arguments: Any, **options: Any) -> Any:
        if _interrupt.number is not None:
            _interrupt.throw_from_trace()
        return function(*arguments, **options)

    wrapped = cast("Function", call)
    _interruptible.update((function.__code__, wrapped.__code__))
    return wrapped
