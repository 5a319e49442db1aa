"""Delay from a cam state to the answer of each node, at a pacing.

It prints a table. Run it from the root of the repository: .venv/bin/python -m
benchmark.node_latency [pacing] [scene]
"""

from __future__ import annotations

import os
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor

from cam_rig.messages import topics
from cam_rig.messages.codec import stamp_ns
from cam_rig.nodes.convert import message_class, qos
from cam_rig.runner.graph import Graph
from cam_rig.runner.node_process import environment, live_nodes
from cam_rig.schema.load import config_root

ANSWERS = {
    "follower": topics.FOLLOWER_STATE,
    "microphone": topics.PRESSURE,
    "recorder": topics.RECORDER_ACK,
}


def main(pacing: str = "5x", scene: str = "tm21_sweep_48khz") -> None:
    """Run the scene, record the times of its messages and print the delays (ms)."""
    os.environ.update(environment())
    rclpy.init()
    node = rclpy.create_node("listener")
    heard: dict[str, dict[int, float]] = {name: {} for name in ("cam_drive", *ANSWERS)}

    def listen(name: str, topic: topics.Topic) -> None:
        def take(message: object) -> None:
            header = getattr(message, "header", message)
            heard[name].setdefault(stamp_ns(header.stamp), time.perf_counter())  # type: ignore[attr-defined]

        node.create_subscription(message_class(topic), topic.name, take, qos(topic))

    for name, topic in {"cam_drive": topics.CAM_STATE, **ANSWERS}.items():
        listen(name, topic)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    spinning = threading.Thread(target=executor.spin, daemon=True)
    spinning.start()
    path = config_root() / "scenes" / f"{scene}.yaml"
    folder = tempfile.TemporaryDirectory()
    with folder, Graph(live_nodes(path, Path(folder.name) / "bag", pacing=pacing)) as graph:
        for _ in graph.progress():
            pass
    executor.shutdown()
    spinning.join()
    print(f"{scene} at {pacing}: ms from the state that closes a tick to the answer")
    for name in ANSWERS:
        both = sorted(heard["cam_drive"].keys() & heard[name].keys())[5:]
        late = [1e3 * (heard[name][stamp] - heard["cam_drive"][stamp]) for stamp in both]
        print(name, *(f"{q} %: {np.percentile(late, q):.2f}" for q in (50, 90, 99)), sep="   ")


if __name__ == "__main__":
    main(*sys.argv[1:])
