"""Signals that end a command: raised in its main thread, where nothing is left half made.

A handler that raises wherever it comes leaves locks of imports held, processes that nobody knows,
folders that nobody removes. So an interrupt waits until the functions have returned that must be
whole: an import, the begin and the end of a `with`, the start of a worker. It is raised in the line
after them, once; a signal that follows does not disturb what is being put away. However a command
ends then, its exit code is 128 and the number of the first signal, as shells have it.
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

#: Ctrl-C, what ends a service, a terminal that is closed.
STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
#: Functions that an interrupt does not cut short, and what executes imports.
WHOLE = {
    "__enter__",
    "__exit__",
    "NodeProcess.__init__",
    "ProcessPoolExecutor.submit",
    "_BaseExitStack.enter_context",
}
IMPORTS = "<frozen importlib"
#: Wall time (s) that a library may take to come back to Python, which alone can unwind; and that a
#: command has to end in order. A recording that closes on a busy machine takes seconds.
STUCK_S, LAST_S = 4.0, 60.0
Function = TypeVar("Function", bound=Callable[..., Any])
_interruptible: set[CodeType] = set()


class Interrupted(KeyboardInterrupt):
    """A signal came; its name is the message."""

    def __init__(self, number: int) -> None:
        super().__init__(f"interrupted by {signal.Signals(number).name}")


class _Interrupt:
    """The first signal of this process, and what has become of it."""

    def __init__(self) -> None:
        self.number: int | None = None
        self.wanted = self.raised = False

    def receive(self, number: int, frame: FrameType | None) -> None:
        self.number = self.number or number
        if self.wanted and not self.raised:
            self.deliver(frame)

    def deliver(self, frame: FrameType | None, whole: FrameType | None = None) -> None:
        """Raise here, or in the line after the outermost of the functions that must be whole."""
        while frame is not None and frame.f_code not in _interruptible:
            code = frame.f_code
            named = code.co_name in WHOLE or code.co_qualname in WHOLE
            if named or code.co_filename.startswith(IMPORTS):
                whole = frame
            frame = frame.f_back
        if whole is None:
            self.throw()
        elif whole.f_back is not None:
            whole.f_back.f_trace = self.later
            # with any, or no frame is traced; a Python function would double the time of an import
            anything: Any = Exception()
            sys.settrace(anything.__init__)

    def later(self, *_event: object) -> None:
        sys.settrace(None)
        if self.wanted and not self.raised:
            self.throw()

    def throw(self) -> None:
        assert self.number is not None
        self.raised = True
        raise Interrupted(self.number)

    def retry(self, lost: sys.UnraisableHookArgs) -> None:
        """One that was raised in a destructor, where nothing can be raised: once more after it."""
        if not isinstance(lost.exc_value, Interrupted):
            sys.__unraisablehook__(lost)
        elif self.wanted:
            self.raised = False
            self.deliver(sys._getframe(1), sys._getframe())

    def watch(self, signals: int) -> None:
        """End the process, whatever hangs; the interpreter writes a signal's number to the pipe."""
        number = os.read(signals, 1)[0]
        time.sleep(STUCK_S)
        if self.number is not None:
            time.sleep(LAST_S)
        os._exit(128 + number)

    def end(self) -> None:
        """The exit code of a command that a signal came to, whatever its own end was.

        A later one is ignored: the interpreter resets handlers before it takes modules down, and
        the default would kill a command that has ended.
        """
        for number in STOPPING:
            signal.signal(number, signal.SIG_IGN)
        if self.number is not None:
            for stream in (sys.stdout, sys.stderr):
                with suppress(OSError, ValueError):  # nobody reads it; it is closed
                    stream.flush()
            os._exit(128 + self.number)


_interrupt = _Interrupt()


def handle_signals() -> None:
    """Take the signals that end a command, from its first line on; in `raised` they are raised.

    One that is ignored on purpose stays so (`nohup`); but Ctrl-C's is taken also of a command that
    a script has put into the background.
    """
    for number in STOPPING:
        if number == signal.SIGINT or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt.receive)
    signals, told = os.pipe()
    os.set_blocking(told, False)
    signal.set_wakeup_fd(told, warn_on_full_buffer=False)
    Thread(target=_interrupt.watch, args=(signals,), daemon=True).start()
    sys.unraisablehook = _interrupt.retry
    atexit.register(_interrupt.end)


@contextmanager
def raised() -> Iterator[None]:
    """A signal is raised here, also one that came before; elsewhere it is taken down alone."""
    _interrupt.wanted = True
    try:
        if _interrupt.number is not None and not _interrupt.raised:
            _interrupt.throw()
        yield
    except (SystemError, TypeError, ValueError):
        if _interrupt.raised:  # compiled code has made its own of it, as matplotlib's of paths does
            _interrupt.throw()
        raise
    finally:
        _interrupt.wanted = False


def interruptible(function: Function) -> Function:
    """A function that may be cut short although it waits within the begin of a `with`."""

    @wraps(function)
    def begun(*arguments: Any, **options: Any) -> Any:
        if _interrupt.number is not None:
            _interrupt.later()
        return function(*arguments, **options)

    whole = cast("Function", begun)
    _interruptible.update((function.__code__, whole.__code__))
    return whole
