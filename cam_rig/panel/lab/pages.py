"""The lab sheet's pages: one sheet a place, whichever page shows it."""

from __future__ import annotations

import asyncio
import base64
from pathlib import Path
from typing import Any

from starlette.responses import Response
from starlette.routing import Route

from cam_rig.errors import ConfigError, RefusedError
from cam_rig.panel.bench.drawing import cam_picture
from cam_rig.panel.lab.labs import RATE_HZ, SCATTER_DB, JumpSheet, NoiseSheet
from cam_rig.panel.lab.recorded import MAX_NAME, Notebook, to_text
from cam_rig.panel.lab.sheet import CURVE, LabSheet
from cam_rig.panel.server import Handler, PanelPages, csv_file, get, page_file, post
from cam_rig.show import looks as colours

#: Where a panel's only sheet is, and what the places of a class's begin with.
LAB = "/lab"
#: A colour for each added mass, or cam; the markers differ too.
MARKER_COLOURS = (colours.BLUE, colours.VERMILION, colours.GREEN)


class LabPages(PanelPages):
    """A sheet at a ``place``; of a class it ``goes_on`` with a file: a server may be killed."""

    def __init__(self, sheet: LabSheet, out: Path, place: str = LAB, goes_on: bool = False) -> None:
        self.notebook = Notebook(sheet, out, goes_on)
        self._sheet, self._busy = sheet, asyncio.Lock()
        # What cannot be told is refused now, and not in the middle of a lab.
        self._knob = sheet.knob
        for setup in sheet.asked_setups:
            sheet.true(setup)
        self.routes = (
            page_file(place, "lab"),
            get(f"{place}/sheet", self._about),
            get(f"{place}/theory", self._theory),
            get(f"{place}/picture/{{cam}}", self._picture),
            get(f"{place}/readings.csv", self._csv),
            self._alone(f"{place}/turn", self._turn),
            self._alone(f"{place}/record", self._record),
            self._alone(f"{place}/answer", self._answer),
            self._alone(f"{place}/student", self._student),
        )

    async def _about(self, _: dict[str, Any]) -> dict[str, Any]:
        sheet, own = self._sheet, self._sheet.rig.follower
        return {
            "lab": sheet.name,
            "cams": list(sheet.cams),
            "rig": {
                "name": sheet.rig.name,
                "spring_stiffness": own.spring_stiffness.si,
                "mass": own.mass.si,
                "preload": own.preload.si,
            },
            "seed": sheet.seed,
            "tolerances": sheet.tolerances if sheet.seed else None,
            "options": sheet.options,
            "marker": sheet.marker,
            "lift": sheet.critical[0] if isinstance(sheet, JumpSheet) else None,
            "scatter_db": SCATTER_DB if isinstance(sheet, NoiseSheet) else None,
            "measured": sheet.measured is not None,
            "answered": sheet.answer is not None,
            "heard": sheet.heard,
            "unit": sheet.unit,
            "knob": self._knob,
            "plot": dict(zip("xy", sheet.plot, strict=True)),
            "max_name": MAX_NAME,
            "colours": [colours.web(colour) for colour in MARKER_COLOURS],
            "curve_colour": colours.web(colours.FORCE),
        } | self.notebook.page()

    async def _theory(self, _: dict[str, Any]) -> dict[str, Any]:
        """Curves by the sheet's numbers over the plot's x, at equal steps of it."""
        if self._sheet.seed is not None:
            raise RefusedError("theory: allowed: on a sheet without a seed")
        found = await asyncio.to_thread(self._sheet.theory)
        low, high = self._sheet.plot[0]
        curves = [[round(float(y), 4) for y in curve] for curve in found]
        return {"step": (high - low) / (CURVE - 1), "curves": curves}

    async def _picture(self, asked: dict[str, Any]) -> dict[str, Any]:
        name = asked["cam"]
        if name not in self._sheet.cams:
            raise ConfigError(f"cam: is {name!r:.40}; allowed: {', '.join(self._sheet.cams)}")
        return cam_picture(self._sheet.cams[name], self._sheet.laws[name])

    async def _csv(self, _: dict[str, Any]) -> Response:
        book = self.notebook
        return csv_file(book.path.name if book.path else "lab_readings.csv", to_text(book.recorded))

    def _alone(self, path: str, answer: Handler) -> Route:
        async def answered(body: dict[str, Any]) -> dict[str, Any] | Response:
            async with self._busy:
                return await answer(body)

        return post(path, answered)

    async def _turn(self, body: dict[str, Any]) -> dict[str, Any]:
        """What is seen of a set-up at a speed."""
        book = self.notebook
        setup, rpm = book.setup(body), book.speed(body)
        turn = await asyncio.to_thread(self._sheet.turn, setup, rpm, book.next)
        shown: dict[str, Any] = {
            "contact_lost": turn.contact_lost,
            "was_lost": turn.was_lost,
            "curve": [round(y, 1) for y in turn.curve.tolist()],
            "measured": turn.measured,
        }
        if body.get("sound") is True and turn.sound.size:
            data = base64.b64encode(turn.sound.astype("<f4").tobytes()).decode()
            shown |= {"sound": data, "rate": RATE_HZ}
        return shown

    async def _record(self, body: dict[str, Any]) -> dict[str, Any]:
        await asyncio.to_thread(self.notebook.record, body)
        return self.notebook.page()

    async def _answer(self, body: dict[str, Any]) -> dict[str, Any]:
        self.notebook.answer(body)
        return self.notebook.page()

    async def _student(self, body: dict[str, Any]) -> dict[str, Any]:
        if "student" not in body:
            raise RefusedError("student: is missing; allowed: a name")
        self.notebook.name(body["student"])
        return self.notebook.page()
