"""What the nodes tell each other: the core's numbers, nothing lost, whoever else is there."""

from functools import partial
from random import Random

import pytest
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from cam_rig.bag.completeness import require_complete
from cam_rig.bag.reader import read_counts
from cam_rig.errors import RunError
from cam_rig.messages import topics
from cam_rig.messages.serialization import read_message
from cam_rig.nodes.base import rig_node
from cam_rig.nodes.base.rig_node import RigPublisher
from cam_rig.nodes.convert import message_class
from cam_rig.schema.load import config_root
from cam_rig.simulation.simulate import simulate
from cam_rig.studies.simulate.recorded import read_recording
from cam_rig.testing.client import RigClient

from .conftest import TICKS, OneProcess, patient, payloads_of, run_to_end, wait_until

pytestmark = pytest.mark.ros
QUICK = config_root() / "scenes" / "quick.yaml"


def require_as_simulated(bag):
    """No tick is missing, and each is the core's to the last bit."""
    recording = read_recording(bag)
    require_complete(bag, recording.loaded.scene)
    alone = list(simulate(recording.loaded))
    assert [tick.start for tick in recording.ticks] == [tick.start for tick in alone]
    assert [tick.pressure for tick in recording.ticks] == [tick.pressure for tick in alone]
    return recording


def test_the_nodes_give_the_numbers_of_the_core(undisturbed_bag):
    """The bag of a run is what the scene gives without nodes."""
    assert len(require_as_simulated(undisturbed_bag).ticks) == TICKS


RAMP = '  ramp: {assumed: 0.4, unit: s, source: "a test"}\n  ticks_per_turn: 3\n'


@pytest.mark.parametrize(
    "changes",
    [
        pytest.param({"published:": RAMP + "published:"}, id="from rest along ramps"),
        pytest.param(
            {
                "cams: [tm21, bezier15]": "cams: [tm21, cycloidal, poly345, bezier15]",
                "[200, 300, 350, 400]": "[300]",
            },
            id="cams of fewer ticks than are in flight",
            marks=pytest.mark.long,
        ),
    ],
)
def test_other_programs_give_the_numbers_of_the_core_too(domain, tmp_path, changes):
    """Every tick from the first; a report on one cam is not taken for the next."""
    text = QUICK.read_text(encoding="utf-8")
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    scene, ticks = tmp_path / "scenes" / "quick.yaml", []
    scene.parent.mkdir()
    scene.write_text(text, encoding="utf-8")
    run_to_end(scene, tmp_path / "bag", ticks.append)
    assert ticks == list(range(len(ticks)))
    require_as_simulated(tmp_path / "bag")


def test_nothing_is_sent_before_every_node_is_ready(domain, short_scene, tmp_path):
    """The recorder stands while it starts: no state goes out; then it goes on, and all goes out."""
    bag = tmp_path / "bag"
    with OneProcess(patient(short_scene, bag), late=["recorder"]) as here:
        wait_until(lambda: here.nodes["cam_drive"]._not_ready == {"recorder"})
        assert here.nodes["follower"].received < 5 and here.nodes["cam_drive"].newest_ns < 0
        here.start("recorder")
        assert [report["tick"] for report in here.progress()][-1] == TICKS
    assert read_counts(bag)["/cam/state"] == TICKS + 1


# A subscriber gets the bytes that the bag holds.

#: At each instant; and, latched, of the mounted cam.
MOVING = (topics.JOINT_STATES, topics.FOLLOWER_CONTACT, topics.FOLLOWER_MARKERS)
MOUNTED = (topics.ROBOT_DESCRIPTION, topics.CAM_MARKERS)


def test_what_a_subscriber_gets_is_what_the_bag_holds(user, short_scene, undisturbed, tmp_path):
    """Byte by byte, each once and in order, from when it has joined; the bag is no other for it."""
    bag, found = tmp_path / "bag", {topic: [] for topic in (*MOVING, *MOUNTED)}
    latched = QoSProfile(depth=50, durability=DurabilityPolicy.TRANSIENT_LOCAL)

    def is_known(topic):
        user.spin(0.05)
        return user.node.count_publishers(topic.name) > 0

    def plain(topic):  # DDS fills the last four bytes up
        return [read_message(topic, cdr)[1] for cdr in found[topic]]

    def is_received():  # a spin takes one message of those that wait
        user.spin()
        return all(set(plain(topic)) >= set(payloads[topic.name]) for topic in MOUNTED)

    with OneProcess(patient(short_scene, bag, autostart=False)) as here:
        for topic, got in found.items():
            how = latched if topic in MOUNTED else QoSProfile(depth=50_000)
            kind = message_class(topic)
            user.node.create_subscription(kind, topic.name, got.append, how, raw=True)
            wait_until(partial(is_known, topic))
        user.call("/cam_drive/start")
        for _ in here.progress():
            user.spin()
    payloads = payloads_of(bag)
    wait_until(lambda: is_received() and all(found.values()))
    for topic in MOVING:
        got, recorded = plain(topic), payloads[topic.name]
        first = recorded.index(got[0])
        assert got == recorded[first : first + len(got)]
        assert recorded == undisturbed[topic.name]
    for topic in MOUNTED:  # one that comes late has the cam that is mounted
        assert list(dict.fromkeys(plain(topic))) == payloads[topic.name]


#: What holds up a publisher that waits for its readers: reliable, and nothing is ever dropped.
KEEPS_ALL = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE,
    history=HistoryPolicy.KEEP_ALL,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)


def test_strangers_change_nothing(user, domain, short_scene, undisturbed, tmp_path):
    """DDS matches no endpoints of different types; and histories keep the newest, so that the drive
    waits for its own consumers, not for a reader that never reads."""
    published = [topic for topic in topics.RECORDING if not topic.type.startswith("tf2_msgs")]
    for topic in published:
        user.node.create_subscription(message_class(topic), topic.name, print, KEEPS_ALL)
    with RigClient(domain) as other:
        out = [
            other.node.create_publisher(String, topic.name, KEEPS_ALL)
            for topic in published
            if topic.type != "std_msgs/msg/String"
        ]

        def talk(_tick):  # neither node is spun
            for publisher in out:
                publisher.publish(String(data="nonsense"))

        run_to_end(short_scene, tmp_path / "bag", talk)
    assert payloads_of(tmp_path / "bag") == undisturbed


# A writer that a subscriber holds up loses nothing that the rig needs.


@pytest.fixture
def hold_up(monkeypatch):
    """Let DDS give up at some messages, as beside a reliable subscriber that takes nothing."""

    def hold(topic, is_held):
        published, publish = [], Publisher.publish

        def refuse(self, message):
            if self.topic_name != topic.name:
                return publish(self, message)
            if is_held():
                raise rclpy_implementation.RCLError("cannot publish data")
            published.append(message)
            return None

        monkeypatch.setattr(Publisher, "publish", refuse)
        return published

    return hold


def follow(node, payloads):
    """Give the follower the laws and states of a run."""
    for topic, take in (
        (topics.LAW_COEFFICIENTS, node._on_law),
        (topics.CAM_STATE, node._on_state),
    ):
        for cdr in payloads[topic.name]:
            take(deserialize_message(cdr, message_class(topic)))


def test_no_tick_is_lost(make, hold_up, undisturbed):
    """The follower publishes every tick's samples, though half of the tries fail."""
    random = Random(0)
    published = hold_up(topics.FOLLOWER_SAMPLES, lambda: random.random() < 0.5)
    follow(make("follower"), undisturbed)
    expected = undisturbed[topics.FOLLOWER_SAMPLES.name]
    kind = message_class(topics.FOLLOWER_SAMPLES)
    assert published == [deserialize_message(cdr, kind) for cdr in expected]


def test_motion_that_is_held_up_is_left_out_for_a_tick(
    make, hold_up, undisturbed, monkeypatch, capfd
):
    """The rig does not wait for people's readers, and names those who may be the reason."""
    monkeypatch.setattr(RigPublisher, "get_subscription_count", lambda _self: 1)
    tries = []
    published = hold_up(topics.JOINT_STATES, lambda: tries.append(1) or len(tries) == 5)
    follow(make("follower"), undisturbed)
    expected = undisturbed[topics.JOINT_STATES.name]
    left_out = len(expected) - len(published)
    assert 6 < left_out < 13  # the rest of the first half turn
    assert published == expected[:4] + expected[4 + left_out :]
    assert "/joint_states: skipped for a tick" in capfd.readouterr().err


def test_a_writer_that_is_never_free_ends_the_run(make, hold_up, monkeypatch):
    """The error names the topic and what to look for."""
    monkeypatch.setattr(rig_node, "MAX_BLOCKED_S", 0.05)
    hold_up(topics.CAM_STATE, lambda: True)
    drive = make("cam_drive")
    with pytest.raises(RunError, match=r"/cam/state: the writer has been blocked for 0\.05 s"):
        drive._state_publisher.publish(message_class(topics.CAM_STATE)())


def test_weightings_change_live(make):
    """A and S from the next tick on; one the standard does not have is refused and changes none."""
    microphone = make("microphone")
    names = ("frequency_weighting", "time_weighting")
    assert [microphone.get_parameter(name).value for name in names] == ["Z", "F"]
    wanted = [Parameter(name, value=v) for name, v in zip(names, "AS", strict=True)]
    assert microphone.set_parameters_atomically(wanted).successful
    assert microphone._meter.quantity == "LAS"
    (refused,) = microphone.set_parameters([Parameter("frequency_weighting", value="B")])
    assert not refused.successful
    assert microphone._meter.quantity == "LAS"
