"""Record a test bench without cam_rig: an encoder, a lift gauge and a load cell."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import cam_rig
from benchmark.simulated_instruments import measured_run

TYPES = get_typestore(Stores.ROS2_KILTED)
JOINT = "sensor_msgs/msg/JointState"
WRENCHES = "geometry_msgs/msg/WrenchStamped"
BEGIN_NS = 1_767_225_600_000_000_000  # wall-clock time of the first sample


def kind(name: str) -> Any:
    """Return a message type by its name."""
    return TYPES.types[name]


def header(stamp: int) -> Any:
    """Return a message header with a stamp in ns."""
    return kind("std_msgs/msg/Header")(
        kind("builtin_interfaces/msg/Time")(*divmod(stamp, 10**9)), "bench"
    )


def position(name: str) -> Callable[[int, float], Any]:
    """Return a function that makes a JointState from a stamp and a value."""
    none = np.array([])
    return lambda stamp, value: kind(JOINT)(header(stamp), [name], np.array([value]), none, none)


def along_z(stamp: int, value: float) -> Any:
    """Return a WrenchStamped of a force along z."""
    vector = kind("geometry_msgs/msg/Vector3")
    wrench = kind("geometry_msgs/msg/Wrench")(vector(0.0, 0.0, value), vector(0.0, 0.0, 0.0))
    return kind(WRENCHES)(header(stamp), wrench)


# Simulated machine in place of yours: the follower of the TM21 with 200 g more mass.
rig = cam_rig.load_rig("tm21").with_follower(mass=1.5)
law = cam_rig.build_law(cam_rig.load_cam("tm21"))
run = measured_run(law, rig, "one_mass", [200.0, 300.0, 350.0, 400.0], turns=10.0)
assert run.lift is not None
assert run.force is not None

topics = {
    "/encoder": (JOINT, position("cam"), run.angle.time, run.angle.value),
    "/lvdt": (JOINT, position("follower"), run.lift.time, 1e3 * run.lift.value),  # mm
    "/cell": (WRENCHES, along_z, run.force.time, run.force.value),
}
bag = Path("out/bench")
shutil.rmtree(bag, ignore_errors=True)
bag.parent.mkdir(exist_ok=True)
with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
    for topic, (name, make, times, values) in topics.items():
        connection = writer.add_connection(topic, name, typestore=TYPES)
        for time, value in zip(times.tolist(), values.tolist(), strict=True):
            stamp = BEGIN_NS + round(time * 1e9)
            message = TYPES.serialize_cdr(make(stamp, value), name)
            writer.write(connection, stamp, message)
print(f"{bag}: {', '.join(topics)}, {run.angle.time[-1]:.1f} s")
