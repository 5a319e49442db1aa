"""Services and action of the ROS package simulation_interfaces, for the drive.

The package is optional, so this module is imported only where it is installed. One step is one
tick. A rig that is stepped computes the same samples as a rig that turns without a pause. Rig time
is never reset.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rclpy.action import ActionServer, CancelResponse
from rclpy.task import Future
from simulation_interfaces.action import SimulateSteps
from simulation_interfaces.msg import Result, SimulationState, SimulatorFeatures
from simulation_interfaces.srv import (
    GetSimulationState,
    GetSimulatorFeatures,
    ResetSimulation,
    SetSimulationState,
    StepSimulation,
)

from cam_rig.errors import CamRigError

if TYPE_CHECKING:
    from cam_rig.nodes.cam_drive import CamDrive, DriveControls

#: Features that `SimulationControl` supports, by their names in SimulatorFeatures.
FEATURES = (
    "SIMULATION_RESET", "SIMULATION_RESET_STATE", "SIMULATION_STATE_GETTING",
    "SIMULATION_STATE_SETTING", "SIMULATION_STATE_PAUSE", "STEP_SIMULATION_SINGLE",
    "STEP_SIMULATION_MULTIPLE", "STEP_SIMULATION_ACTION",
)  # fmt: skip


class SimulationControl:
    """Services and action by which a supervisor plays, pauses, steps and resets the rig.

    STATE_STOPPED is the start of the scene, STATE_PAUSED any other stopped cam. The callbacks run
    on the thread of the executor. A step request waits for the acknowledgements of its ticks in a
    coroutine, which does not block the executor. A tick is the time between two cam states.
    """

    def __init__(self, node: CamDrive, controls: DriveControls) -> None:
        self._node, self._controls, self._program = node, controls, node.program
        self._progress: Future | None = None  # completed at each change while ticks are stepped
        for kind, name, handle in (
            (GetSimulatorFeatures, "get_simulator_features", self._get_features),
            (GetSimulationState, "get_simulation_state", self._get_state),
            (SetSimulationState, "set_simulation_state", self._set_state),
            (ResetSimulation, "reset_simulation", self._reset),
            (StepSimulation, "step_simulation", self._step),
        ):
            node.create_service(kind, f"~/{name}", handle)
        self._action = ActionServer(
            node,
            SimulateSteps,
            "~/simulate_steps",
            self._simulate_steps,
            cancel_callback=self._on_cancel,
        )

    def update(self) -> None:
        """Continue a waiting step request after the state of the drive has changed."""
        if self._progress is not None and not self._progress.done():
            self._progress.set_result(None)

    @property
    def state(self) -> int:
        """Present state of the simulation, a constant of SimulationState."""
        if self._node.done.done():
            return int(SimulationState.STATE_QUITTING)
        if self._program.running:
            return int(SimulationState.STATE_PLAYING)
        is_start = self._program.at_start
        return int(SimulationState.STATE_STOPPED if is_start else SimulationState.STATE_PAUSED)

    def _get_features(self, _request: Any, response: Any) -> Any:
        response.features.features = [getattr(SimulatorFeatures, name) for name in FEATURES]
        response.features.custom_info = "cam_rig: a step is one tick; rig time is never reset"
        return response

    def _get_state(self, _request: Any, response: Any) -> Any:
        response.state.state = self.state
        response.result = make_result()
        return response

    def _set_state(self, request: Any, response: Any) -> Any:
        target, kinds = request.state.state, SetSimulationState.Response
        response.result = make_result()
        if target == self.state:
            response.result = make_result(kinds.ALREADY_IN_TARGET_STATE, "already in this state")
        elif target == SimulationState.STATE_PLAYING:
            try:
                self._controls.start()
            except CamRigError as error:
                response.result = make_result(kinds.STATE_TRANSITION_ERROR, str(error))
        elif target == SimulationState.STATE_PAUSED and not self._program.running:
            text = "the rig is stopped at the start of its scene; play it first"
            response.result = make_result(kinds.INCORRECT_TRANSITION, text)
        elif target == SimulationState.STATE_PAUSED:
            self._controls.stop()
        elif target == SimulationState.STATE_STOPPED:
            self._controls.reset()
        elif target == SimulationState.STATE_QUITTING:
            self._node.finish()
        else:
            text = f"state must be stopped, playing, paused or quitting (0 to 3), got {target}"
            response.result = make_result(Result.RESULT_FEATURE_UNSUPPORTED, text)
        return response

    def _reset(self, request: Any, response: Any) -> Any:
        response.result = make_result()
        if request.scope == ResetSimulation.Request.SCOPE_STATE:
            self._controls.reset()
        else:
            text = "rig time is never reset and nothing is spawned; use SCOPE_STATE (2)"
            response.result = make_result(Result.RESULT_FEATURE_UNSUPPORTED, text)
        return response

    def _on_cancel(self, _goal: Any) -> CancelResponse:
        self.update()
        return CancelResponse.ACCEPT

    async def _step(self, request: Any, response: Any) -> Any:
        response.result = await self._run_ticks(request.steps)
        return response

    async def _simulate_steps(self, goal: Any) -> Any:
        result = await self._run_ticks(goal.request.steps, goal)
        if goal.is_cancel_requested:
            goal.canceled()
        elif result.result == Result.RESULT_OK:
            goal.succeed()
        else:
            goal.abort()
        return SimulateSteps.Result(result=result)

    async def _run_ticks(self, steps: int, goal: Any = None) -> Any:
        """Turn the cam by a number of ticks, wait for them, and return a Result.

        A tick is the time between two cam states. A `goal` of the action receives feedback for each
        tick, and may cancel the remaining ticks.
        """
        program = self._program
        text = ""
        if program.halted:
            text = "the emergency stop is active; reset the rig first"
        elif self._progress is not None or program.running:
            text = "the rig must be paused; set the state to paused first"
        if text or steps == 0:
            return make_result(Result.RESULT_OPERATION_FAILED if text else Result.RESULT_OK, text)
        try:
            completed = await self._turn(steps, goal)
        finally:
            self._progress = None
        if completed == steps:
            return make_result()
        reason = "the run ended" if self._node.done.done() else "the cam was stopped"
        text = f"{reason} after {completed} of {steps} steps"
        return make_result(Result.RESULT_OPERATION_FAILED, text)

    async def _turn(self, steps: int, goal: Any) -> int:
        """Turn the cam by a number of ticks, and return the number of processed ticks.

        Another command can stop the cam earlier, or start it, so that it turns on.
        """
        program = self._program
        first, completed = max(program.sent, 1), 0
        program.run_ticks(steps)
        progress = self._progress = Future()
        self._node.send_due()
        while True:
            processed = min(steps, program.sent - first - program.flow.in_flight)
            for count in range(completed + 1, processed + 1) if goal is not None else ():
                feedback = {"completed_steps": count, "remaining_steps": steps - count}
                goal.publish_feedback(SimulateSteps.Feedback(**feedback))
            completed = max(completed, processed)
            is_stopped = not (program.running or program.flow.in_flight)  # by another command
            if completed == steps or is_stopped or self._node.done.done():
                return completed
            await progress
            progress = self._progress = Future()
            if goal is not None and goal.is_cancel_requested:
                program.run(False)


def make_result(code: int = Result.RESULT_OK, text: str = "") -> Any:
    """Return a Result with its code and the text of an error."""
    return Result(result=code, error_message=text)
