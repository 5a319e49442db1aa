"""A run in the viewer while it runs: drawn as from a bag."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import rerun as rr

from cam_rig.errors import CamRigError
from cam_rig.live.playback import MARGIN_S, Playback, Tick
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.simulation.schedule import run_length
from cam_rig.units import NS
from cam_rig.viewer.blueprint import blueprint, compared_rpm
from cam_rig.viewer.charts.quantities import scene_ranges
from cam_rig.viewer.feed import RunFeed
from cam_rig.viewer.options import Layout
from cam_rig.viewer.pace import FramePace
from cam_rig.viewer.recording import APPLICATION, name_recording
from cam_rig.viewer.run_recorder import RunRecorder
from cam_rig.viewer.server.live_folder import new_recording, next_part, page_delay

#: Two points of a curve are all that a screen shows at one place along it: so many places.
ACROSS_SCREEN = 1000
#: Rig time (s) before the newest sample that the curves show at least: some turns, and what is
#: sent at once to the slowest page.
MIN_WINDOW_S = 2.0
#: Wall time (s) between blocks of columns, at least.
SEND_EVERY_S = 0.25
#: Wall time (s) to send the rest at the end.
TIMEOUT_S = 8.0


class LiveView:
    """A feed that a viewer shows at once.

    Parameters
    ----------
    address : the viewer's, ``rerun+http://127.0.0.1:9876/proxy`` for one, or the folder that a
        page reads
    """

    def __init__(self, loaded: LoadedScene, address: str) -> None:
        duration, tick = (length / NS for length in run_length(loaded.scene))
        window = live_window(tick)
        bucket = screen_bucket(window, loaded.scene.sample_rate.si)
        rpm = compared_rpm(loaded, None)
        ranges = scene_ranges(loaded)
        plan = blueprint(Layout.RUN, loaded, duration, bucket, rpm, ranges.whole, window)
        self._address, self._stream = address, rr.RecordingStream(APPLICATION)
        #: What a page reads; None for a viewer.
        self._part = new_recording(Path(address)) if "://" not in address else None
        try:
            if self._part is not None:
                self._stream.save(self._part, default_blueprint=plan)
            else:
                self._stream.connect_grpc(address, default_blueprint=plan)
        except (RuntimeError, ValueError, OSError) as error:
            raise CamRigError(f"{address}: no viewer can be reached there ({error})") from None
        name_recording(self._stream, loaded.scene.title)
        self._pace = FramePace(None if self._part is None else partial(page_delay, Path(address)))
        self._sent, self._factor = time.monotonic(), 0.0
        # a picture waits for its tick's curves
        rate = int(loaded.scene.sample_rate.si)
        self._playback = Playback(rate, MARGIN_S + SEND_EVERY_S)
        # a block and the tick that makes it whole fit into the window: no curve is ever out of it
        block = window - tick
        self._drawing = RunRecorder(
            self._stream, loaded, bucket, rpm, ranges, pace=self._pace, send_every=block
        )
        self.feed = RunFeed(self._drawing)

    def set_pace(self, factor: float) -> None:
        """Show each tick while the next one turns, at rig seconds a wall second; 0: at once."""
        self._factor = factor
        self._playback.clear()

    def draw(self) -> Iterator[Tick]:
        """Draw all ticks that are complete; gives each."""
        for tick in map(Tick._make, self.feed.draw()):
            if self._factor:
                now = time.monotonic()
                self._playback.add(tick, self._factor, now, now)
            yield tick

    def flush(self) -> None:
        """Send what was drawn, as often as who looks at it can show it.

        Of a paced run cam and follower are shown when their time has come, and go out alone where
        a block of curves has just gone.
        """
        if self._pace.is_due():
            now = time.monotonic()
            until = self._playback.position(now) / NS if self._factor else math.inf
            if now - self._sent >= SEND_EVERY_S:
                self._sent = now
                self._drawing.flush(until)
            else:
                self._drawing.show(until)
        part = None if self._part is None else next_part(self._part)
        if part is not None:
            self._stream.save(part)  # the same recording goes on
            self._part = part

    def close(self) -> None:
        """Send the rest.

        Raises
        ------
        CamRigError : the viewer does not take it
        """
        self.feed.close()
        try:
            self._stream.flush(timeout_sec=TIMEOUT_S)
        except (RuntimeError, ValueError) as error:
            raise CamRigError(f"{self._address}: the viewer has gone ({error})") from None
        finally:
            with warnings.catch_warnings(action="ignore"):
                self._stream.disconnect()


def screen_bucket(window: float, rate: float) -> int:
    """Samples of which a curve shows the least and the greatest, where it shows some time (s).

    Examples
    --------
    >>> screen_bucket(1.0, 12_000.0)
    12
    """
    return max(1, round(window * rate / ACROSS_SCREEN))


def live_window(longest_tick: float) -> float:
    """Rig time (s) that the curves of a live run show: two ticks at least, the longest (s)."""
    return max(MIN_WINDOW_S, 2.0 * longest_tick)
