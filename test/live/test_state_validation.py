"""Which cam states are possible."""

from dataclasses import replace

import pytest

from cam_rig.errors import RefusedError
from cam_rig.live.state_validation import Admission, StateValidator
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import CamState, cam_states

SCENE = open_scene(config_root() / "scenes" / "quick.yaml").scene
STATES = list(cam_states(SCENE))


def test_a_scene_is_admitted_and_its_repetition_known():
    """A drive that was started again sends its last states once more."""
    validator = StateValidator(1000.0)
    assert validator.admit(STATES[0]) is Admission.NEW_SEQUENCE
    assert {validator.admit(state) for state in STATES[1:]} == {Admission.NEXT}
    assert {validator.admit(state) for state in STATES[-9:]} == {Admission.SEEN}


def test_after_standing_a_new_run_may_begin_at_any_time():
    """Nodes outlive a drive: the next one begins at zero again."""
    validator = StateValidator(1000.0)
    for state in STATES:
        validator.admit(state)
    again = [replace(state, angle=state.angle + 1.0) for state in STATES]
    assert validator.admit(again[0]) is Admission.NEW_SEQUENCE
    assert validator.admit(again[1]) is Admission.NEXT


def test_a_successor_passes_over_what_was_done():
    """Histories begin long before the state to go on from."""
    validator = StateValidator(1000.0, STATES[5])
    assert {validator.admit(state) for state in STATES[:6]} == {Admission.SEEN}
    assert validator.admit(STATES[6]) is Admission.NEXT


LAST = CamState(1_000_000_000, 10.0, 20.0, "tm21")


@pytest.mark.parametrize(
    ("state", "words"),
    [
        (CamState(999_999_999, 9.99, 20.0, "tm21"), "stamps that rise"),
        (CamState(1_100_000_000, 12.1, 20.0, "tm21"), "is a second drive at work"),
        (CamState(1_100_000_000, 10.0, 20.0, "tm21"), "θ is 2 rad from"),
        (CamState(1_100_000_000, float("nan"), 20.0, "tm21"), "finite"),
        (CamState(1_100_000_000, 12.0, float("inf"), "tm21"), "finite"),
        (CamState(1_100_000_000, 12.0, -1.0, "tm21"), "ω -1 rad/s; allowed: 0 to"),
        (CamState(1_100_000_000, 12.0, 1e9, "tm21"), "allowed: 0 to 10472"),
        (CamState(-5, 12.0, 1.0, "tm21"), "time from zero"),
        (CamState(10**18, 10.0 + 20.0 * (1e9 - 1), 1.0, "tm21"), "by at most 1000 s"),
    ],
)
def test_what_cannot_follow_is_refused(state, words):
    """The words name the number and what is allowed; the validator stays as it was."""
    validator = StateValidator(1000.0)
    validator.admit(LAST)
    with pytest.raises(RefusedError, match=words):
        validator.admit(state)
    assert validator.admit(CamState(1_100_000_000, 12.0, 30.0, "tm21")) is Admission.NEXT


def test_a_lost_state_is_noticed():
    """At constant speed the next but one leads on too, but a tick is never two turns."""
    validator = StateValidator.of(SCENE)
    validator.admit(STATES[0])
    with pytest.raises(RefusedError, match="was one lost, or is a second drive"):
        validator.admit(STATES[2])
    assert [validator.admit(state) for state in STATES[1:3]] == [Admission.NEXT] * 2


def test_a_linear_ramp_is_no_jump():
    """Half the sum of both speeds leads on too."""
    validator = StateValidator(1000.0)
    validator.admit(LAST)
    assert validator.admit(CamState(1_100_000_000, 12.5, 30.0, "tm21")) is Admission.NEXT


def test_a_node_that_is_not_waited_for_may_miss_states():
    """Histories begin later than where the predecessor ended: what is left is admitted."""
    validator = StateValidator(1000.0, tick_angle=1e-3, since=STATES[5].time_ns)
    assert {validator.admit(state) for state in STATES[:6]} == {Admission.SEEN}
    assert validator.admit(STATES[9]) is Admission.NEW_SEQUENCE
    with pytest.raises(RefusedError, match="was one lost"):
        validator.admit(STATES[12])
