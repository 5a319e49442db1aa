"""Control of the drive by the interfaces of simulation_interfaces.

The package is not installed with the libraries of the tests. Classes with the same names, fields
and constants replace its interfaces, and calls of the handlers replace DDS.
"""

import sys
from importlib import import_module
from types import ModuleType, SimpleNamespace

import pytest

from cam_rig.errors import RunError
from cam_rig.live.drive import DriveProgram
from cam_rig.simulation.scene import open_scene

from ..conftest import CONFIG

pytestmark = pytest.mark.ros
#: Numbers of the simulation states in the package simulation_interfaces.
STOPPED, PLAYING, PAUSED, QUITTING = range(4)
#: Numbers of the result codes in the package simulation_interfaces.
UNSUPPORTED, OK, FAILED = 0, 1, 4


def interface(name, **constants):
    """Return a class that replaces a ROS interface: constants, and fields by keyword."""
    return type(name, (SimpleNamespace,), constants)


@pytest.fixture
def control(monkeypatch):
    """Simulation control of a drive with fake interfaces.

    Every state that the drive sends is acknowledged at once. The module of the fake interfaces is
    removed at the end of the test.
    """
    result = interface(
        "Result", RESULT_FEATURE_UNSUPPORTED=0, RESULT_OK=1, RESULT_OPERATION_FAILED=4
    )
    states = {"STATE_STOPPED": 0, "STATE_PLAYING": 1, "STATE_PAUSED": 2, "STATE_QUITTING": 3}
    codes = {"ALREADY_IN_TARGET_STATE": 101, "STATE_TRANSITION_ERROR": 102}
    codes["INCORRECT_TRANSITION"] = 103
    interfaces = {
        "msg": {
            "Result": result,
            "SimulationState": interface("SimulationState", **states),
            "SimulatorFeatures": FEATURES,
        },
        "srv": {
            "GetSimulationState": object,
            "GetSimulatorFeatures": object,
            "ResetSimulation": SimpleNamespace(Request=SimpleNamespace(SCOPE_STATE=2)),
            "SetSimulationState": SimpleNamespace(Response=SimpleNamespace(**codes)),
            "StepSimulation": object,
        },
        "action": {
            "SimulateSteps": SimpleNamespace(Result=SimpleNamespace, Feedback=interface("Feedback"))
        },
    }
    monkeypatch.setitem(sys.modules, "simulation_interfaces", ModuleType("simulation_interfaces"))
    for part, content in interfaces.items():
        module = ModuleType(f"simulation_interfaces.{part}")
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.delitem(sys.modules, "cam_rig.nodes.simulation_control", raising=False)
    module = import_module("cam_rig.nodes.simulation_control")
    monkeypatch.setattr(module, "ActionServer", lambda *_args, **_named: None)
    yield module.SimulationControl(drive := Drive(), drive)
    del sys.modules["cam_rig.nodes.simulation_control"]


FEATURES = interface(
    "SimulatorFeatures",
    SIMULATION_RESET=20, SIMULATION_RESET_STATE=22, SIMULATION_STATE_GETTING=24,
    SIMULATION_STATE_SETTING=25, SIMULATION_STATE_PAUSE=26, STEP_SIMULATION_SINGLE=31,
    STEP_SIMULATION_MULTIPLE=32, STEP_SIMULATION_ACTION=33,
)  # fmt: skip


class Drive:
    """Replacement of the drive's node and its operator controls, for the scene quick."""

    def __init__(self):
        loaded = open_scene(CONFIG / "scenes" / "quick.yaml")
        self.program = DriveProgram(loaded.scene, ["all"], lambda _cam: True)
        self.program.laws.update(loaded.laws)
        self.program.running = False
        self.is_over = False
        self.done = SimpleNamespace(done=lambda: self.is_over)

    def create_service(self, *_):
        """Do not create a service: the tests call the handlers."""

    def send_due(self):
        """Send the next cam state of the drive, and acknowledge it as all other nodes."""
        if (state := self.program.take(0.0)) is not None:
            self.program.flow.acknowledge("all", state.time_ns)
        self.is_over = self.is_over or self.program.done

    def finish(self):
        self.is_over = True

    def start(self):
        if self.program.halted:
            raise RunError("the emergency stop is active")
        self.program.run(True)

    def stop(self):
        self.program.run(False)

    def reset(self):
        self.program.reset()


def call(control, handler, **request):
    """Call a handler with a request, and return the result code and its text."""
    response = getattr(control, handler)(SimpleNamespace(**request), SimpleNamespace())
    return response.result.result, response.result.error_message


def set_state(control, state):
    """Request a state of the simulation, and return the result code of the reply."""
    return call(control, "_set_state", state=SimpleNamespace(state=state))[0]


def step(control, steps, goal=None):
    """Request a number of steps and run the rig until it replies with code and text.

    A step is a tick of the drive, the interval between two cam states.
    """
    coroutine = control._run_ticks(steps, goal)
    try:
        while True:
            coroutine.send(None)
            control._node.send_due()
            control.update()
    except StopIteration as end:
        return end.value.result, end.value.error_message


def test_the_states_of_the_simulation_are_those_of_the_drive(control):
    """Each change of the simulation state has the result code of the interface.

    The tested package is simulation_interfaces. An emergency stop prevents a start.
    """
    assert control.state == STOPPED
    assert set_state(control, PAUSED) == 103  # pausing when stopped
    assert set_state(control, STOPPED) == 101  # already in the state
    assert set_state(control, PLAYING) == OK and control.state == PLAYING
    control._node.send_due()
    assert set_state(control, PAUSED) == OK and control.state == PAUSED
    assert set_state(control, STOPPED) == OK and control.state == STOPPED
    assert set_state(control, 4) == UNSUPPORTED
    control._node.program.halt()
    assert set_state(control, PLAYING) == 102
    assert set_state(control, QUITTING) == OK and control.state == QUITTING


def test_every_feature_is_listed(control):
    """The listed features of simulation_interfaces are those of the drive."""
    response = SimpleNamespace(features=SimpleNamespace())
    control._get_features(None, response)
    assert response.features.features == [20, 22, 24, 25, 26, 31, 32, 33]


def test_only_the_state_can_be_reset(control):
    """A reset of time is reported as unsupported, because rig time never decreases.

    Only the state of the simulation can be reset.
    """
    assert call(control, "_reset", scope=0)[0] == UNSUPPORTED
    assert call(control, "_reset", scope=1)[0] == UNSUPPORTED
    step(control, 2)
    assert call(control, "_reset", scope=2) == (OK, "") and control.state == STOPPED


def test_steps_are_ticks(control):
    """A request of n steps turns the cam by n ticks, and then the rig is paused again.

    A tick is the interval between two cam states. The action publishes feedback for each.
    """
    program, feedback = control._node.program, []
    assert step(control, 1) == (OK, "") and program.sent == 2 and control.state == PAUSED
    assert step(control, 0) == (OK, "") and program.sent == 2
    goal = SimpleNamespace(is_cancel_requested=False, publish_feedback=feedback.append)
    assert step(control, 3, goal) == (OK, "") and program.sent == 5
    assert [f.completed_steps for f in feedback] == [1, 2, 3]
    assert [f.remaining_steps for f in feedback] == [2, 1, 0]


def test_another_command_during_a_step_leaves_the_control_usable(control):
    """A start during a step, with more ticks at the next answer than requested, ends the step.

    The feedback does not exceed the requested number, and later requests are accepted.
    """
    program, feedback = control._node.program, []
    goal = SimpleNamespace(is_cancel_requested=False, publish_feedback=feedback.append)
    coroutine = control._run_ticks(2, goal)
    coroutine.send(None)
    program.run(True)
    for _ in range(5):
        control._node.send_due()
    control.update()
    with pytest.raises(StopIteration) as end:
        coroutine.send(None)
    assert end.value.value.result == OK
    assert [f.remaining_steps for f in feedback] == [1, 0]
    program.run(False)
    assert step(control, 1) == (OK, "")


def test_a_step_that_cannot_be_completed_has_a_reason(control):
    """A request to step the simulation that cannot be completed fails with a reason.

    The rig turns already, the request is cancelled, or the rig is stopped or reaches its end.
    """
    control._node.start()
    assert step(control, 1) == (FAILED, "the rig must be paused; set the state to paused first")
    control._node.stop()
    goal = SimpleNamespace(is_cancel_requested=True, publish_feedback=lambda _: None)
    code, text = step(control, 5, goal)
    assert code == FAILED and text.startswith("the cam was stopped after")
    total = control._node.program.ticks
    code, text = step(control, 1000)
    assert code == FAILED and text.startswith("the run ended after")
    assert int(text.split()[4]) < total
    halted = Drive()
    halted.program.run(True)
    halted.send_due()
    halted.program.halt()
    control._node, control._program = halted, halted.program
    assert step(control, 1)[1] == "the emergency stop is active; reset the rig first"
