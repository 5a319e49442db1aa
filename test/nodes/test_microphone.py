"""The microphone's weightings are parameters that may change while it listens."""

import pytest
import rclpy
from rclpy.parameter import Parameter

from cam_rig.nodes.microphone import Microphone

pytestmark = pytest.mark.ros


@pytest.fixture
def microphone(ros_domain):
    rclpy.init()
    node = Microphone()
    yield node
    node.destroy_node()
    rclpy.shutdown()


def test_weightings_change_live(microphone):
    """A and S from the next tick on; one the standard does not have is refused and changes none."""
    assert microphone.get_parameter("frequency_weighting").value == "Z"
    assert microphone.get_parameter("time_weighting").value == "F"
    wanted = [Parameter("frequency_weighting", value="A"), Parameter("time_weighting", value="S")]
    assert microphone.set_parameters_atomically(wanted).successful
    assert microphone._meter.quantity == "LAS"
    refused = microphone.set_parameters([Parameter("frequency_weighting", value="B")])[0]
    assert not refused.successful
    assert refused.reason == "frequency_weighting: has B; allowed: A, C, Z"
    assert microphone._meter.quantity == "LAS"
