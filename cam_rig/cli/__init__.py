"""The command line: the list of commands, and those that start the nodes."""

import os
import sys

# Before numpy is imported. The rig's products are small: threads of BLAS wait for each other, on
# a busy machine for many times what they compute. Whoever sets the variable keeps it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Else pydantic looks for plugins in every package that is installed.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")


def start() -> None:
    """Entry point of ``cam-rig``, which says in one line that the extra ``cli`` is missing."""
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
