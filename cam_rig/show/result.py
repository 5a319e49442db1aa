"""Pictures in a notebook: figures are made without pyplot, so it has to be told how to show one."""

from __future__ import annotations

import sys
from io import BytesIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def shown(figure: Figure) -> Figure:
    """The same figure; IPython shows it where it is the last value of a cell.

    Where pyplot is at work in the notebook, what it has set is left as it is.
    """
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    if shell is not None:
        formatters = shell.display_formatter.formatters
        kind = type(figure)
        if not any(kind in formatter.type_printers for formatter in formatters.values()):
            formatters["image/png"].for_type(kind, _as_png)
    return figure


def _as_png(figure: Figure) -> bytes:
    buffer = BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()
