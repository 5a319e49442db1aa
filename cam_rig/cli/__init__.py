"""The command line: the list of commands, and those that start the nodes."""

import os
import signal
import sys

# Before numpy is imported. The rig's products are small: threads of BLAS wait for each other, on
# a busy machine for many times what they compute. Whoever sets the variable keeps it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Else pydantic looks for plugins in every package that is installed.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")


def start() -> None:
    """Run ``cam-rig``; print one line if a library, a stream or the working folder is missing."""
    # until the handlers are installed, Ctrl-C ends the process without a traceback (130 of a shell)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    if sys.stdout is None:  # closed by the caller, as by >&-
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  # until the end
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    try:
        os.getcwd()
    except FileNotFoundError:
        print("cam-rig: the working folder has been removed; change to another", file=sys.stderr)
        sys.exit(1)
    from cam_rig.interrupts import handle_signals

    handle_signals()
    from cam_rig.errors import MissingLibraryError
    from cam_rig.extras import libraries_named

    try:
        with libraries_named():
            from cam_rig.cli.main import main
        main()
    except MissingLibraryError as error:
        print(f"cam-rig: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
