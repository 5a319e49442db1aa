"""The small bag of the viewer's tests."""

from ...viewer.conftest import bag

__all__ = ["bag"]
