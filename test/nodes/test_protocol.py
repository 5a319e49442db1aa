"""What the nodes tell each other: the core's numbers, nothing lost, whoever else is there."""

from functools import partial
from random import Random

import pytest
from geometry_msgs.msg import WrenchStamped
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from cam_rig.bag.completeness import require_complete
from cam_rig.bag.reader import read_counts, read_recording
from cam_rig.errors import RunError
from cam_rig.messages import topics
from cam_rig.messages.serialization import read_message
from cam_rig.nodes import rig_node
from cam_rig.nodes.convert import ResendBuffer, message_class
from cam_rig.nodes.rig_node import RigPublisher
from cam_rig.schema.load import config_root
from cam_rig.simulation.simulate import simulate
from cam_rig.testing.client import RigClient

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


def test_the_nodes_give_the_numbers_of_the_core(rig, undisturbed_bag):
    """The bag of a run is what the scene gives without nodes."""
    assert len(require_as_simulated(undisturbed_bag).ticks) == rig.ticks


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
def test_other_programs_give_the_numbers_of_the_core_too(domain, rig, tmp_path, changes):
    """Every tick from the first; a report on one cam is not taken for the next."""
    text = QUICK.read_text(encoding="utf-8")
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    scene, ticks = tmp_path / "scenes" / "quick.yaml", []
    scene.parent.mkdir()
    scene.write_text(text, encoding="utf-8")
    rig.run_here(scene, tmp_path / "bag", ticks.append)
    assert ticks == list(range(len(ticks)))
    require_as_simulated(tmp_path / "bag")


def test_nothing_is_sent_before_every_node_is_ready(domain, rig, short_scene, wait_for, tmp_path):
    """The recorder stands while it starts: no state goes out; then it goes on, and all goes out."""
    bag = tmp_path / "bag"
    with rig.here(rig.live(short_scene, bag), late=["recorder"]) as here:
        wait_for(lambda: here.nodes["cam_drive"]._awaited == {"recorder"})
        assert here.nodes["follower"].taken < 5 and here.nodes["cam_drive"].newest_ns < 0
        here.start("recorder")
        assert [report["tick"] for report in here.progress()][-1] == rig.ticks
    assert read_counts(bag)["/cam/state"] == rig.ticks + 1


# A subscriber gets the bytes that the bag holds.

KINDS = {
    topics.JOINT_STATES: JointState,
    topics.FOLLOWER_CONTACT: WrenchStamped,
    topics.FOLLOWER_MARKERS: MarkerArray,
}
#: What the law server says of the mounted cam, latched.
MOUNTED = {topics.ROBOT_DESCRIPTION: String, topics.CAM_MARKERS: MarkerArray}


def test_what_a_subscriber_gets_is_what_the_bag_holds(
    user, rig, short_scene, undisturbed, wait_for, tmp_path
):
    """Byte by byte, each once and in order, from when it has joined; the bag is no other for it."""
    bag, found = tmp_path / "bag", {topic.name: [] for topic in KINDS}
    mounted = {topic.name: [] for topic in MOUNTED}

    def is_known(topic):
        user.spin(0.05)
        return user.node.count_publishers(topic.name) > 0

    def is_received():
        user.spin()
        return all(found.values()) and all(mounted.values())

    with rig.here(rig.live(short_scene, bag, autostart=False)) as here:
        for topic, kind in KINDS.items():
            got = found[topic.name].append
            user.node.create_subscription(kind, topic.name, got, QoSProfile(depth=50_000), raw=True)
            wait_for(partial(is_known, topic))
        for topic, kind in MOUNTED.items():
            got = mounted[topic.name].append
            late = QoSProfile(depth=50, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            user.node.create_subscription(kind, topic.name, got, late, raw=True)
            wait_for(partial(is_known, topic))
        user.call("/cam_drive/start")
        for _ in here.progress():
            is_received()
    payloads = rig.payloads(bag)

    def is_drained():  # a spin takes one message of those that wait
        is_received()
        known = {t.name: {read_message(t, cdr)[1] for cdr in mounted[t.name]} for t in MOUNTED}
        return all(found.values()) and all(known[n] >= set(payloads[n]) for n in known)

    wait_for(is_drained)
    for topic in (*KINDS, *MOUNTED):  # DDS fills the last four bytes up
        got = (found | mounted)[topic.name]
        got[:] = [read_message(topic, cdr)[1] for cdr in got]
    for name, got in found.items():
        recorded = payloads[name]
        assert recorded == undisturbed[name]
        first = recorded.index(got[0])
        assert got == recorded[first : first + len(got)]
    for name, got in mounted.items():  # one that comes late has the cam that is mounted
        assert list(dict.fromkeys(got)) == payloads[name]


#: What holds up a publisher that waits for its readers: reliable, and nothing is ever dropped.
KEEPS_ALL = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE,
    history=HistoryPolicy.KEEP_ALL,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)


def test_strangers_change_nothing(user, domain, rig, short_scene, undisturbed, tmp_path):
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

        rig.run_here(short_scene, tmp_path / "bag", talk)
    assert rig.payloads(tmp_path / "bag") == undisturbed


# Answers that were lost to queue overflow are sent again.


class Listener:
    """Stands in for a publisher: remembers what went out."""

    def __init__(self):
        self.published = []

    def publish(self, message):
        self.published.append(message)


def test_a_tick_is_resent_in_order():
    """All messages of the tick that is asked for, and of no other."""
    out, repeats = Listener(), ResendBuffer()
    repeats.publish(10, [(out, "a"), (out, "b")])
    repeats.publish(20, [(out, "c")])
    repeats.resend(10)
    assert out.published == ["a", "b", "c", "a", "b"]


def test_only_ticks_in_flight_are_remembered():
    """Memory is bounded; what every consumer has acknowledged is not resent."""
    out, repeats = Listener(), ResendBuffer()
    for stamp in range(100):
        repeats.publish(stamp, [(out, stamp)])
    out.published.clear()
    for stamp in range(100):
        repeats.resend(stamp)
    assert out.published == [95, 96, 97, 98, 99]


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
    assert "/joint_states: left out for a tick" in capfd.readouterr().err


def test_a_writer_that_is_never_free_ends_the_run(make, hold_up, monkeypatch):
    """The error names the topic and what to look for."""
    monkeypatch.setattr(rig_node, "MAX_HELD_S", 0.05)
    hold_up(topics.CAM_STATE, lambda: True)
    drive = make("cam_drive")
    with pytest.raises(RunError, match=r"/cam/state: cannot be published for 0\.05 s"):
        drive._state_out.publish(message_class(topics.CAM_STATE)())


def test_weightings_change_live(make):
    """A and S from the next tick on; one the standard does not have is refused and changes none."""
    microphone = make("microphone")
    names = ("frequency_weighting", "time_weighting")
    assert [microphone.get_parameter(name).value for name in names] == ["Z", "F"]
    wanted = [Parameter(name, value=v) for name, v in zip(names, "AS", strict=True)]
    assert microphone.set_parameters_atomically(wanted).successful
    assert microphone._meter.quantity == "LAS"
    refused = microphone.set_parameters([Parameter("frequency_weighting", value="B")])[0]
    assert (refused.successful, refused.reason) == (
        False,
        "frequency_weighting: has B; allowed: A, C, Z",
    )
    assert microphone._meter.quantity == "LAS"
