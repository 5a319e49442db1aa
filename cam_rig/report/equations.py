"""Conversion of equations from lines of text, as in Markdown pages, to MathML.

Factors are separated by spaces: ``m ẍ + (k + k_s) x = k_s s``. ``_`` and ``^`` make the next term a
subscript or superscript. ``/`` makes a fraction of its neighbours, and ``√`` a root of the next
term. Brackets around such a term are not drawn.
"""

from __future__ import annotations

import re
import unicodedata

from markupsafe import Markup, escape

#: Token of an equation: a number, letters with dots and primes, or any other character.
_TOKEN = re.compile(r"\d+(?:\.\d+)?|(?:[^\W\d_][\u0300-\u036f]*)+[′″‴]?|\S")
#: Pattern of a letter with an index in a sentence, such as k_s.
_INDEX = re.compile(r"(?<![\w_])([^\W\d_])_(\w+)")
#: Combining dots of a decomposed (NFD) text -> the dots in MathML.
_DOTS = {"\u0307": "˙", "\u0308": "¨"}


def mathml(text: str) -> Markup:
    """Convert each line of a text to an equation in MathML.

    Examples
    --------
    >>> print(mathml("a = 2"))
    <math display="block"><mrow><mi>a</mi><mo>=</mo><mn>2</mn></mrow></math>
    """
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    equations = (f'<math display="block">{_LineParser(line).row()}</math>' for line in lines)
    return Markup("\n".join(equations))  # `_symbol` escapes all characters


def subscripts(text: str) -> Markup:
    """Convert indices of letters, as in ``k_s``, to subscripts. Names as tm21_sweep are kept."""
    lowered = _INDEX.sub(r"\1<sub>\2</sub>", str(escape(text)))
    return Markup(lowered)  # the text has been escaped, unless it is markup


class _LineParser:
    """Recursive-descent parser of one line. `_position` is the position of the next token."""

    def __init__(self, line: str) -> None:
        self._tokens: list[str] = _TOKEN.findall(unicodedata.normalize("NFD", line))
        self._position = 0

    def row(self, end: str = "") -> str:
        """Convert the terms up to the token `end`, which is consumed, or to the end of the line."""
        terms = []
        while self._peek() and self._peek() != end:
            terms.append(self._term())
        self._position += 1
        return f"<mrow>{''.join(terms)}</mrow>"

    def _peek(self) -> str:
        """Return the next token, or an empty text at the end of the line."""
        return self._tokens[self._position] if self._position < len(self._tokens) else ""

    def _take(self) -> str:
        """Consume the next token and return it."""
        self._position += 1
        return self._tokens[self._position - 1]

    def _term(self) -> str:
        """Convert an atom with its subscript and superscript, or a fraction that starts with it."""
        start = self._position
        term = self._scripts(self._atom(bare=False))
        if self._peek() != "/":
            return term
        self._position = start
        numerator = self._scripts(self._atom(bare=True))
        self._take()
        return f"<mfrac>{numerator}{self._scripts(self._atom(bare=True))}</mfrac>"

    def _scripts(self, base: str) -> str:
        """Convert the subscript and superscript that follow, and add them to `base`."""
        scripts = {}
        while self._peek() in ("_", "^"):
            mark = self._take()
            scripts[mark] = self._atom(bare=True)
        marks = "".join(sorted(scripts, reverse=True))
        tag = {"_": "msub", "^": "msup", "_^": "msubsup"}.get(marks)
        inside = "".join(scripts[mark] for mark in "_^" if mark in scripts)
        return f"<{tag}>{base}{inside}</{tag}>" if tag else base

    def _atom(self, bare: bool) -> str:
        """Convert a bracket (not drawn if `bare`), a root or a symbol."""
        token = self._take()
        if token == "(":
            inside = self.row(")")
            return inside if bare else f"<mrow><mo>(</mo>{inside}<mo>)</mo></mrow>"
        if token == "√":
            return f"<msqrt>{self._atom(bare=True)}</msqrt>"
        gap = not bare and self._peek() not in ("", "(", ")", "_", "^", "/", ",")
        return _symbol(token, gap)


def _symbol(token: str, gap: bool) -> str:
    """Convert a token: number, operator, or letters with dots and primes.

    If `gap` is True, a thin space follows a name of several letters, such as that of a function.
    """
    if token[0].isdigit():
        return f"<mn>{token}</mn>"
    if token == "Σ" or not token[0].isalpha():
        return f"<mo>{escape(token)}</mo>"
    name = token.rstrip("′″‴")
    letters = "".join(character for character in name if character not in _DOTS)
    symbol = f"<mi>{escape(letters)}</mi>"
    for dots in (_DOTS[character] for character in name if character in _DOTS):
        symbol = f"<mover>{symbol}<mo>{dots}</mo></mover>"  # an accent would overlap the letter
    if primes := token[len(name) :]:
        symbol = f"<msup>{symbol}<mo>{primes}</mo></msup>"
    return symbol + '<mspace width="0.17em"/>' if len(letters) > 1 and gap else symbol
