"""The equations of the documents on the site: their TeX as MathML, which browsers draw themselves.

GitHub draws ``$...$``; a site without another machine has no library for it. The few words of TeX
that the pages use become the line of text of which the report makes its equations.
"""

from __future__ import annotations

import re

from cam_rig.report.equations import mathml

#: What is no equation, whatever is in it.
CODE = re.compile(r"(^```.*?^```|^ {4,}\S[^\n]*$|`[^`\n]+`)", re.M | re.S)
EQUATION = re.compile(r"\$\$(.+?)\$\$|(?<![\\\w$])\$([^$\n]+?)\$(?!\w)", re.S)
#: Where a display goes on in another line, and what only spaces.
APART, SPACES = re.compile(r"\\q?quad"), re.compile(r"\\[,;! ]|\\(?:bigl|bigr|left|right)\b")
_TOKEN = re.compile(r"\\[A-Za-z]+|\d+(?:\.\d+)?|'+|[^\\\s]")
ACCENTS = {"dot": "\u0307", "ddot": "\u0308", "dddot": "\u20db", "hat": "\u0302", "bar": "\u0304"}
SIGNS = {
    "alpha": "α", "beta": "β", "delta": "δ", "Delta": "Δ", "Gamma": "Γ", "kappa": "κ",
    "lambda": "λ", "mu": "μ", "nu": "ν", "omega": "ω", "Omega": "Ω", "partial": "∂", "phi": "φ",
    "pi": "π", "rho": "ρ", "sigma": "σ", "theta": "θ", "varphi": "φ", "approx": "≈", "cdot": "·",
    "ge": "≥", "int": "∫", "jmath": "ȷ", "le": "≤", "sum": "Σ",
}  # fmt: skip
#: Names that stand upright, as they are.
NAMES = {"arctan", "lg", "min", "tan", "tanh"}
PLAIN = {"-": "−", "'": "′", "''": "″", "'''": "‴"}


def drawn(page: str) -> str:
    """A page of Markdown with MathML in place of its equations."""
    parts = CODE.split(page)
    parts[::2] = [EQUATION.sub(lambda found: _math(*found.groups()), part) for part in parts[::2]]
    return "".join(parts)


def _math(display: str | None, inline: str | None) -> str:
    if inline is not None:
        return str(mathml(line(inline))).replace('<math display="block">', "<math>")
    lines = mathml("\n".join(line(part) for part in APART.split(display or "")))
    return f'<div class="equation">{str(lines).replace(chr(10), "")}</div>'


def line(tex: str) -> str:
    """An equation as the report's line of text; a word of TeX that is not known is a KeyError."""
    tokens = _TOKEN.findall(SPACES.sub(" ", tex))[::-1]
    parts = []
    while tokens:
        parts.append(_part(tokens))
    return re.sub(r" (?=[′″‴])", "", " ".join(parts))


def _part(tokens: list[str]) -> str:
    """The next sign or group; ``tokens`` are reversed, and what is read is taken from them."""
    token = tokens.pop()
    if token == "{":
        return f"({_group(tokens)})"
    if token == r"\frac":
        over = _part(tokens)
        return f"{over}/{_part(tokens)}"
    if token == r"\sqrt":
        return f"√{_part(tokens)}"
    if token in (r"\text", r"\mathrm"):
        return _part(tokens)[1:-1]
    if token.startswith("\\"):
        word = token[1:]
        accent = ACCENTS.get(word)
        return _part(tokens) + accent if accent else word if word in NAMES else SIGNS[word]
    return PLAIN.get(token, token)


def _group(tokens: list[str]) -> str:
    """What stands up to a closing brace; letters alone are a word, as ``stem`` below a k."""
    inside = []
    while tokens[-1] != "}":
        inside.append(_part(tokens))
    tokens.pop()
    return ("" if all(one.isalpha() for one in inside) else " ").join(inside)
