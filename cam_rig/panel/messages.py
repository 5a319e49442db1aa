"""What pages send: JSON objects of a bounded size."""

from __future__ import annotations

import json
from typing import Any

from starlette.requests import Request

from cam_rig.errors import RefusedError

#: Bytes of a page's message, and of a request's body, at most.
MAX_MESSAGE = 1 << 16


async def read_body(request: Request) -> dict[str, Any]:
    """The object in a request's body.

    Raises
    ------
    RefusedError : it is too long, or not an object
    """
    data = b""
    async for chunk in request.stream():
        data += chunk
        if len(data) > MAX_MESSAGE:
            raise RefusedError(f"request: allowed: {MAX_MESSAGE} bytes")
    return read_object(data)


def read_object(text: str | bytes) -> dict[str, Any]:
    """A JSON object.

    Raises
    ------
    RefusedError : it is none
    """
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise RefusedError("message: allowed: a JSON object")
    return found
