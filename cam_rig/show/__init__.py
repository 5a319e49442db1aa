"""What plots and the viewer draw with: colours, outlines, the follower's shape."""

from __future__ import annotations
