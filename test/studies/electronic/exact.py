"""Exact evaluation of laws and of written cams, without the code under test.

Numbers are fractions or integers with `BITS` binary places, more than 70 digits. A written cam is
made from its text by the parser of this file.
"""

import re
from fractions import Fraction
from itertools import pairwise
from math import comb

import mpmath
import numpy as np

BITS = 256
ONE = 1 << BITS
with mpmath.workdps(90):
    PI = Fraction(str(mpmath.pi + 0))
DEG = PI / 180


def fixed(value):
    """Return a fraction as an integer with `BITS` binary places."""
    return (value.numerator << BITS) // value.denominator


def quintic(left, right):
    """Return the powers of z of the quintic with y, v, a at both ends x, as handbooks print it."""
    (x0, y0, v0, a0), (x1, y1, v1, a1) = left[:4], right[:4]
    d, rise = x1 - x0, y1 - y0
    v0, v1, a0, a1 = d * v0, d * v1, d * d * a0 / 2, d * d * a1 / 2
    return [
        y0,
        v0,
        a0,
        10 * rise - 6 * v0 - 4 * v1 - 3 * a0 + a1,
        -15 * rise + 8 * v0 + 7 * v1 + 3 * a0 - 2 * a1,
        6 * rise - 3 * v0 - 3 * v1 - a0 + a1,
    ]


class Pieces:
    """Polynomials in z from 0 to 1 over intervals of the cam angle in rad, in m."""

    def __init__(self, starts, stops, powers):
        self.starts, self.stops, self.powers = starts, stops, powers

    @classmethod
    def of_law(cls, law):
        """Return the pieces of a law, of the exact values of its floats."""
        powers = []
        for column in law.ordinates.T:
            b = [Fraction(float(x)) for x in column]
            n = len(b) - 1
            powers.append(
                [
                    comb(n, k) * sum((-1) ** (k - i) * comb(k, i) * b[i] for i in range(k + 1))
                    for k in range(n + 1)
                ]
            )
        breaks = [Fraction(float(x)) for x in law.breaks]
        breaks[-1] = 2 * PI
        return cls(breaks[:-1], breaks[1:], powers)

    @classmethod
    def of_points(cls, points):
        """Return the quintics between points (x in deg, y in mm, v, a)."""
        pairs = list(pairwise(points))
        return cls(
            [p[0] * DEG for p, _ in pairs],
            [q[0] * DEG for _, q in pairs],
            [[c / 1000 for c in quintic(p, q)] for p, q in pairs],
        )

    def derivative(self, piece, order):
        """Return the powers of z of a derivative by the cam angle of a piece."""
        powers = self.powers[piece]
        span = self.stops[piece] - self.starts[piece]
        for _ in range(order):
            powers = [k * c / span for k, c in enumerate(powers)][1:] or [Fraction(0)]
        return powers

    def __call__(self, degrees, order):
        """Return a derivative at angles (fractions of deg) as integers with `BITS` places."""
        edges = np.array([float(x) for x in self.starts[1:]])
        angles = np.array([x * DEG for x in degrees], dtype=object)
        index = np.searchsorted(edges, angles.astype(float), side="right")
        out = np.zeros(len(degrees), dtype=object)
        for piece in set(index.tolist()):
            at = np.flatnonzero(index == piece)
            span = self.stops[piece] - self.starts[piece]
            z = np.array([fixed((angles[i] - self.starts[piece]) / span) for i in at], dtype=object)
            total = np.zeros(at.size, dtype=object)
            for power in reversed(self.derivative(piece, order)):
                total = ((total * z) >> BITS) + fixed(power)
            out[at] = total
        return out

    def jerk_jumps(self):
        """Return the jump of s''' by joint (deg, rounded)."""
        ends = [self.derivative(i, 3) for i in range(len(self.powers))]
        return {
            round(float(self.starts[i] / DEG), 6): ends[i][0] - sum(ends[i - 1])
            for i in range(len(ends))
        }


def largest_errors(law, written, degrees):
    """Return the largest |e|, |e'|, |e''| at angles, and the largest error of a jump of s'''."""
    exact = Pieces.of_law(law)
    errors = [
        float(Fraction(max(abs(written(degrees, order) - exact(degrees, order))), ONE))
        for order in range(3)
    ]
    jumps, made = exact.jerk_jumps(), written.jerk_jumps()
    joints = {*jumps, *made}
    largest = max(abs(made.get(x, 0) - jumps.get(x, 0)) for x in joints)
    return [*errors, float(largest)]


# -- parser of the subset of Structured Text in which cams are written


TOKEN = re.compile(
    r"\s*(?:(?P<comment>\(\*.*?\*\))|(?P<real>[-+]?\d+\.\d+(?:E[-+]?\d+)?)|(?P<integer>\d+)"
    r"|(?P<word>[A-Za-z](?:_?[A-Za-z0-9])*)|(?P<mark>:=|\.\.|[\[\]():;,.]))",
    re.S,
)


class Grammar:
    """Recursive descent over declarations with initial values, and calls."""

    def __init__(self, text):
        assert text.isascii() or all(
            line.startswith("(*") for line in text.splitlines() if not line.isascii()
        )
        self.tokens, position = [], 0
        text = text.rstrip()
        while position < len(text):
            match = TOKEN.match(text, position)
            assert match, text[position : position + 40]
            if match.lastgroup != "comment":
                self.tokens.append((match.lastgroup, match[match.lastgroup]))
            position = match.end()
        self.index = 0

    def take(self, *expected):
        """Return the next token, which must be one of the expected texts or kinds."""
        kind, text = self.tokens[self.index]
        assert not expected or text in expected or kind in expected, (text, expected)
        self.index += 1
        return text

    def sees(self, text):
        """Return True if the next token is this text."""
        return self.index < len(self.tokens) and self.tokens[self.index][1] == text

    def declarations(self):
        """Return the declared variables by name: type and value."""
        self.take("VAR_GLOBAL", "VAR")
        found = {}
        while not self.sees("END_VAR"):
            name = self.take("word")
            self.take(":")
            kind = self.type()
            value = None
            if self.sees(":="):
                self.take(":=")
                value = self.value()
            self.take(";")
            found[name] = kind, value
        self.take("END_VAR")
        return found

    def type(self):
        """Return the name of a type, or of the elements of an array."""
        if self.sees("ARRAY"):
            for expected in ("ARRAY", "[", "integer", "..", "integer", "]", "OF"):
                self.take(expected)
        return self.path()

    def path(self):
        """Return a name with dots."""
        name = self.take("word")
        while self.sees("."):
            self.take(".")
            name += "." + self.take("word")
        return name

    def value(self):
        """Return a number, a list, a structure, or a name with arguments."""
        if self.sees("["):
            return self.items("[", "]", self.value)
        if self.sees("("):
            return dict(self.items("(", ")", self.field))
        if self.tokens[self.index][0] in ("real", "integer"):
            return Fraction(self.take())
        name = self.path()
        return (name, self.items("(", ")", self.value)) if self.sees("(") else name

    def field(self):
        """Return a field of a structure: name and value."""
        name = self.take("word")
        self.take(":=")
        return name, self.value()

    def items(self, first, last, item):
        """Return a list of items between two marks."""
        self.take(first)
        found = []
        while not self.sees(last):
            found.append(item())
            if not self.sees(last):
                self.take(",")
        self.take(last)
        return found

    def program(self):
        """Return the calls of a program."""
        self.take("PROGRAM")
        self.take("word")
        self.declarations()
        calls = []
        while not self.sees("END_PROGRAM"):
            calls.append(self.value())
            self.take(";")
        self.take("END_PROGRAM")
        assert self.index == len(self.tokens)
        return calls


def points_of(text, target):
    """Return the points (x, y, v, a, …) of a text with an array, as fractions."""
    grammar = Grammar(text)
    variables = grammar.declarations()
    assert grammar.index == len(grammar.tokens)
    rows = next(value for name, (_, value) in variables.items() if name.endswith("_points"))
    names = {
        "codesys": ("dX", "dY", "dV", "dA"),
        "twincat": ("MasterPos", "SlavePos", "SlaveVelo", "SlaveAcc", "SlaveJerk"),
    }
    mc3 = ("MasterPosition", "SlavePosition", "SlaveVelocity", "SlaveAcceleration", "SlaveJerk")
    return [[row[name] for name in names.get(target, mc3)] for row in rows], rows, variables


def segments_of(text):
    """Return constructor, left and right boundary of each segment of a CamBuilder program."""
    appended = [args[0] for name, args in Grammar(text).program() if name == "camBuilder.Append"]
    return [(name, left[1], right[1]) for name, (left, right) in appended]
