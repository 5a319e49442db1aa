"""What pages send: JSON objects of a bounded size, read in one place for all pages."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route
from starlette.websockets import WebSocket, WebSocketDisconnect

from cam_rig.errors import CamRigError, RefusedError

#: Bytes of a page's message, and of a request's body, at most.
MAX_MESSAGE = 1 << 16

Answer = Callable[[dict[str, Any]], Awaitable[dict[str, Any] | Response]]


def post(path: str, answer: Answer) -> Route:
    """A route that answers the object in a request's body.

    With 400 where it is none, with 409 where ``answer`` raises a CamRigError: ``words`` are why.
    """

    async def answered(request: Request) -> Response:
        try:
            body = await _read_body(request)
        except RefusedError as error:
            return JSONResponse({"words": str(error)}, 400)
        try:
            found = await answer(body)
        except CamRigError as error:
            return JSONResponse({"words": str(error)}, 409)
        return found if isinstance(found, Response) else JSONResponse(found)

    return Route(path, answered, methods=["POST"])


async def _read_body(request: Request) -> dict[str, Any]:
    data = b""
    async for chunk in request.stream():
        data += chunk
        if len(data) > MAX_MESSAGE:
            raise RefusedError(f"request: allowed: {MAX_MESSAGE} bytes")
    return read_object(data)


async def read_frame(socket: WebSocket) -> dict[str, Any]:
    """The object in a page's next message.

    Raises
    ------
    RefusedError : the message is none
    WebSocketDisconnect : the page is closed
    """
    message = await socket.receive()
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message.get("code", 1005))
    return read_object(message.get("text") or "")


def read_object(text: str | bytes) -> dict[str, Any]:
    """A JSON object that can be answered as JSON: finite numbers, and text that is Unicode.

    Raises
    ------
    RefusedError : it is none
    """
    try:
        found = json.loads(text, parse_int=_number)
        # Python reads NaN, 1e999 and half a surrogate pair, and no page could be sent them back.
        json.dumps(found, allow_nan=False, ensure_ascii=False).encode()
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise RefusedError("message: allowed: a JSON object, of finite numbers and Unicode text")
    return found


def _number(digits: str) -> int | float:
    """A whole number; one that a double does not hold is infinite."""
    found = float(digits)
    return int(digits) if abs(found) < 2.0**53 else found
