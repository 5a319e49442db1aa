"""Command line: the list of commands, and the commands that start the nodes."""

import os
import signal
import sys

# Set before numpy is imported, unless the user has set it. The matrix products of the rig are
# small, so threads of BLAS would mostly wait for each other, especially on a busy machine.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Otherwise pydantic searches all installed packages for plugins.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")


def start() -> None:
    """Run the command line of ``cam-rig``.

    If a library or the working folder is missing, the command prints one line and ends. A stdout or
    stderr that the caller has closed is replaced by the null device.
    """
    # until the handlers are installed, Ctrl-C ends the process without a traceback (shell code 130)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    if sys.stdout is None:  # closed by the caller, for example by >&-
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  # open until exit
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
    from cam_rig.extras import friendly_import_errors

    try:
        with friendly_import_errors():
            from cam_rig.cli.main import main
        main()
    except MissingLibraryError as error:
        print(f"cam-rig: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
