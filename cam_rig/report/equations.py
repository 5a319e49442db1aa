"""Equations as MathML, from the line of text that a page of Markdown has.

Products stand as words beside each other: ``m ẍ + (k + k_s) x = k_s s``. ``_`` and ``^`` put what
comes next below or above, ``/`` makes a fraction of its neighbours and ``√`` a root; brackets that
only hold such a part together are not drawn.
"""

from __future__ import annotations

import re
import unicodedata

from markupsafe import Markup, escape

#: A number, letters with their dots and primes, or any other sign.
_TOKEN = re.compile(r"\d+(?:\.\d+)?|(?:[^\W\d_][\u0300-\u036f]*)+[′″‴]?|\S")
#: A letter with an index in a sentence.
_INDEX = re.compile(r"(?<![\w_])([^\W\d_])_(\w+)")
#: Dots over a letter, as they stand after it in a text that is taken apart.
_DOTS = {"\u0307": "˙", "\u0308": "¨"}


def mathml(text: str) -> Markup:
    """Each line of a text as an equation of its own."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    drawn = (f'<math display="block">{_Line(line).row()}</math>' for line in lines)
    return Markup("\n".join(drawn))  # every sign is escaped where it is drawn


def subscripts(text: str) -> Markup:
    """A sentence with its letters' indices lowered: ``k_s``, not names such as ``tm21_sweep``."""
    lowered = _INDEX.sub(r"\1<sub>\2</sub>", str(escape(text)))
    return Markup(lowered)  # of a text that is escaped, or is markup already


class _Line:
    """A line that is read from the left."""

    def __init__(self, line: str) -> None:
        self._tokens: list[str] = _TOKEN.findall(unicodedata.normalize("NFD", line))
        self._next = 0

    def row(self, end: str = "") -> str:
        """What stands up to a closing bracket, which is passed, or to the end of the line."""
        parts = []
        while self._sees() and self._sees() != end:
            parts.append(self._part())
        self._next += 1
        return f"<mrow>{''.join(parts)}</mrow>"

    def _sees(self) -> str:
        """The next sign; nothing at the end."""
        return self._tokens[self._next] if self._next < len(self._tokens) else ""

    def _take(self) -> str:
        self._next += 1
        return self._tokens[self._next - 1]

    def _part(self) -> str:
        """A sign or bracket with what is below and above it, or a fraction that begins with it."""
        start = self._next
        part = self._scripts(self._one(bare=False))
        if self._sees() != "/":
            return part
        self._next = start
        over = self._scripts(self._one(bare=True))
        self._take()
        return f"<mfrac>{over}{self._scripts(self._one(bare=True))}</mfrac>"

    def _scripts(self, base: str) -> str:
        found = {}
        while self._sees() in ("_", "^"):
            mark = self._take()
            found[mark] = self._one(bare=True)
        tag = {"_": "msub", "^": "msup", "_^": "msubsup"}.get("".join(sorted(found, reverse=True)))
        inside = "".join(found[mark] for mark in "_^" if mark in found)
        return f"<{tag}>{base}{inside}</{tag}>" if tag else base

    def _one(self, bare: bool) -> str:
        """A bracket, drawn unless ``bare``; a root; or a sign."""
        token = self._take()
        if token == "(":
            inside = self.row(")")
            return inside if bare else f"<mrow><mo>(</mo>{inside}<mo>)</mo></mrow>"
        if token == "√":
            return f"<msqrt>{self._one(bare=True)}</msqrt>"
        gap = not bare and self._sees() not in ("", "(", ")", "_", "^", "/", ",")
        return _sign(token, gap)


def _sign(token: str, gap: bool) -> str:
    """A number, a letter with dots and primes, the name of a function, or an operator."""
    if token[0].isdigit():
        return f"<mn>{token}</mn>"
    if token == "Σ" or not token[0].isalpha():
        return f"<mo>{escape(token)}</mo>"
    name = token.rstrip("′″‴")
    letters = "".join(sign for sign in name if sign not in _DOTS)
    drawn = f"<mi>{escape(letters)}</mi>"
    for dots in (_DOTS[sign] for sign in name if sign in _DOTS):
        drawn = f"<mover>{drawn}<mo>{dots}</mo></mover>"  # an accent would be set into the letter
    if primes := token[len(name) :]:
        drawn = f"<msup>{drawn}<mo>{primes}</mo></msup>"
    return drawn + '<mspace width="0.17em"/>' if len(letters) > 1 and gap else drawn
