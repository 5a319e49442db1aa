"""Pages of lab sheets, one sheet per path."""

from __future__ import annotations

import asyncio
import base64
from collections.abc import Callable
from pathlib import Path

from starlette.responses import Response
from starlette.routing import Route

from cam_rig.errors import ConfigError, RefusedError
from cam_rig.panel.bench.drawing import cam_picture
from cam_rig.panel.lab.labs import RATE_HZ, SCATTER_DB, JumpSheet, NoiseSheet
from cam_rig.panel.lab.recorded import MAX_NAME, Notebook, to_text
from cam_rig.panel.lab.sheet import CURVE_POINTS, LabSheet
from cam_rig.panel.server import Message, PanelPages, csv_file, get, page_file, post
from cam_rig.show import looks as colours

#: Path of the sheet's page if a panel has one sheet. With one sheet per group of students, it is
#: the prefix of the paths.
LAB = "/lab"
#: Colours of the markers, by added mass or by cam. The shapes of the markers differ too.
MARKER_COLOURS = (colours.BLUE, colours.VERMILION, colours.GREEN)


class LabPages(PanelPages):
    """Pages of a lab sheet at a path.

    If `resumes` is true, the sheet continues its file, as after the server of a class was killed.
    """

    def __init__(self, sheet: LabSheet, out: Path, path: str = LAB, resumes: bool = False) -> None:
        self.notebook = Notebook(sheet, out, resumes)
        self._sheet, self._busy = sheet, asyncio.Lock()
        # Compute all answers now, so that an error occurs before the lab starts.
        self._knob = sheet.knob
        for setup in sheet.answerable_setups:
            sheet.true(setup)
        self.routes = (
            page_file(path, "lab"),
            get(f"{path}/sheet", self._sheet_data),
            get(f"{path}/theory", self._theory),
            get(f"{path}/picture/{{cam}}", self._picture),
            get(f"{path}/readings.csv", self._csv),
            self._exclusive_post(f"{path}/turn", self._turn),
            self._exclusive_post(f"{path}/record", self.notebook.record),
            self._exclusive_post(f"{path}/answer", self.notebook.answer),
            self._exclusive_post(f"{path}/student", self.notebook.set_student),
        )

    def _sheet_data(self, _: Message) -> Message:
        sheet, follower = self._sheet, self._sheet.rig.follower
        return {
            "lab": sheet.name,
            "cams": list(sheet.cams),
            "rig": {
                "name": sheet.rig.name,
                "spring_stiffness": follower.spring_stiffness.si,
                "mass": follower.mass.si,
                "preload": follower.preload.si,
            },
            "seed": sheet.seed,
            "tolerances": sheet.tolerances if sheet.seed else None,
            "options": sheet.options,
            "marker": sheet.marker,
            "critical_lift_m": sheet.critical[0] if isinstance(sheet, JumpSheet) else None,
            "scatter_db": SCATTER_DB if isinstance(sheet, NoiseSheet) else None,
            "has_instrument": sheet.measured is not None,
            "has_answer": sheet.answer is not None,
            "has_sound": sheet.has_sound,
            "shows_force": sheet.shows_force,
            "unit": sheet.unit,
            "knob": self._knob,
            "plot": dict(zip("xy", sheet.plot, strict=True)),
            "max_name": MAX_NAME,
            "colours": [colours.web(colour) for colour in MARKER_COLOURS],
            "curve_colour": colours.web(colours.FORCE),
        } | self.notebook.page_data()

    async def _theory(self, _: Message) -> Message:
        """Return the theoretical curves of the sheet's plot, at equal steps of x.

        They are computed from the numbers on the sheet.
        """
        if self._sheet.seed is not None:
            raise RefusedError("theory: allowed: on a sheet without a seed")
        theory = await asyncio.to_thread(self._sheet.theory)
        low, high = self._sheet.plot[0]
        curves = [[round(float(y), 4) for y in curve] for curve in theory]
        return {"step": (high - low) / (CURVE_POINTS - 1), "curves": curves}

    def _picture(self, parameters: Message) -> Message:
        name = parameters["cam"]
        if name not in self._sheet.cams:
            raise ConfigError(f"cam: is {name!r:.40}; allowed: {', '.join(self._sheet.cams)}")
        return cam_picture(self._sheet.cams[name], self._sheet.laws[name])

    def _csv(self, _: Message) -> Response:
        book = self.notebook
        return csv_file(book.path.name if book.path else "lab_readings.csv", to_text(book.recorded))

    def _exclusive_post(self, path: str, action: Callable[[Message], Message | object]) -> Route:
        """Return a POST route that executes an action in a thread, one request at a time.

        The answer is that of the action, or the notebook if the action returns no JSON object.
        """

        async def respond(body: Message) -> Message:
            async with self._busy:
                reply = await asyncio.to_thread(action, body)
                return reply if isinstance(reply, dict) else self.notebook.page_data()

        return post(path, respond)

    def _turn(self, body: Message) -> Message:
        """Return the observation of a set-up at a speed, as data for the page."""
        book = self.notebook
        turn = self._sheet.turn(book.setup(body), book.speed(body), book.next_number)
        data: Message = {
            "contact_lost": turn.contact_lost,
            "was_lost": turn.was_lost,
            "curve": [round(y, 1) for y in turn.curve.tolist()],
            "measured": turn.measured,
            "lift": [round(y, 2) for y in turn.lift.tolist()],
            "gap": turn.gap.tolist(),
        }
        if body.get("sound") is True and turn.sound.size:
            sound = base64.b64encode(turn.sound.astype("<f4").tobytes()).decode()
            data |= {"sound": sound, "rate": RATE_HZ}
        return data
