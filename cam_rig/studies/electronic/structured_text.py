"""Cams of controllers as Structured Text (IEC 61131-3): writer and reader.

The fields are those of the vendors' public pages (docs/electronic.md). The reader accepts other
spaces, cases and comments than the writer, and fields in any order.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from cam_rig.errors import ConfigError
from cam_rig.files import shorten
from cam_rig.studies.electronic.building import DIGITS, Target
from cam_rig.studies.electronic.controller import (
    DEFAULT_NAME,
    MAX_NUMBER,
    Boundary,
    ControllerCam,
    ControllerSegment,
    SegmentKind,
)

#: Suffix of the name of the array of points, next to the name of the cam.
POINTS_SUFFIX = "_points"
#: Pattern of a number of the language: digits with underscores, and an optional type before them.
LITERAL = re.compile(r"(?:L?REAL#)?([-+]?\d[\d_]*(?:\.\d[\d_]*)?(?:[eE][-+]?\d+)?)", re.I)
#: Words that are no identifiers, in small letters: keywords, types, and names of the written texts.
RESERVED = (
    "abs action adr and array at bool by byte case constant date dint do dword else elsif exit for "
    "function if int lint lreal lword method mod not of or pointer program real repeat return sint "
    "string struct then time to type udint uint ulint until usint var while word xor camref "
    "cambuilder camsegments continue do end_array end_case end_for end_function "
    "end_function_block end_if end_interface end_method end_namespace end_program end_property "
    "end_repeat end_struct end_type end_union end_var end_while extends false from_end "
    "function_block global implements interface jmp limit ltime mux namespace overlap override "
    "persistent private program property protected public r_edge f_edge ref reference retain sel "
    "super this true tod union using var_global var_in_out var_input var_output var_temp wstring "
    "__delete __new any lword date_and_time time_of_day"
)
#: Further fields of a point that a text may contain.
OTHER_FIELDS = (
    "PointIndex", "FunctionType", "PointType", "RelIndexNextPoint", "SymmetryRatio", "Ignored",
)  # fmt: skip
#: Pattern of a comment in either form.
COMMENT = re.compile(r"\(\*.*?\*\)|//[^\n]*", re.S)
#: Pattern of a comment line above the declaration, which is kept.
NOTE = re.compile(r"\(\* (.*) \*\)")


@dataclass(frozen=True)
class PointForm:
    """Structure of a point in an array of a target.

    Parameters
    ----------
    structure : str
        Name of the structure.
    fields : tuple of str
        Names of the fields x, y, v, a and, if the structure has it, j.
    kinds : mapping of SegmentKind to str
        Value of the field ``FunctionType`` by kind of the segment that starts at the point. It is
        empty if all segments are quintic.
    """

    structure: str
    fields: tuple[str, ...]
    kinds: dict[SegmentKind, str]


#: Structure of a point, by target.
POINT_FORMS = {
    Target.CODESYS: PointForm("SMC_CAMXYVA", ("dX", "dY", "dV", "dA"), {}),
    Target.TWINCAT: PointForm(
        "MC_MotionFunctionPoint",
        ("MasterPos", "SlavePos", "SlaveVelo", "SlaveAcc", "SlaveJerk"),
        {
            SegmentKind.LINE: "MOTIONFUNCTYPE_POLYNOM1",
            SegmentKind.POLY5: "MOTIONFUNCTYPE_POLYNOM5_MM",
            SegmentKind.POLY7: "MOTIONFUNCTYPE_POLYNOM7_MM",
            SegmentKind.INCLINED_SINE: "MOTIONFUNCTYPE_BESTEHORN",
            SegmentKind.MODIFIED_SINE: "MOTIONFUNCTYPE_MODSINUSLINIE",
        },
    ),
    Target.TWINCAT_MC3: PointForm(
        "MotionFunctionPoint",
        ("MasterPosition", "SlavePosition", "SlaveVelocity", "SlaveAcceleration", "SlaveJerk"),
        {
            SegmentKind.LINE: "EMotionFunctionType.Linear",
            SegmentKind.POLY5: "EMotionFunctionType.Polynomial5",
            SegmentKind.POLY7: "EMotionFunctionType.Polynomial7",
            SegmentKind.INCLINED_SINE: "EMotionFunctionType.InclinedSinusoid",
            SegmentKind.MODIFIED_SINE: "EMotionFunctionType.ModifiedSinusoid",
        },
    ),
}
#: Kinds of segments by other texts of the field ``FunctionType`` of TwinCAT: the values of the
#: names, and the polynomials between two points at rest.
TWINCAT_KINDS = {
    "1": SegmentKind.LINE,
    "5": SegmentKind.POLY5,
    "7": SegmentKind.POLY7,
    "11": SegmentKind.MODIFIED_SINE,
    "12": SegmentKind.INCLINED_SINE,
    "15": SegmentKind.POLY5,
    "24": SegmentKind.POLY7,
    "motionfunctype_polynom5": SegmentKind.POLY5,
    "motionfunctype_polynom7": SegmentKind.POLY7,
}
#: Constructor of CamBuilder by kind of segment, and the number of arguments of its boundaries.
CONSTRUCTORS = {
    SegmentKind.LINE: ("Line", 2),
    SegmentKind.POLY5: ("Poly5", 4),
    SegmentKind.POLY7: ("Poly7", 5),
    SegmentKind.INCLINED_SINE: ("InclinedSine", 2),
    SegmentKind.MODIFIED_SINE: ("ModifiedSine_Lambda", 3),
}
#: Word by which a text is recognised, by target. A later word contains an earlier one.
MARKS = {
    Target.CODESYS: "SMC_CAMXYVA",
    Target.CODESYS_BUILDER: "SMCB.CamBuilder",
    Target.TWINCAT: "MC_MotionFunctionPoint",
    Target.TWINCAT_MC3: "MotionFunctionPoint",
}


def identifier(name: str) -> str:
    """Return a name as an identifier of the language: letters, digits and single _."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    words = re.sub(r"[^A-Za-z0-9]+", "_", plain).strip("_") or "cam"
    return f"cam_{words}" if words[0].isdigit() or words.lower() in RESERVED.split() else words


def literal(value: float) -> str:
    """Return a number as a real literal of the language, which has a decimal point."""
    mantissa, exponent, power = f"{value + 0.0:.{DIGITS}g}".partition("e")
    return mantissa + ("" if "." in mantissa else ".0") + exponent.upper() + power


def comment(text: str) -> str:
    """Return a text as a comment of one line."""
    plain = "".join(c if c.isprintable() else " " for c in text)
    return f"(* {plain.replace('*)', '* )').replace('(*', '( *').strip()} *)"


def write_text(cam: ControllerCam, target: Target) -> str:
    """Return the Structured Text of a cam."""
    lines = [comment(note) for note in cam.notes]
    name = identifier(cam.name)
    if target is Target.CODESYS_BUILDER:
        return "\n".join(lines + _builder_lines(name, cam)) + "\n"
    form, array = POINT_FORMS[target], name + POINTS_SUFFIX
    count, rows = len(cam.segments) + 1, _point_rows(cam, form, target)
    first = 0 if target is Target.CODESYS else 1
    lines += [
        "VAR_GLOBAL",
        f"    {array} : ARRAY[{first}..{first + count - 1}] OF {form.structure} := [",
        ",\n".join(f"        ({row})" for row in rows),
        "    ];",
    ]
    start, end = cam.segments[0].left.x, cam.segments[-1].right.x
    if target is Target.CODESYS:
        limits = f"xStart := {literal(start)}, xEnd := {literal(end)}"
        lines.append(
            f"    {name} : MC_CAM_REF := (byType := 3, nElements := {count}, {limits}, "
            f"pce := ADR({array}));"
        )
    elif target is Target.TWINCAT_MC3:
        reference = f"PointsAddress := ADR({array}), NumberOfPoints := {count}"
        lines.append(f"    {name} : MC_CAM_REF := ({reference});")
    return "\n".join([*lines, "END_VAR"]) + "\n"


def _point_rows(cam: ControllerCam, form: PointForm, target: Target) -> list[str]:
    """Return the fields of each point: those at which segments start, and the last."""
    points = [(segment.left, segment.kind) for segment in cam.segments]
    points.append((cam.segments[-1].right, cam.segments[-1].kind))
    rows = []
    for index, (point, kind) in enumerate(points, 1):
        fields = {} if not form.kinds else {"FunctionType": form.kinds[kind]}
        if target is Target.TWINCAT:
            fields = {"PointIndex": str(index)} | fields
            fields |= {"PointType": _point_type(point), "RelIndexNextPoint": "1"}
        fields |= {key: literal(x) for key, x in zip(form.fields, point, strict=False)}
        rows.append(", ".join(f"{key} := {value}" for key, value in fields.items()))
    return rows


def _point_type(point: Boundary) -> str:
    """Return the MC_MotionPointType of a point, by its velocity and acceleration."""
    types = {(0, 0): "REST", (1, 0): "VELOCITY", (0, 1): "TURN", (1, 1): "MOTION"}
    return f"MOTIONPOINTTYPE_{types[point.v != 0.0, point.a != 0.0]}"


def _builder_lines(name: str, cam: ControllerCam) -> list[str]:
    """Return the lines of a program that makes a cam by CamBuilder."""
    lines = [
        f"PROGRAM {name}",
        "VAR",
        "    camBuilder : SMCB.CamBuilder;",
        "    camRef : MC_CAM_REF;",
        f"    camSegments : ARRAY[1..{len(cam.segments)}] OF SMC_CAM_SEGMENT;",
        "END_VAR",
        "camBuilder.Init();",
    ]
    for segment in cam.segments:
        constructor, count = CONSTRUCTORS[segment.kind]
        bounds = ", ".join(
            f"SMCB.Bound({', '.join(literal(x) for x in end[:count])})"
            for end in (segment.left, segment.right)
        )
        lines.append(f"camBuilder.Append(SMCB.{constructor}({bounds}));")
    return [
        *lines,
        "SMCB.InitCamRef(camRef, ADR(camSegments), XSIZEOF(camSegments));",
        "camBuilder.Write(camRef);",
        "END_PROGRAM",
    ]


# Reader.


@dataclass(frozen=True)
class SourceText:
    """Text of a file without comments, for error messages with file and line."""

    file: str
    code: str

    def line(self, position: int) -> int:
        """Return the line number of a position."""
        return self.code.count("\n", 0, position) + 1

    def error(self, position: int, problem: str) -> ConfigError:
        """Return the error of a problem at a position."""
        return ConfigError(f"{self.file}: line {self.line(position)}: {problem}")

    def number(self, text: str, position: int, name: str) -> float:
        """Return the number in a text."""
        match = LITERAL.fullmatch(text.strip())
        value = math.inf if match is None else float(match[1].replace("_", ""))
        if not abs(value) <= MAX_NUMBER:
            raise self.error(
                position, f"{name} is {shorten(text.strip())}; allowed: a number such as 12.5"
            )
        return value


def blank_comments(text: str) -> str:
    """Return a text with its comments replaced by spaces, so that positions are kept."""
    return COMMENT.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)


def read_text(file: str, text: str, target: Target) -> ControllerCam:
    """Return the cam of a Structured Text.

    Parameters
    ----------
    file : str
        Name of the file for messages.
    text : str
        Content of the file.
    target : Target
        Form of the text.

    Raises
    ------
    ConfigError
        If the text has another form, or a number or a point is wrong.
    """
    source = SourceText(file, blank_comments(text))
    head = text[: re.search(r"^\s*(?!\(\*|//)\S|\Z", text, re.M).start()]  # type: ignore[union-attr]
    notes = tuple(NOTE.findall(head))
    found = next(
        (t for t, mark in MARKS.items() if re.search(rf"\b{re.escape(mark)}\b", source.code, re.I)),
        None,
    )
    if found is not target:
        kind = "has no cam" if found is None else f"is a text for {found.value}"
        raise ConfigError(f"{file}: line 1: {kind}; allowed: a text for {target.value}")
    if target is Target.CODESYS_BUILDER:
        return _read_builder(source, notes)
    return _read_points(source, POINT_FORMS[target], notes)


def _read_points(source: SourceText, form: PointForm, notes: tuple[str, ...]) -> ControllerCam:
    """Return the cam of an array of points."""
    pattern = rf"(\w+)\s*:\s*ARRAY\s*\[([^\]]*)\]\s*OF\s+{form.structure}\s*:=\s*\["
    declaration = re.search(pattern, source.code, re.I)
    if declaration is None:
        at = source.code.lower().index(form.structure.lower())
        raise source.error(at, f"no array of {form.structure} with initial values")
    rows = list(_structures(source, declaration.end()))
    points = [_point(source, row, position, form) for row, position in rows]
    _check_count(source, declaration, len(points))
    _check_reference(source, len(points), points)
    for i, (before, after) in enumerate(pairwise(points)):
        if not after[0].x > before[0].x:
            raise source.error(
                rows[i + 1][1],
                f"{form.fields[0]} is {after[0].x:g} after {before[0].x:g}; allowed: rising",
            )
    segments = (ControllerSegment(kind, p, q) for (p, kind), (q, _) in pairwise(points))
    return ControllerCam(declaration[1].removesuffix(POINTS_SUFFIX), tuple(segments), notes)


def _check_count(source: SourceText, declaration: re.Match[str], count: int) -> None:
    """Raise ConfigError if the array is not declared with the number of its points."""
    limits = re.fullmatch(r"\s*(\d+)\s*\.\.\s*(\d+)\s*", declaration[2])
    declared = None if limits is None else int(limits[2]) - int(limits[1]) + 1
    if declared != count or count < 2:
        raise source.error(
            declaration.start(),
            f"the array has {count} points, declared as [{declaration[2]}]; allowed: as many as "
            "declared, at least 2",
        )


def _check_reference(
    source: SourceText, count: int, points: list[tuple[Boundary, SegmentKind]]
) -> None:
    """Raise ConfigError if the reference to the array contradicts its points.

    Its fields are optional in a text.
    """
    expected = {
        "byType": 3.0,
        "nElements": float(count),
        "NumberOfPoints": float(count),
        "xStart": points[0][0].x,
        "xEnd": points[-1][0].x,
    }
    for name, value in expected.items():
        match = re.search(rf"\b{name}\s*:=\s*([^,()\s]+)", source.code, re.I)
        if match and source.number(match[1], match.start(), name) != value:
            raise source.error(match.start(), f"{name} is {match[1]}; allowed: {value:g}")


def _structures(source: SourceText, start: int) -> Iterator[tuple[str, int]]:
    """Yield the content and position of each (…) of an array, up to its closing bracket."""
    position = start
    while True:
        match = re.compile(r"[\s,]*(\(([^()\[\]]*)\)|\]|\S|\Z)").match(source.code, position)
        assert match is not None
        if match[2] is None:
            if match[1] != "]":
                problem = "a point in parentheses, or ] at the end, is missing"
                raise source.error(match.start(1), problem)
            return
        yield match[2], match.start(2)
        position = match.end()


def _point(
    source: SourceText, row: str, position: int, form: PointForm
) -> tuple[Boundary, SegmentKind]:
    """Return a point and the kind of the segment that starts at it."""
    fields: dict[str, str] = {}
    for item in row.split(","):
        name, assign, value = item.partition(":=")
        if not assign:
            raise source.error(
                position,
                f"{shorten(item.strip())} has no name; allowed: NAME := NUMBER, with a "
                "decimal point",
            )
        key = name.strip()
        known = {*form.fields, *OTHER_FIELDS}
        if key.lower() in fields or key.lower() not in {each.lower() for each in known}:
            problem = "is given twice" if key.lower() in fields else "is not a field of a point"
            raise source.error(
                position, f"{shorten(key)} {problem}; allowed: {', '.join(form.fields)}, each once"
            )
        fields[key.lower()] = value.strip()
    missing = [name for name in form.fields[:2] if name.lower() not in fields]
    if missing:
        raise source.error(position, f"{missing[0]} is missing")
    if (
        "IGNORE" in fields.get("pointtype", "").upper()
        or fields.get("ignored", "").upper() == "TRUE"
    ):
        raise source.error(position, "the point is ignored; allowed: an array without such points")
    values = [
        source.number(fields.get(name.lower(), "0.0"), position, name) for name in form.fields
    ]
    if (step := fields.get("relindexnextpoint", "1")) != "1":
        raise source.error(position, f"RelIndexNextPoint is {shorten(step)}; allowed: 1")
    if not form.kinds:
        return Boundary(*values), SegmentKind.POLY5
    name = fields.get("functiontype", "")
    kinds = {text.rpartition(".")[2].lower(): kind for kind, text in form.kinds.items()}
    if form is POINT_FORMS[Target.TWINCAT]:
        kinds |= TWINCAT_KINDS
    kind = kinds.get(name.rpartition(".")[2].lower())
    if kind is None:
        allowed = ", ".join(form.kinds.values())
        raise source.error(position, f"FunctionType is {shorten(name)}; allowed: {allowed}")
    return Boundary(*values), kind


def _read_builder(source: SourceText, notes: tuple[str, ...]) -> ControllerCam:
    """Return the cam of the calls of CamBuilder."""
    program = re.search(r"\b(?:PROGRAM|FUNCTION_BLOCK)\s+(\w+)", source.code, re.I)
    kinds = {name.lower(): kind for kind, (name, _) in CONSTRUCTORS.items()}
    segments: list[ControllerSegment] = []
    end = r"SMCB\s*\.\s*(Bound|BoundImplicit)\s*\(([^()]*)\)"
    pattern = rf"\(\s*SMCB\s*\.\s*(\w+)\s*\(\s*{end}\s*,\s*{end}\s*\)\s*\)"
    for call in re.finditer(r"\.\s*Append\s*", source.code, re.I):
        match = re.compile(pattern, re.I).match(source.code, call.end())
        if match is None or match[1].lower() not in kinds:
            allowed = ", ".join(name for name, _ in CONSTRUCTORS.values())
            raise source.error(
                call.start(),
                f"the segment is not of a known form; allowed: {allowed} with two boundaries",
            )
        before = segments[-1].right if segments else Boundary(0.0, 0.0)
        left, right = (
            before if implicit.lower() == "boundimplicit" else _bound(source, values, match.start())
            for implicit, values in (match.group(2, 3), match.group(4, 5))
        )
        if not (right.x > left.x and (not segments or left.x == before.x)):
            raise source.error(
                match.start(),
                f"the segment is from {left.x:g} to {right.x:g} after {before.x:g}; "
                "allowed: rising, without a gap",
            )
        segments.append(ControllerSegment(kinds[match[1].lower()], left, right))
    if not segments:
        raise source.error(0, "no segment is appended; allowed: calls of Append")
    return ControllerCam(program[1] if program else DEFAULT_NAME, tuple(segments), notes)


def _bound(source: SourceText, text: str, position: int) -> Boundary:
    """Return the boundary of the arguments of a call of Bound."""
    arguments = text.split(",")
    if not 2 <= len(arguments) <= len(Boundary._fields):
        raise source.error(position, f"Bound({shorten(text, False)}); allowed: x, y, v, a, j")
    names = Boundary._fields
    pairs = zip(names, arguments, strict=False)
    return Boundary(*(source.number(value, position, name) for name, value in pairs))
