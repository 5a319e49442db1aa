"""Tests of the protocol between nodes: results equal the simulation without nodes.

Other programs on the network do not affect them.
"""

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
    """Require that a bag is complete and has exactly the samples of the simulation.

    The recording of the bag is returned.
    """
    recording = read_recording(bag)
    require_complete(bag, recording.loaded.scene)
    simulated = list(simulate(recording.loaded))
    assert [tick.start for tick in recording.ticks] == [tick.start for tick in simulated]
    assert [tick.pressure for tick in recording.ticks] == [tick.pressure for tick in simulated]
    return recording


def test_a_run_equals_the_simulation_without_nodes(undisturbed_bag):
    """The bag of a run of the nodes equals the simulation of its scene, bit for bit."""
    assert len(require_as_simulated(undisturbed_bag).ticks) == TICKS


#: Changes of the short scene: speed ramps, and three ticks (cam states) per turn.
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
def test_runs_of_other_programs_equal_the_simulation(domain, tmp_path, changes):
    """Runs with speed ramps or several short cams equal the simulation bit for bit.

    All ticks (intervals between cam states) are reported in order.
    """
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


def test_no_state_is_sent_before_every_node_is_ready(domain, short_scene, tmp_path):
    """The drive waits for a recorder that starts late, and then sends all cam states."""
    bag = tmp_path / "bag"
    with OneProcess(patient(short_scene, bag), late=["recorder"]) as here:
        wait_until(lambda: here.nodes["cam_drive"]._not_ready == {"recorder"})
        assert here.nodes["follower"].received < 5 and here.nodes["cam_drive"].newest_ns < 0
        here.start("recorder")
        assert [report["tick"] for report in here.progress()][-1] == TICKS
    assert read_counts(bag)["/cam/state"] == TICKS + 1


# Messages of the bag and of subscribers.

#: Topics with one message per published time within a tick (interval between two cam states).
MOVING = (topics.JOINT_STATES, topics.FOLLOWER_CONTACT, topics.FOLLOWER_MARKERS)
#: Latched topics with one message per cam that is mounted.
MOUNTED = (topics.ROBOT_DESCRIPTION, topics.CAM_MARKERS)


def test_a_subscriber_receives_the_messages_of_the_bag(user, short_scene, undisturbed, tmp_path):
    """A subscriber receives each message of the bag once and in order.

    It misses only messages before its discovery. The bag equals that of an undisturbed run.
    """
    bag, received = tmp_path / "bag", {topic: [] for topic in (*MOVING, *MOUNTED)}
    latched = QoSProfile(depth=50, durability=DurabilityPolicy.TRANSIENT_LOCAL)

    def is_known(topic):
        user.spin(0.05)
        return user.node.count_publishers(topic.name) > 0

    def normalised(topic):  # DDS pads messages to a multiple of four bytes
        return [read_message(topic, cdr)[1] for cdr in received[topic]]

    def is_received():  # a spin takes one message from the queue
        user.spin()
        return all(set(normalised(topic)) >= set(payloads[topic.name]) for topic in MOUNTED)

    with OneProcess(patient(short_scene, bag, autostart=False)) as here:
        for topic, messages in received.items():
            profile = latched if topic in MOUNTED else QoSProfile(depth=50_000)
            kind = message_class(topic)
            user.node.create_subscription(kind, topic.name, messages.append, profile, raw=True)
            wait_until(partial(is_known, topic))
        user.call("/cam_drive/start")
        for _ in here.progress():
            user.spin()
    payloads = payloads_of(bag)
    wait_until(lambda: is_received() and all(received.values()))
    for topic in MOVING:
        messages, recorded = normalised(topic), payloads[topic.name]
        first = recorded.index(messages[0])
        assert messages == recorded[first : first + len(messages)]
        assert recorded == undisturbed[topic.name]
    for topic in MOUNTED:  # late subscribers also receive the mounted cam
        assert list(dict.fromkeys(normalised(topic))) == payloads[topic.name]


#: Profile that would block a publisher that waits for its readers: no message is ever dropped.
KEEPS_ALL = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE,
    history=HistoryPolicy.KEEP_ALL,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)


def test_endpoints_of_other_programs_do_not_affect_a_run(
    user, domain, short_scene, undisturbed, tmp_path
):
    """Readers that never read, and writers of other types, do not affect the bag."""
    published = [topic for topic in topics.RECORDING if not topic.type.startswith("tf2_msgs")]
    for topic in published:
        user.node.create_subscription(message_class(topic), topic.name, print, KEEPS_ALL)
    with RigClient(domain) as other:
        publishers = [
            other.node.create_publisher(String, topic.name, KEEPS_ALL)
            for topic in published
            if topic.type != "std_msgs/msg/String"
        ]

        def publish_nonsense(_tick):  # neither of the two other nodes is spun
            for publisher in publishers:
                publisher.publish(String(data="nonsense"))

        run_to_end(short_scene, tmp_path / "bag", publish_nonsense)
    assert payloads_of(tmp_path / "bag") == undisturbed


# Writers that are blocked by a slow subscriber.


@pytest.fixture
def block_writer(monkeypatch):
    """Function that makes DDS reject messages of a topic as if its writer was blocked.

    A message is rejected if the given function returns True. A list that receives the other
    messages is returned.
    """

    def block(topic, is_blocked):
        published, publish = [], Publisher.publish

        def refuse(self, message):
            if self.topic_name != topic.name:
                return publish(self, message)
            if is_blocked():
                raise rclpy_implementation.RCLError("cannot publish data")
            published.append(message)
            return None

        monkeypatch.setattr(Publisher, "publish", refuse)
        return published

    return block


def follow(node, payloads):
    """Pass the recorded laws and cam states of a run to the follower node."""
    for topic, callback in (
        (topics.LAW_COEFFICIENTS, node._on_law),
        (topics.CAM_STATE, node._on_state),
    ):
        for cdr in payloads[topic.name]:
            callback(deserialize_message(cdr, message_class(topic)))


def test_no_tick_is_lost_if_the_writer_is_blocked(make, block_writer, undisturbed):
    """All samples are published although DDS rejects half of the attempts at random.

    The follower publishes the samples of each tick, the interval between two cam states.
    """
    random = Random(0)
    published = block_writer(topics.FOLLOWER_SAMPLES, lambda: random.random() < 0.5)
    follower = make("follower")
    follow(follower, undisturbed)
    follower.publishing_monitor.flush()
    expected = undisturbed[topics.FOLLOWER_SAMPLES.name]
    kind = message_class(topics.FOLLOWER_SAMPLES)
    assert published == [deserialize_message(cdr, kind) for cdr in expected]


def test_blocked_motion_is_skipped_for_a_tick(make, block_writer, undisturbed, monkeypatch, capfd):
    """If DDS rejects a motion message, the rest of its tick is skipped with a warning.

    A tick is the interval between two cam states. The rig does not wait for displays of the motion.
    """
    monkeypatch.setattr(RigPublisher, "get_subscription_count", lambda _self: 1)
    attempts = []
    published = block_writer(topics.JOINT_STATES, lambda: attempts.append(1) or len(attempts) == 5)
    follow(make("follower"), undisturbed)
    expected = undisturbed[topics.JOINT_STATES.name]
    skipped = len(expected) - len(published)
    assert 6 < skipped < 13  # the remainder of the first half turn
    assert published == expected[:4] + expected[4 + skipped :]
    assert "/joint_states: skipped for a tick" in capfd.readouterr().err


def test_a_writer_that_stays_blocked_ends_the_run(make, block_writer, monkeypatch):
    """If the writer of cam states stays blocked, RunError is raised with the topic.

    `publish` itself makes a single attempt, so it does not block the executor.
    """
    monkeypatch.setattr(rig_node, "MAX_BLOCKED_S", 0.0)
    attempts = []
    block_writer(topics.CAM_STATE, lambda: attempts.append(1) or True)
    drive = make("cam_drive")
    for _ in range(3):
        drive._state_publisher.publish(message_class(topics.CAM_STATE)())
    assert len(attempts) == 1
    with pytest.raises(RunError, match="/cam/state: the writer has been blocked for 0 s"):
        drive.publishing_monitor.retry()


def test_weightings_can_be_changed_live(make):
    """The weightings of the microphone can be changed during a run.

    A weighting that is not in the standard IEC 61672-1 is rejected.
    """
    microphone = make("microphone")
    names = ("frequency_weighting", "time_weighting")
    assert [microphone.get_parameter(name).value for name in names] == ["Z", "F"]
    parameters = [Parameter(name, value=v) for name, v in zip(names, "AS", strict=True)]
    assert microphone.set_parameters_atomically(parameters).successful
    assert microphone._meter.quantity == "LAS"
    (result,) = microphone.set_parameters([Parameter("frequency_weighting", value="B")])
    assert not result.successful
    assert microphone._meter.quantity == "LAS"
