"""The client beside a rig, where DDS loses an answer."""

import pytest
from rclpy.task import Future
from std_srvs.srv import Trigger

from cam_rig.testing import client as module
from cam_rig.testing.client import RigClient

pytestmark = pytest.mark.ros


class Deaf:
    """A service's client of which the first answers are lost."""

    def __init__(self, lost):
        self.lost, self.asked = lost, 0

    def service_is_ready(self):
        return True

    def call_async(self, _request):
        self.asked += 1
        future = Future()
        if self.asked > self.lost:
            future.set_result(self.asked)
        return future


@pytest.mark.parametrize("lost", [0, 1, 3])
def test_a_lost_answer_is_asked_for_again(ros_domain, monkeypatch, lost):
    """A service that has not discovered its client drops what it answers."""
    monkeypatch.setattr(module, "ANSWER_S", 0.05)
    with RigClient(ros_domain) as client:
        deaf = Deaf(lost)
        monkeypatch.setattr(client.node, "create_client", lambda *_: deaf)
        monkeypatch.setattr(client.node, "destroy_client", lambda _: None)
        assert client.ask(Trigger, "/any", Trigger.Request()) == lost + 1
