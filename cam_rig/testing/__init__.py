"""Pytest fixture that starts a rig for a test, for packages that use cam_rig.

All processes and files of the rig are removed after the test.
pytest loads this plugin automatically if cam_rig is installed. The line
``pytest_plugins = ["cam_rig.testing"]`` is not necessary, but allowed. Large libraries are not
imported before a rig is started.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from cam_rig.extras import friendly_import_errors

if TYPE_CHECKING:
    from cam_rig.testing.running_rig import RunningRig

__all__ = ["start_rig"]


@pytest.fixture
def start_rig(tmp_path: Path) -> Iterator[Callable[..., RunningRig]]:
    """Return the function ``start_rig(scene="quick", bag=None, **drive)`` that starts a rig.

    It returns a `RunningRig`. Each rig has a separate ROS domain and records into ``tmp_path``
    unless `bag` names a folder. All rigs end with the test. The test fails if a node has ended
    early, and its report contains the log lines of the nodes.

    Examples
    --------
    >>> def test_recording_is_complete(start_rig):
    ...     rig = start_rig("quick")
    ...     rig.wait_until_done()
    ...     assert rig.read_bag().complete
    """
    numbers = count(1)
    with ExitStack() as rigs:

        def start(
            scene: str | Path = "quick", bag: str | Path | None = None, **drive: Any
        ) -> RunningRig:
            with friendly_import_errors():
                from cam_rig.testing.running_rig import RunningRig
            folder = Path(bag or tmp_path / f"bag_{next(numbers)}")
            return rigs.enter_context(RunningRig(scene, folder, **drive))

        yield start
