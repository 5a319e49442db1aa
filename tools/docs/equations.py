"""Equations of the documents on the web site: conversion of TeX to MathML.

GitHub displays ``$...$``. The site has no external scripts, and browsers display MathML. The few
TeX commands of the pages are converted to the line of text that the report uses for equations.
"""

from __future__ import annotations

import re

from cam_rig.report.equations import mathml

#: Code, which contains no equation.
CODE = re.compile(r"(^```.*?^```|^ {4,}\S[^\n]*$|`[^`\n]+`)", re.M | re.S)
EQUATION = re.compile(r"\$\$(.+?)\$\$|(?<![\\\w$])\$([^$\n]+?)\$(?!\w)", re.S)
#: Separator of the lines of a displayed equation.
LINE_BREAK = re.compile(r"\\q?quad")
#: Commands that only add space.
SPACES = re.compile(r"\\[,;! ]|\\(?:bigl|bigr|left|right)\b")
_TOKEN = re.compile(r"\\[A-Za-z]+|\d+(?:\.\d+)?|'+|[^\\\s]")
ACCENTS = {"dot": "\u0307", "ddot": "\u0308", "dddot": "\u20db", "hat": "\u0302", "bar": "\u0304"}
SIGNS = {
    "alpha": "α", "beta": "β", "delta": "δ", "Delta": "Δ", "Gamma": "Γ", "kappa": "κ",
    "lambda": "λ", "mu": "μ", "nu": "ν", "omega": "ω", "Omega": "Ω", "partial": "∂", "phi": "φ",
    "pi": "π", "rho": "ρ", "sigma": "σ", "theta": "θ", "varphi": "φ", "approx": "≈", "cdot": "·",
    "ge": "≥", "int": "∫", "jmath": "ȷ", "le": "≤", "sum": "Σ",
}  # fmt: skip
#: Functions, which are set upright.
NAMES = {"arctan", "lg", "min", "tan", "tanh"}
PLAIN = {"-": "−", "'": "′", "''": "″", "'''": "‴"}


def convert_equations(page: str) -> str:
    """Return a page of Markdown with MathML in place of its equations."""
    parts = CODE.split(page)
    parts[::2] = [EQUATION.sub(lambda match: _math(*match.groups()), part) for part in parts[::2]]
    return "".join(parts)


def _math(display: str | None, inline: str | None) -> str:
    if inline is not None:
        # Markdown ends a paragraph at a line that starts with <math>, but not with <span>.
        equation = str(mathml(line(inline))).replace('<math display="block">', "<math>")
        return f"<span>{equation}</span>"
    lines = mathml("\n".join(line(part) for part in LINE_BREAK.split(display or "")))
    return f'<div class="equation">{str(lines).replace(chr(10), "")}</div>'


def line(tex: str) -> str:
    """Return an equation as a line of text for `mathml` of the report.

    An unknown TeX command raises KeyError.
    """
    tokens = _TOKEN.findall(SPACES.sub(" ", tex))[::-1]
    parts = []
    while tokens:
        parts.append(_part(tokens))
    return re.sub(r" (?=[′″‴])", "", " ".join(parts))


def _part(tokens: list[str]) -> str:
    """Return the next sign or group, and remove it from the reversed ``tokens``."""
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
    """Return the text up to a closing brace.

    If it has only letters, they are a word, such as the index ``stem`` of a k.
    """
    inside = []
    while tokens[-1] != "}":
        inside.append(_part(tokens))
    tokens.pop()
    return ("" if all(part.isalpha() for part in inside) else " ").join(inside)
