"""What the bench's controls do: a node's parameter, a service of the drive, another set-up."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from cam_rig.acoustics import RadiationParameters
from cam_rig.errors import RefusedError, RunError
from cam_rig.live.sockets import MAX_LINE, line_of, read_line
from cam_rig.nodes.parameters import ABOUT, KINDS, LIVE
from cam_rig.panel import is_number
from cam_rig.panel.bench.live_state import LiveState, PageSound
from cam_rig.panel.bench.runner import SAMPLE_RATE, BenchRunner, Setup, add_cam
from cam_rig.schema import CamConfig
from cam_rig.simulation.scene import calibrated_on

# The server's end of the socket to the panel's node: commands out, what the nodes say in.

#: Wall time (s) that a node may take to answer a command.
ANSWER_S = 5.0


class NodeLink:
    """Takes the one connection of the panel's node; ``heard`` gets each line that is no answer."""

    def __init__(self, path: Path, heard: Callable[[dict[str, Any]], None]) -> None:
        self._path, self._heard = path, heard
        self._writer: asyncio.StreamWriter | None = None
        self._asked: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._number, self._listens = 0, False

    @asynccontextmanager
    async def listening(self) -> AsyncIterator[None]:
        """Listen as long as the context lasts."""
        server = await asyncio.start_unix_server(self._serve, self._path, limit=MAX_LINE)
        try:
            yield
        finally:
            server.close()
            if self._writer is not None:
                self._writer.close()
            self._path.unlink(missing_ok=True)

    async def ask(self, command: dict[str, Any]) -> dict[str, Any]:
        """What a node answers: ``success``, and ``words``."""
        if self._writer is None:
            return {"success": False, "words": "the nodes are not there yet"}
        self._number += 1
        number, answer = self._number, asyncio.get_running_loop().create_future()
        self._asked[number] = answer
        try:
            self._writer.write(line_of(command | {"number": number}))
            return await asyncio.wait_for(answer, ANSWER_S)
        except TimeoutError:
            return {"success": False, "words": f"no answer within {ANSWER_S:g} s"}
        finally:
            self._asked.pop(number, None)

    def listen(self, listens: bool) -> None:
        """Have the samples of every tick sent, or not."""
        self._listens = listens
        if self._writer is not None:
            self._writer.write(line_of({"listen": listens}))

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self._writer is not None:
            self._writer.close()
        self._writer = writer
        self.listen(self._listens)
        try:
            with suppress(ConnectionError, RunError):
                while line := await reader.readline():
                    self._take(read_line(line))
        finally:
            writer.close()
            if self._writer is writer:
                self._lost()

    def _take(self, message: dict[str, Any]) -> None:
        if "answer" not in message:
            self._heard(message)
        elif (answer := self._asked.get(message["answer"])) and not answer.done():
            answer.set_result(message)

    def _lost(self) -> None:
        self._writer = None
        for answer in self._asked.values():
            if not answer.done():
                answer.set_result({"success": False, "words": "the panel's node has ended"})


#: What a page may set: a node's live parameters, with the node.
SETTINGS = {name: (node, spec) for node, specs in LIVE.items() for name, spec in specs.items()}
#: What a page may call.
SERVICES = ABOUT["cam_drive"].services
START, STOP, _, EMERGENCY_STOP = SERVICES
Reply = dict[str, Any]
DONE: Reply = {"success": True, "words": ""}
COMMANDS = ("call", "set", "set_up", "keep", "rerun", "note", "clear")


class BenchControls:
    """Obeys the commands of the page that holds the controls."""

    def __init__(self, runner: BenchRunner, live: LiveState, link: NodeLink) -> None:
        self._runner, self._live, self._link = runner, live, link
        self._take_rig(live.setup)

    async def obey(self, command: dict[str, Any]) -> Reply:
        """Do what a command says; what came of it."""
        value = command.get("value")
        match command.get("do"):
            case "call":
                return await self._call(value)
            case "set":
                return await self._set(str(command.get("name")), value)
            case "set_up" if isinstance(value, dict):
                self.set_up(self.as_it_is(value))
            case "set_up":
                raise RefusedError("set-up: allowed: a JSON object")
            case "keep" if self._live.state:  # the present bag; the same set-up begins anew
                self.set_up(self.as_it_is({}), keep=True)
            case "keep":
                raise RefusedError(
                    "bag: nothing is recorded yet; allowed: after the cam has turned"
                )
            case "rerun":
                self._runner.show()
                self.set_up(self.as_it_is({}))
            case "note":
                return DONE | {"noted": asdict(self._live.note())}
            case "clear":
                self._live.readings.clear()
            case other:
                raise RefusedError(f"do: is {str(other)[:40]!r}; allowed: {', '.join(COMMANDS)}")
        return DONE

    def set_up(self, setup: Setup, keep: bool = False) -> None:
        """End the present run, and begin one of a set-up."""
        chosen = self._live.chosen()
        self._live.setup = setup
        self._live.happened({"graph": "starting"})
        self._take_rig(setup)
        self._runner.set_up(setup, chosen, keep)

    def drawn_name(self) -> str:
        """A cam's name that the bench has not had: no node takes another law of a known one."""
        return f"drawn_{len(list(self._runner.cams.glob('drawn_*.yaml'))) + 1}"

    async def mount(self, cam: CamConfig) -> None:
        """Turn a cam of its own from the next tick on, or once the nodes are there."""
        add_cam(cam, self._runner.cams)
        if self._live.graph != "running":
            return self.set_up(self.as_it_is({"cam": cam.name}))
        answer = await self._link.ask({"node": "law_server", "name": "cam", "value": cam.name})
        if not answer["success"]:
            raise RefusedError(answer["words"])
        return None

    def _take_rig(self, setup: Setup) -> None:
        """What a set-up's rig sounds like, and the cam that its levels are calibrated on."""
        rig = setup.rig(self._runner.rig)
        self.sound = PageSound(RadiationParameters.from_rig(rig), SAMPLE_RATE)
        self.calibrated_on = calibrated_on(rig, setup.model)

    def as_it_is(self, given: dict[str, Any]) -> Setup:
        """The set-up with the cam that is mounted, the speed that is commanded, and more."""
        return self._live.setup.changed(self._live.mounted() | given, self._runner.rig)

    async def _call(self, service: Any) -> Reply:
        if service not in SERVICES:
            raise RefusedError(f"call: allowed: {', '.join(SERVICES)}")
        reply = await self._link.ask({"call": service})
        if reply["success"] and service in (STOP, START):
            (self._live.stopped if service == STOP else self._live.started)()
        return reply

    async def _set(self, name: str, value: Any) -> Reply:
        if name not in SETTINGS:
            raise RefusedError(f"set: is {name[:40]!r}; allowed: {', '.join(SETTINGS)}")
        node, spec = SETTINGS[name]
        kind = type(spec.default)
        if not (is_number(value) if kind is float else isinstance(value, str)):
            raise RefusedError(f"{name}: is {str(value)[:40]!r}; allowed: {KINDS[kind]}")
        return await self._link.ask({"node": node, "name": name, "value": kind(value)})
