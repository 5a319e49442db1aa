"""Who may ask a server of this machine: a browser that came with its token, and nobody else."""

from __future__ import annotations

import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field

from cam_rig.viewer.process import HOST

#: Sent with every answer, also with a refusal.
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


@dataclass(frozen=True)
class Access:
    """Host, origin and token that a request must have.

    The address that is printed has the token; it becomes a cookie at once, and leaves the address.

    Parameters
    ----------
    port : at which is served
    token : what the printed address has
    """

    port: int
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))

    @property
    def hosts(self) -> tuple[str, ...]:
        """The names under which a browser may ask."""
        return tuple(f"{name}:{self.port}" for name in (HOST, "localhost"))

    @property
    def address(self) -> str:
        """What a browser is given."""
        return f"http://{self.hosts[0]}/?token={self.token}"

    @property
    def cookie_name(self) -> str:
        """A cookie is of a host, and another server has another port."""
        return f"cam_rig_{self.port}"

    @property
    def cookie(self) -> str:
        """The header that sets the cookie.

        Not ``Strict``: a browser would not send it with the page that a file of ours opens.
        """
        return f"{self.cookie_name}={self.token}; HttpOnly; Path=/; SameSite=Lax"

    def why_not(
        self, headers: Mapping[str, str], token: str | None, needs_origin: bool = False
    ) -> str:
        """Why a request is refused; empty where it is not.

        ``token`` is that of its address, None where that has none. A browser always names the
        origin of a websocket or a POST (``needs_origin``), and none of a page of its own.
        """
        if headers.get("host") not in self.hosts:
            return f"allowed hosts: {', '.join(self.hosts)}"
        own, origin = [f"http://{host}" for host in self.hosts], headers.get("origin")
        if (origin is not None or needs_origin) and origin not in own:
            return "allowed: pages of this address alone"
        given = self._of_cookie(headers.get("cookie") or "") if token is None else token
        if not secrets.compare_digest(given.encode(errors="replace"), self.token.encode()):
            return "allowed: the whole address that was printed, with its token"
        return ""

    def _of_cookie(self, cookies: str) -> str:
        pairs = (pair.strip().partition("=") for pair in cookies.split(";"))
        return next((value for name, _, value in pairs if name == self.cookie_name), "")
