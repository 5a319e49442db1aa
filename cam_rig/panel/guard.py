"""Who may ask the panel: this machine's own pages that came with the token, and nobody else."""

from __future__ import annotations

from dataclasses import dataclass

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from cam_rig.viewer.server.access import HEADERS, Access
from cam_rig.viewer.server.process import HOST

#: The page takes nothing from another host, and is shown in no other's frame; Rerun's page in one
#: of its own is this machine's.
POLICY = (
    "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; "
    f"form-action 'none'; frame-ancestors 'none'; frame-src http://{HOST}:* http://localhost:*"
)
#: Close code of a websocket that breaks a rule (RFC 6455).
REFUSED = 1008


@dataclass
class Guard:
    """An ASGI application behind Host, Origin and token, for pages and websockets alike.

    Parameters
    ----------
    app : what is guarded
    access : who may ask for it
    home : the page that the printed address leads to
    """

    app: ASGIApp
    access: Access
    home: str = "/"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, hand on, or refuse."""
        if scope["type"] == "lifespan":
            return await self.app(scope, receive, send)
        asked, page = HTTPConnection(scope), scope["type"] == "http"
        token = asked.query_params.get("token") if page else None
        needs_origin = not page or scope["method"] not in ("GET", "HEAD")
        if words := self.access.why_not(asked.headers, token, needs_origin):
            return await self._refuse(words, scope, receive, send)
        if token is not None:
            answer: Response = RedirectResponse(self.home, 303)
            answer.headers["Set-Cookie"] = self.access.cookie
            return await answer(scope, receive, _with_headers(send))
        await self.app(scope, receive, _with_headers(send))

    async def _refuse(self, words: str, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":
            await receive()  # its handshake; closed before it is accepted, it is answered by 403
            return await send({"type": "websocket.close", "code": REFUSED, "reason": words})
        await PlainTextResponse(words + "\n", 403)(scope, receive, _with_headers(send))


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in (HEADERS | {"Content-Security-Policy": POLICY}).items():
                headers[name] = value
        await send(message)

    return sending
