"""Publishing beside subscribers that hold a writer up: nothing the rig needs is left out."""

from __future__ import annotations

import time
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.publisher import Publisher

from cam_rig.errors import RunError

#: Wall time (s) that a message may wait for its writer. DDS gives up after 0.1 s each time: the
#: writer is busy while it sends again what a reliable subscriber, full and never read, refuses.
MAX_HELD_S = 60.0


class RigPublisher(Publisher):
    """A publisher that does not lose a message because its writer is held up."""

    def publish(self, msg: Any) -> None:
        """Publish a message, when its writer is free.

        Raises
        ------
        RunError : it was held up for `MAX_HELD_S`
        """
        deadline = time.monotonic() + MAX_HELD_S
        while not self.offer(msg):
            if time.monotonic() > deadline:
                raise RunError(
                    f"{self.topic_name}: cannot be published for {MAX_HELD_S:g} s; does a "
                    "subscriber take nothing?"
                )

    def offer(self, msg: Any) -> bool:
        """Publish a message unless its writer is held up; whether it is published."""
        try:
            super().publish(msg)
        except rclpy_implementation.RCLError:
            return False
        return True
