"""Commands of the bench's page: node parameters, services of the drive, set-ups."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from cam_rig.acoustics import RadiationParameters
from cam_rig.errors import RefusedError, RunError
from cam_rig.live.sockets import MAX_LINE, line_of, parse_line
from cam_rig.nodes.parameters import ABOUT, KINDS, LIVE
from cam_rig.panel import is_number
from cam_rig.panel.bench.live_state import LiveState, PageSound
from cam_rig.panel.bench.runner import SAMPLE_RATE, BenchRunner, Setup, add_cam
from cam_rig.schema import CamConfig
from cam_rig.simulation.scene import calibration_cam

# The server's end of the socket to the panel's node: commands out, node messages in.

#: Longest time (s, wall clock) from a command until a node must answer it.
ANSWER_S = 5.0


class NodeLink:
    """Server of the socket connection to the panel's ROS node.

    This node passes commands to the other nodes, and their messages back. `on_message` receives
    each message that is not an answer to a command.
    """

    def __init__(self, path: Path, on_message: Callable[[dict[str, Any]], None]) -> None:
        self._path, self._on_message = path, on_message
        self._writer: asyncio.StreamWriter | None = None
        self._pending: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._number, self._listens = 0, False

    @asynccontextmanager
    async def listening(self) -> AsyncIterator[None]:
        """Accept the connection of the panel's node while the context is active."""
        server = await asyncio.start_unix_server(self._serve, self._path, limit=MAX_LINE)
        try:
            yield
        finally:
            server.close()
            if self._writer is not None:
                self._writer.close()
            self._path.unlink(missing_ok=True)

    async def request(self, command: dict[str, Any]) -> dict[str, Any]:
        """Send a command to a node and return its answer with `success` and `message`."""
        if self._writer is None:
            return {"success": False, "message": "the nodes have not started yet"}
        self._number += 1
        number, answer = self._number, asyncio.get_running_loop().create_future()
        self._pending[number] = answer
        try:
            self._writer.write(line_of(command | {"number": number}))
            return await asyncio.wait_for(answer, ANSWER_S)
        except TimeoutError:
            return {"success": False, "message": f"no answer within {ANSWER_S:g} s"}
        finally:
            self._pending.pop(number, None)

    def set_listening(self, listens: bool) -> None:
        """Switch the transmission of the samples of every tick on or off.

        The panel's node transmits them.
        """
        self._listens = listens
        if self._writer is not None:
            self._writer.write(line_of({"listen": listens}))

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self._writer is not None:
            self._writer.close()
        self._writer = writer
        self.set_listening(self._listens)
        try:
            with suppress(ConnectionError, RunError):
                while line := await reader.readline():
                    message = parse_line(line)
                    if "answer" in message:
                        self._answer(message["answer"], message)
                    else:
                        self._on_message(message)
        finally:
            writer.close()
            if self._writer is writer:
                self._writer = None
                ended = {"success": False, "message": "the panel's node has ended"}
                for number in self._pending:
                    self._answer(number, ended)

    def _answer(self, number: int, reply: dict[str, Any]) -> None:
        if (answer := self._pending.get(number)) and not answer.done():
            answer.set_result(reply)


#: Node and specification of each parameter that a page may set during a run, by parameter name.
SETTINGS = {name: (node, spec) for node, specs in LIVE.items() for name, spec in specs.items()}
#: Names of the services of the drive that a page may call.
SERVICES = ABOUT["cam_drive"].services
#: Name of the service that stops the drive until it is reset.
EMERGENCY_STOP = "emergency_stop"
#: Answer to a command: `success`, `message`, and further keys for some commands.
Reply = dict[str, Any]
#: Answer to a command that was carried out.
DONE: Reply = {"success": True, "message": ""}
#: Names of the commands that a page may send.
COMMANDS = ("call", "set", "set_up", "keep", "rerun", "note", "clear")


class BenchControls:
    """Executor of the commands of a page that has the controls of the bench."""

    def __init__(self, runner: BenchRunner, live: LiveState, link: NodeLink) -> None:
        self._runner, self._live, self._link = runner, live, link
        self._apply_rig(live.setup)

    async def obey(self, command: dict[str, Any]) -> Reply:
        """Execute a command of a page and return its answer.

        Raises RefusedError if the command or its value is not allowed.
        """
        value = command.get("value")
        match command.get("do"):
            case "call" if value in SERVICES:
                reply = await self._link.request({"call": value})
                if reply["success"]:
                    self._live.on_service(value)
                return reply
            case "call":
                raise RefusedError(f"call: allowed: {', '.join(SERVICES)}")
            case "set":
                return await self._set(str(command.get("name")), value)
            case "set_up" if isinstance(value, dict):
                self.set_up(self.current_setup(value))
            case "set_up":
                raise RefusedError("set-up: allowed: a JSON object")
            case "keep" if self._live.state:  # keep the present bag and restart the same set-up
                self.set_up(self.current_setup({}), keep=True)
            case "keep":
                raise RefusedError(
                    "bag: nothing is recorded yet; allowed: after the cam has turned"
                )
            case "rerun":
                self._runner.request_rerun()
                self.set_up(self.current_setup({}))
            case "note":
                return DONE | {"reading": asdict(self._live.note())}
            case "clear":
                self._live.readings.clear()
            case other:
                raise RefusedError(f"do: is {str(other)[:40]!r}; allowed: {', '.join(COMMANDS)}")
        return DONE

    def set_up(self, setup: Setup, keep: bool = False) -> None:
        """End the present run, and start a run with another set-up.

        If `keep` is True, the bag of the present run is kept.
        """
        settings = self._live.node_settings()
        self._live.setup = setup
        self._live.on_runner_event({"graph": "starting"})
        self._apply_rig(setup)
        self._runner.set_up(setup, settings, keep)

    def next_drawn_name(self) -> str:
        """Return a name for a drawn cam that the bench has not used yet.

        A new name is necessary, because no node accepts another law under a name that it knows.
        """
        return f"drawn_{len(list(self._runner.cams.glob('drawn_*.yaml'))) + 1}"

    async def mount(self, cam: CamConfig) -> None:
        """Mount a drawn cam from the next tick on, or once the nodes have started.

        Raises RefusedError if the law server refuses the cam.
        """
        add_cam(cam, self._runner.cams)
        if self._live.graph != "running":
            return self.set_up(self.current_setup({"cam": cam.name}))
        answer = await self._link.request({"node": "law_server", "name": "cam", "value": cam.name})
        if not answer["success"]:
            raise RefusedError(answer["message"])
        return None

    def _apply_rig(self, setup: Setup) -> None:
        """Use the sound constants and the calibration cam of a set-up's rig."""
        rig = setup.rig(self._runner.rig)
        self.sound = PageSound(RadiationParameters.from_rig(rig), SAMPLE_RATE)
        self.calibrated_on = calibration_cam(rig, setup.model)

    def current_setup(self, changes: dict[str, Any]) -> Setup:
        """Return the set-up with the mounted cam, the commanded speed, and changes."""
        changes = self._live.mounted_cam_and_speed() | changes
        return self._live.setup.with_changes(changes, self._runner.rig)

    async def _set(self, name: str, value: Any) -> Reply:
        if name not in SETTINGS:
            raise RefusedError(f"set: is {name[:40]!r}; allowed: {', '.join(SETTINGS)}")
        node, spec = SETTINGS[name]
        kind = type(spec.default)
        if not (is_number(value) if kind is float else isinstance(value, str)):
            raise RefusedError(f"{name}: is {str(value)[:40]!r}; allowed: {KINDS[kind]}")
        return await self._link.request({"node": node, "name": name, "value": kind(value)})
