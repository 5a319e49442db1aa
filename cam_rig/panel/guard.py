"""Who may ask the panel: this machine's own pages that came with the token, and nobody else."""

from __future__ import annotations

import secrets
from dataclasses import dataclass, field

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from cam_rig.viewer.server.process import HOST

#: The page takes nothing from another host, and is shown in no other's frame; Rerun's page in one
#: of its own is this machine's.
POLICY = (
    "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; "
    f"form-action 'none'; frame-ancestors 'none'; frame-src http://{HOST}:*"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
#: Close code of a websocket that breaks a rule (RFC 6455).
REFUSED = 1008


@dataclass
class Guard:
    """An ASGI application behind Host, Origin and token, for pages and websockets alike.

    The address that is printed has the token; it becomes a cookie at once, and leaves the address.

    Parameters
    ----------
    app : what is guarded
    port : at which it is served
    token : what the printed address has
    home : the page that it leads to
    """

    app: ASGIApp
    port: int
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))
    home: str = "/"

    @property
    def hosts(self) -> tuple[str, ...]:
        """The names under which a browser may ask for it."""
        return tuple(f"{name}:{self.port}" for name in (HOST, "localhost"))

    @property
    def address(self) -> str:
        """What a browser is given."""
        return f"http://{self.hosts[0]}/?token={self.token}"

    @property
    def cookie(self) -> str:
        """Its name: cookies are of a host, and another panel has another port."""
        return f"cam_rig_panel_{self.port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, hand on, or refuse."""
        if scope["type"] == "lifespan":
            return await self.app(scope, receive, send)
        asked = HTTPConnection(scope)
        if words := self._why_not(asked):
            return await self._refuse(words, scope, receive, send)
        if scope["type"] == "http" and "token" in asked.query_params:
            answer: Response = RedirectResponse(self.home, 303)
            answer.set_cookie(self.cookie, self.token, httponly=True, samesite="strict")
            return await answer(scope, receive, _with_headers(send))
        await self.app(scope, receive, _with_headers(send))

    def _why_not(self, asked: HTTPConnection) -> str:
        """Why a request is refused; empty where it is not."""
        if asked.headers.get("host") not in self.hosts:
            return f"allowed hosts: {', '.join(self.hosts)}"
        origin = asked.headers.get("origin")
        # A browser sends none with a page of its own; with a websocket or a POST it always does.
        needed = asked.scope["type"] == "websocket" or asked.scope["method"] not in ("GET", "HEAD")
        if (origin is not None or needed) and origin not in [f"http://{h}" for h in self.hosts]:
            return "allowed: pages of this address alone"
        given = asked.cookies.get(self.cookie, "")
        if asked.scope["type"] == "http":
            given = asked.query_params.get("token", given)
        if not secrets.compare_digest(given.encode(), self.token.encode()):
            return "allowed: the whole address that cam-rig panel printed, with its token"
        return ""

    async def _refuse(self, words: str, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":
            await receive()  # its handshake; closed before it is accepted, it is answered by 403
            return await send({"type": "websocket.close", "code": REFUSED, "reason": words})
        await PlainTextResponse(words + "\n", 403)(scope, receive, _with_headers(send))


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers[name] = value
        await send(message)

    return sending
