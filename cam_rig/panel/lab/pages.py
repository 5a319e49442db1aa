"""The lab sheet's pages: one sheet a panel, whichever page shows it."""

from __future__ import annotations

import asyncio
import base64
from pathlib import Path
from typing import Any

from starlette.responses import Response
from starlette.routing import Route

from cam_rig.errors import RefusedError
from cam_rig.panel.bench.drawing import cam_picture
from cam_rig.panel.lab.marking import RATE_HZ, observe
from cam_rig.panel.lab.sheet import MAX_NAME, TOLERANCES, LabSheet, Notebook, to_text
from cam_rig.panel.server import Answer, PanelPages, csv_file, get, page_file, post
from cam_rig.show import looks as colours
from cam_rig.units import RPM_PER_RAD_S

#: A colour an added mass; the markers differ too.
MASS_COLOURS = (colours.BLUE, colours.VERMILION, colours.GREEN)


class LabPages(PanelPages):
    """A lab sheet in a browser; the readings are kept in a folder ``out``."""

    def __init__(self, sheet: LabSheet, out: Path) -> None:
        self.notebook = Notebook(sheet, out)
        self._sheet, self._busy = sheet, asyncio.Lock()
        for setup in sheet.setups:  # refused now, and not in the middle of a lab
            sheet.jump_rpm(setup)
        self.routes = (
            page_file("/lab", "lab"),
            get("/lab/sheet", self._about),
            get("/lab/theory", self._theory),
            get("/lab/picture", self._picture),
            get("/lab/readings.csv", self._csv),
            self._alone("/lab/turn", self._turn),
            self._alone("/lab/record", self._record),
            self._alone("/lab/student", self._student),
        )

    async def _about(self, _: dict[str, Any]) -> dict[str, Any]:
        sheet = self._sheet
        loads = [sheet.load(setup) for setup in sheet.setups]
        return {
            "lab": sheet.name,
            "cam": {"name": sheet.cam.name},
            "rig": {"name": sheet.rig.name, "mass": sheet.rig.follower.mass.si},
            "seed": sheet.seed,
            "tolerances": TOLERANCES if sheet.seed else None,
            "springs": sheet.springs,
            "added_masses": sheet.added_masses,
            "preloads": sheet.preloads,
            "lift": sheet.critical[0],
            "loads": (min(loads), max(loads)),
            "knob": sheet.knob,
            "max_name": MAX_NAME,
            "colours": [colours.web(colour) for colour in MASS_COLOURS],
            "force_colour": colours.web(colours.FORCE),
        } | self.notebook.page()

    async def _theory(self, _: dict[str, Any]) -> dict[str, Any]:
        """The straight line of one rigid mass: n² in rpm² is ``slope`` times the load in m/s²."""
        if self._sheet.seed is not None:
            raise RefusedError("theory: allowed: on a sheet without a seed")
        return {"slope": RPM_PER_RAD_S**2 / abs(self._sheet.critical[1])}

    async def _picture(self, _: dict[str, Any]) -> dict[str, Any]:
        return cam_picture(self._sheet.cam, self._sheet.law)

    async def _csv(self, _: dict[str, Any]) -> Response:
        path = self.notebook.path
        name = "lab_readings.csv" if path is None else path.name
        return csv_file(name, to_text(self.notebook.recorded))

    def _alone(self, path: str, answer: Answer) -> Route:
        async def answered(body: dict[str, Any]) -> dict[str, Any] | Response:
            async with self._busy:
                return await answer(body)

        return post(path, answered)

    async def _turn(self, body: dict[str, Any]) -> dict[str, Any]:
        """What is seen of a set-up at a speed.

        The lamp stays on above a speed at which contact was lost: between two resonances of the
        stem the follower may stay on again, but whoever comes from below has seen it leave.
        """
        setup, rpm = self.notebook.setup(body), self.notebook.speed(body)
        sheet, rig = self._sheet, self._sheet.true_rig(setup)
        turn = await asyncio.to_thread(observe, sheet.law, rig, rpm)
        was_lost = rpm > await asyncio.to_thread(sheet.jump_rpm, setup)
        shown = {
            "contact_lost": turn.contact_lost,
            "was_lost": was_lost,
            "force": [round(force, 1) for force in turn.force.tolist()],
        }
        if body.get("sound") is True:
            data = base64.b64encode(turn.sound.astype("<f4").tobytes()).decode()
            shown |= {"sound": data, "rate": RATE_HZ}
        return shown

    async def _record(self, body: dict[str, Any]) -> dict[str, Any]:
        self.notebook.record(body)
        return self.notebook.page()

    async def _student(self, body: dict[str, Any]) -> dict[str, Any]:
        if "student" not in body:
            raise RefusedError("student: is missing; allowed: a name")
        self.notebook.name(body["student"])
        return self.notebook.page()
