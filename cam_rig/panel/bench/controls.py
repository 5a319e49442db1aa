"""What the bench's controls do: a node's parameter, a service of the drive, another set-up."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import asdict
from typing import Any

from cam_rig.acoustics import RadiationParameters
from cam_rig.errors import RefusedError
from cam_rig.panel.bench.link import NodeLink
from cam_rig.panel.bench.live_state import LiveState
from cam_rig.panel.bench.runner import BenchRunner
from cam_rig.panel.bench.setup import SAMPLE_RATE, Setup, add_cam
from cam_rig.panel.bench.sound import PageSound
from cam_rig.schema import CamConfig

#: What a page may set, its kind, and on which node.
SETTINGS: dict[str, tuple[type, str]] = {
    "rpm": (float, "cam_drive"),
    "pacing": (str, "cam_drive"),
    "cam": (str, "law_server"),
    "frequency_weighting": (str, "microphone"),
    "time_weighting": (str, "microphone"),
}
KINDS = {float: "number", str: "text"}
EMERGENCY_STOP = "emergency_stop"
START, STOP = "start", "stop"
SERVICES = (START, STOP, "reset", EMERGENCY_STOP)

Reply = dict[str, Any]
DONE: Reply = {"success": True, "words": ""}


class BenchControls:
    """Obeys the commands of the page that holds the controls.

    Parameters
    ----------
    runner : of the node graph
    live : what the pages are shown
    link : to the nodes
    """

    def __init__(self, runner: BenchRunner, live: LiveState, link: NodeLink) -> None:
        self._runner, self._live, self._link = runner, live, link
        self.sound = self._sound(live.setup)
        self._commands: dict[Any, Callable[[dict[str, Any]], Awaitable[Reply]]] = {
            "call": self._call,
            "set": self._set,
            "set_up": self._change_setup,
            "keep": self._keep,
            "start_again": self._start_again,
            "note": self._note,
            "clear": self._clear,
        }

    async def obey(self, command: dict[str, Any]) -> Reply:
        """Do what a command says; what came of it.

        Raises
        ------
        RefusedError : there is no such command, or it is not allowed now
        """
        act = self._commands.get(str(command.get("do")))
        if act is None:
            raise RefusedError(
                f"do: is {str(command.get('do'))[:40]!r}; allowed: {', '.join(self._commands)}"
            )
        return await act(command)

    def set_up(self, setup: Setup, keep: bool = False) -> None:
        """End the present run, and begin one of a set-up."""
        chosen = self._live.chosen()
        self._live.setup = setup
        self._live.happened({"graph": "starting"})
        self.sound = self._sound(setup)
        self._runner.set_up(setup, chosen, keep)

    def drawn_name(self) -> str:
        """A cam's name that the bench has not had: no node takes another law of a known one."""
        return f"drawn_{len(list(self._runner.cams.glob('drawn_*.yaml'))) + 1}"

    async def mount(self, cam: CamConfig) -> None:
        """Turn a cam of its own from the next tick on, or once the nodes are there.

        Raises
        ------
        RefusedError : the law server refuses it
        """
        add_cam(cam, self._runner.cams)
        if self._live.graph != "running":
            return self.set_up(self._as_it_is({"cam": cam.name}))
        answer = await self._link.ask({"node": "law_server", "name": "cam", "value": cam.name})
        if not answer["success"]:
            raise RefusedError(answer["words"])
        return None

    def _sound(self, setup: Setup) -> PageSound:
        return PageSound(RadiationParameters.from_rig(setup.rig(self._runner.rig)), SAMPLE_RATE)

    def _as_it_is(self, given: dict[str, Any]) -> Setup:
        """The set-up with the cam that is mounted, the speed that is commanded, and more."""
        return self._live.setup.changed(self._live.mounted() | given, self._runner.rig)

    async def _call(self, command: dict[str, Any]) -> Reply:
        if command.get("value") not in SERVICES:
            raise RefusedError(f"call: allowed: {', '.join(SERVICES)}")
        reply = await self._link.ask({"call": command["value"]})
        if reply["success"] and command["value"] in (STOP, START):
            (self._live.stopped if command["value"] == STOP else self._live.started)()
        return reply

    async def _set(self, command: dict[str, Any]) -> Reply:
        name, value = str(command.get("name")), command.get("value")
        if name not in SETTINGS:
            raise RefusedError(f"set: is {name[:40]!r}; allowed: {', '.join(SETTINGS)}")
        kind, node = SETTINGS[name]
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not (is_number if kind is float else isinstance(value, str)):
            raise RefusedError(f"{name}: is {str(value)[:40]!r}; allowed: a {KINDS[kind]}")
        try:
            wanted = {"node": node, "name": name, "value": kind(value)}
        except OverflowError:
            raise RefusedError(f"{name}: allowed: a number of fewer digits") from None
        return await self._link.ask(wanted)

    async def _change_setup(self, command: dict[str, Any]) -> Reply:
        given = command.get("value")
        if not isinstance(given, dict):
            raise RefusedError("set-up: allowed: a JSON object")
        self.set_up(self._as_it_is(given))
        return DONE

    async def _keep(self, _command: dict[str, Any]) -> Reply:
        """Close the present bag and keep it; the same set-up begins anew."""
        if not self._live.state:
            raise RefusedError("bag: nothing is recorded yet; allowed: after the cam has turned")
        self.set_up(self._as_it_is({}), keep=True)
        return DONE

    async def _start_again(self, command: dict[str, Any]) -> Reply:
        node = str(command.get("value"))
        if node not in self._live.ended:
            raise RefusedError(f"start again: is {node[:40]!r}; allowed: a node that has ended")
        self._runner.start_again(node)
        return DONE

    async def _note(self, _command: dict[str, Any]) -> Reply:
        return DONE | {"noted": asdict(self._live.note())}

    async def _clear(self, _command: dict[str, Any]) -> Reply:
        self._live.clear()
        return DONE
