"""Parser of the headings of measured tables: quantity, factor and unit.

A heading consists of words for a quantity, an optional factor and a unit, such as ``Lift (0.001
in)``, ``Nockenwinkel / °`` or ``cycle [%]``. Words that do not change the meaning may be next to
them. Everything else makes the heading unclear, because a word that is not understood could be
another unit.
"""

from __future__ import annotations

import math
import re
import unicodedata
from dataclasses import dataclass, replace

from cam_rig.schema.quantity import UNITS as RIG_UNITS
from cam_rig.units import TURN

_INCH = 0.0254
_POUND_FORCE = 4.4482216152605


def _names(dimension: str, names: dict[str | float, str]) -> dict[str, float]:
    """Return the factor to SI of each name of the units of a dimension.

    A key of `names` is a unit of the rig's files, or the factor of a unit that the files do not
    have. Its value contains further names of the unit, separated by spaces.
    """
    factors = dict[str, float]()
    for key, listed in names.items():
        factor = key if isinstance(key, float) else RIG_UNITS[dimension][key]
        first = [] if isinstance(key, float) else [key.casefold()]
        factors |= dict.fromkeys((*first, *listed.split()), factor)
    return factors


#: Name of a unit, in small letters without accents, to its factor to SI, for each dimension.
#: English, Spanish, German, French, Italian and Portuguese names.
UNITS: dict[str, dict[str, float]] = {
    "angle": _names(
        "angle",
        {
            "deg": "° degs degree degrees grad grade grado grados gradi grau graus degre degres",
            "rad": "rads radian radians radianes radianti radiant radianten radiante radianos",
            "turn": "turns rev revs revolution revolutions vuelta vueltas tour tours giro giri "
            "volta voltas umdrehung umdrehungen",
            TURN / 400.0: "gon gons",
            TURN / 100.0: "% percent prozent porcentaje porciento pourcent pourcents percento "
            "percentuale porcento",
        },
    ),
    "length": _names(
        "length",
        {
            "m": "meter meters metre metres metro metros metri metern",
            "cm": "centimeter centimeters centimetre centimetres centimetro centimetros "
            "centimetri zentimeter zentimetern",
            "mm": "millimeter millimeters millimetre millimetres milimetro milimetros "
            "millimetro millimetri millimetern",
            "um": "μm micron microns micra micras micrometer micrometers micrometre micrometres "
            "micrometro micrometros micrometri mikrometer mikrometern mikron microni",
            "in": "inch inches zoll pouce pouces pollice pollici pulgada pulgadas polegada "
            'polegadas "',
            1e-3 * _INCH: "thou thous mil mils",
        },
    ),
    "speed": _names(
        "speed",
        {
            "rpm": "1/min min^-1 min-1 u/min r/min rev/min tr/min giri/min g/min upm",
            "rad/s": "rad/sec",
            TURN: "hz 1/s s^-1 s-1 rps rev/s u/s",
        },
    ),
    "mass": _names(
        "mass",
        {
            "kg": "kilogram kilograms kilogramm kilogramme kilogrammes kilogramo kilogramos "
            "chilogrammi chilogrammo",
            "g": "gram grams gramm gramme grammes gramo gramos grammi grammo",
            0.45359237: "lb lbs pound pounds",
        },
    ),
    "stiffness": _names(
        "stiffness",
        {"N/m": "", "N/mm": "kn/m", 1e2: "n/cm", _POUND_FORCE / _INCH: "lbf/in lb/in"},
    ),
    "force": _names(
        "force", {"N": "newton newtons", 1e3: "kn kilonewton kilonewtons", _POUND_FORCE: "lbf"}
    ),
    "level": _names("level", {"dB": "decibel decibels decibelios dezibel"}),
}
#: Words for a fraction -> the fraction, and the length (m) of the unit if the heading has no unit.
#: None means that the heading must have a unit. Machinists call a thousandth of an inch a
#: thousandth. In the other languages the unit is the mm.
FRACTIONS: dict[str, tuple[float, float | None]] = {
    **dict.fromkeys(("thousandth", "thousandths"), (1e-3, _INCH)),
    **dict.fromkeys(("hundredth", "hundredths"), (1e-2, None)),
    **dict.fromkeys(("tenth", "tenths"), (1e-1, None)),
    **dict.fromkeys(("hundertstel", "centiemes", "centieme", "centesimi"), (1e-2, 1e-3)),
    **dict.fromkeys(("centesimas", "centesima", "centesimo"), (1e-2, 1e-3)),
    **dict.fromkeys(("tausendstel", "millesimi", "milliemes", "millieme"), (1e-3, 1e-3)),
    **dict.fromkeys(("milesimas", "milesima", "millesimo"), (1e-3, None)),
    **dict.fromkeys(("zehntel", "dixiemes", "dixieme", "decimi", "decimas"), (1e-1, 1e-3)),
}
#: Units whose name is also a word or a symbol. They count as units only in brackets, after a number
#: or at the end of the heading.
AMBIGUOUS = frozenset(("in", "m", "g", "n", "mil", '"'))


@dataclass(frozen=True)
class QuantityWords:
    """Words by which a heading names a quantity.

    `stems` are parts of a word, `symbols` are whole words, and `neutral` are further words that do
    not change the meaning of such a heading.
    """

    dimension: str
    stems: str
    symbols: str = ""
    neutral: str = ""

    def matches(self, word: str) -> bool:
        """Return True if a word means this quantity."""
        return word in self.symbols.split() or any(stem in word for stem in self.stems.split())


#: Quantities of columns by name. If a heading has words of several, the first in this order counts.
QUANTITIES: dict[str, QuantityWords] = {
    "other": QuantityWords(
        "",
        "accel acel beschleun jerk error fehler erreur errore deviat desviac abweich ecart toleran "
        "scatter curvat krumm temper torque moment diamet durchmess comment kommentar remark",
        "time zeit tiempo temps tempo temp date note notes id",
    ),
    "preload": QuantityWords("force", "preload vorspann precarg prechar precaric", "", "spring"),
    "stiffness": QuantityWords(
        "stiffness", "spring stiff feder muelle resorte rigid ressort molla", "", "rate constant"
    ),
    "mass": QuantityWords(
        "mass",
        "mass masa gewicht weight peso poids",
        "",
        "added extra total of follower",
    ),
    "speed": QuantityWords(
        "speed", "speed drehzahl veloc geschwind vitesse jump", "omega ω giri rpm n", "at of"
    ),
    "level": QuantityWords(
        "level",
        "level pegel nivel niveau livello",
        "db spl",
        "sound pressure schall schalldruck sonoro sonore presion pression z lz lzeq unweighted",
    ),
    "radius": QuantityWords("length", "radius radii rayon raggio halbmess", "r radio"),
    "lift": QuantityWords(
        "length",
        "lift hub elevac levant alzad alzat levee levage erhebung displac desplaz deplac deslocam "
        "spost carrera corsa sollev altura elevat hauteur hohe hoehe altezza reading lectura "
        "ablesung lecture stosselweg stoesselweg messwert",
        "s h weg course curso rise travel stroke",
    ),
    "count": QuantityWords(
        "", "count inkrement increment impuls pulse encoder drehgeber", "", "per turn"
    ),
    "angle": QuantityWords(
        "angle",
        "angle angul angol winkel theta rotat rotac rotaz drehung phase fase cycle zyklus ciclo "
        "takt",
        "θ φ phi ang giro kw nw cad",
        "time encoder",
    ),
    "x": QuantityWords("length", "", "x"),
    "y": QuantityWords("length", "", "y"),
    "z": QuantityWords("length", "", "z"),
}
#: Dimension of the unit -> quantity of a heading that has a unit but no word of a quantity.
BY_UNIT = {"angle": "angle", "length": "lift", "speed": "speed", "level": "level"}
#: Words of an angle of the crankshaft, which turns twice as fast as the cam.
CRANK = QuantityWords(
    "angle", "crank kurbel vilebrequin manovell ciguenal virabrequim", "kw cad ca alberomotore"
)
_NEUTRAL = (
    "a b c d the of de del della des du la le el il dem den der die das von for fur am an at "
    "from to by y e et und i ii iii iv no nr in en em zu cam cams camshaft came camma camme leva "
    "leve nocken nocke nockenwelle arbre arbol albero valve valves valvula soupape valvola ventil "
    "follower taster tappet stossel lifter lobe intake inlet exhaust einlass auslass admision "
    "admission escape echappement aspirazione scarico shaft centerline centreline center centre "
    "line cl "
    "dial gauge gage indicator messuhr reloj comparador comparateur comparatore column spalte "
    "measured gemessen medido mesure mesuree misurato misurata nominal soll ist actual value "
    "values wert werte mean average first second third left right links rechts flat roller point "
    "cylinder zylinder nose nase nez naso peak position pos relative absolute raw "
    "smoothed base circle table test"
)
#: Words that do not change the meaning of a heading.
NEUTRAL = frozenset(_NEUTRAL.split())
#: Letters that are neutral in headings of lifts and angles, where they distinguish columns. In the
#: heading of a level they are not neutral, because they would be a frequency weighting.
LETTERS = frozenset("abcd")
#: Words for the divisions of a dial. The heading must also contain a unit or a factor, because the
#: words do not define the size of a division.
DIVISIONS = frozenset(("div", "divs", "division", "divisions", "teilstrich", "teilstriche"))
#: Largest number in a heading that counts as the index of a column, as in "lift 2".
MAX_INDEX = 99

_BRACKETS = re.compile(r"[(\[{]([^)\]}]*)[)\]}]")
_NUMBER = r"(?:\d+(?:[.,]\d+)?|[.,]\d+)(?:e[-+]?\d+)?"
_TOKEN = re.compile(
    r"10\s*(?:\^|\*\*)\s*-?\s*\d+|1\s*/\s*\d+(?:[.,]\d+)?|min\s*\^?-1|s\^?-1|1/(?:min|s)\b"
    rf"|{_NUMBER}|°[cfk]\b|[^\W\d_]+|''|[°%\"×*·/^]"
)
#: Largest number of tokens of the name of a unit, such as ``rad / s``.
_MAX_UNIT_TOKENS = 3
#: Tokens after which a number is the factor of a unit and not a column index, as in ``mm x 10``.
_FACTOR_MARKS = (["x"], ["×"], ["*"], ["^"], ["/"])
#: Units of time, which make a length or an angle a speed, as in ``mm/s``.
_TIMES = frozenset(
    ("s", "ms", "sec", "secs", "second", "seconds", "sek", "sekunde", "sekunden", "h")
) | {"min", "minute", "minutes"}
_JOINING = ("of", "an", "a", "de", "di", "von", "d", "x", "×", "*", "·", "=")


@dataclass(frozen=True)
class Heading:
    """Meaning of the heading of a column.

    Parameters
    ----------
    text
        The heading in one line, as messages quote it.
    quantity
        A key of `QUANTITIES`, "other" if no quantity is recognised.
    factor
        Factor of the numbers to SI, None without a unit.
    is_crank
        True if an angle is that of the crankshaft. `factor` does not contain the ratio 1/2.
    unclear
        Reason why the heading is not understood, or empty. It is empty for a heading "other" of
        neutral words, or "column 2".
    """

    text: str
    quantity: str
    factor: float | None
    is_crank: bool = False
    unclear: str = ""


@dataclass(frozen=True)
class _Unit:
    name: str
    dimension: str
    factor: float


def parse_heading(text: str) -> Heading:
    """Return the meaning of a heading.

    A heading that is not understood is returned with the reason in `unclear`, because a table may
    have columns that are not used.

    Examples
    --------
    >>> heading = parse_heading("Lift (0.001 in)")
    >>> heading.quantity, heading.factor
    ('lift', 2.54e-05)
    """
    plain = _plain_text(text)
    units, words_in_brackets = list[_Unit](), list[str]()
    try:
        if re.search(r"[(\[{]\s*-\s*[a-z]", plain):
            raise ValueError("a unit has no sign")
        for inner in _BRACKETS.findall(plain):
            new_units, words = _take_units(_tokens(inner), alone=True)
            units += new_units
            words_in_brackets += words
        new_units, words = _take_units(_tokens(_BRACKETS.sub(" ", plain)), alone=not units)
    except ValueError as error:
        words = [word for word in _tokens(plain) if word not in _TIMES]
        return Heading(text, _quantity(words, units) or "other", None, unclear=str(error))
    units += new_units
    words += words_in_brackets
    quantity = _quantity(words, units)
    if quantity in ("", "other"):
        return Heading(text, "other", None, unclear=_explain_other(plain))
    dimension = QUANTITIES[quantity].dimension
    factors = {unit.factor for unit in units if unit.dimension == dimension}
    unclear = _explain_words(quantity, words, bool(units))
    if not unclear and len(factors) > 1:
        unclear = f"it has several units: {', '.join(unit.name for unit in units)}"
    elif not unclear and units and not factors:
        unclear = f"{units[0].name!r} is not a unit of {dimension} ({_unit_names(dimension)})"
    factor = factors.pop() if len(factors) == 1 else None
    is_crank = quantity == "angle" and any(map(CRANK.matches, words))
    return Heading(text, quantity, factor, is_crank, unclear)


def _explain_other(plain: str) -> str:
    """Return the reason why a heading without a quantity is unclear.

    The text is empty if all words of the heading are neutral.
    """
    if re.fullmatch(r"column \d+", plain):  # of a table without headings
        return ""
    words = [word for word in _tokens(plain) if word not in NEUTRAL]
    words.sort(key=lambda word: not QUANTITIES["other"].matches(word))
    return f"{words[0]!r} is neither a word of a known quantity nor neutral" if words else ""


def _plain_text(text: str) -> str:
    """Return a text in small letters without accents."""
    spaced = re.sub(r"([^\W\d_A-Z]{3,})([A-Z])", r"\1 \2", text.replace("″", '"'))  # CamAngle
    powers = re.sub(r"(?<=[\da-z])([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", r"^\1", spaced).replace("−", "-")
    parts = unicodedata.normalize("NFKD", powers.replace("⁻", "-").casefold())
    return "".join(part for part in parts if not unicodedata.combining(part))


def _tokens(text: str) -> list[str]:
    words = re.sub(r"\.{2,}", " ", text.replace("_", " "))  # 0..1
    tokens = _TOKEN.findall(re.sub(r"\balbero\s+motore\b", "alberomotore", words))
    return ["".join(token.split()).replace("**", "^") for token in tokens]


def _take_units(tokens: list[str], alone: bool) -> tuple[list[_Unit], list[str]]:
    """Return the units among tokens with their factors, and the other tokens.

    If `alone` is True, an ambiguous name at the end counts as a unit.
    """
    units, words, i, end = list[_Unit](), list[str](), 0, 0
    while i < len(tokens):
        unit, size = _unit_at(tokens, i)
        factor, before = _factor_before(words)
        divisor, divisor_size = _divisor_after(tokens, i + size) if unit else (1.0, 0)
        last = alone and i + size + divisor_size == len(tokens)
        if unit is None and tokens[i] in FRACTIONS:
            unit = _fraction_alone(tokens, i)
            size = 1
        elif unit is not None and unit.name in AMBIGUOUS and factor is None and not last:
            unit = None
        if unit is None:
            words.append(tokens[i])
            i += 1
            continue
        if factor is not None:
            if factor > 1.0:
                raise ValueError(f"a factor of {factor:g} before {unit.name!r} has two meanings")
            words = before
        is_rate = units and i == end and unit.dimension == "speed"  # mm s^-1
        if is_rate or (units and i == end + 1 and tokens[end] == "/"):
            raise ValueError(f"'{units[-1].name}/{unit.name}' is not a known unit")
        units.append(replace(unit, factor=unit.factor * (factor or 1.0) / divisor))
        i += size + divisor_size
        end = i
    return units, words


def _unit_at(tokens: list[str], i: int) -> tuple[_Unit | None, int]:
    """Return the longest unit that starts at token `i`, and its number of tokens."""
    for size in range(_MAX_UNIT_TOKENS, 0, -1):
        name = "".join(tokens[i : i + size])
        for dimension, names in UNITS.items():
            if name in names and i + size <= len(tokens):
                return _Unit(name, dimension, names[name]), size
    return None, 1


def _divisor_after(tokens: list[str], i: int) -> tuple[float, int]:
    """Return the divisor after a unit, and its number of tokens.

    In mm/100 the divisor is 100. Token `i` is the first after the unit. Without a divisor the
    result is 1 and 0.

    Raise ValueError for a divisor of 0, and for a quantity per time or unit, as in mm/10 deg.
    """
    if tokens[i : i + 1] != ["/"] or not tokens[i + 1 :]:
        return 1.0, 0
    value, (after, _) = _number(tokens[i + 1]), _unit_at(tokens, i + 2)
    if value is None and tokens[i + 1] not in _TIMES:
        return 1.0, 0
    if not value or not math.isfinite(value) or (after is not None and after.name not in AMBIGUOUS):
        raise ValueError(f"{''.join(tokens[i - 1 : i + 3])!r} is not a known unit")
    return value, 2


def _fraction_alone(tokens: list[str], i: int) -> _Unit | None:
    """Return the unit of a fraction, or None if another unit follows it."""
    after = [token for token in tokens[i + 1 :] if token not in _JOINING]
    if after and _unit_at(after, 0)[0] is not None:
        return None
    fraction, metres = FRACTIONS[tokens[i]]
    if metres is None:
        raise ValueError(f"{tokens[i]!r} has no unit, such as mm or inch")
    return _Unit(tokens[i], "length", fraction * metres)


def _factor_before(tokens: list[str]) -> tuple[float | None, list[str]]:
    """Return the factor directly before a unit, and the tokens before the factor."""
    before = list(tokens)
    while before and before[-1] in _JOINING:
        before.pop()
    value = _number(before[-1]) if before else None
    if value is None:
        return None, tokens
    before.pop()
    if before and before[-1] in ("x", "×", "*", "·"):
        before.pop()
    return value, before


def _number(token: str) -> float | None:
    if token in FRACTIONS:
        return FRACTIONS[token][0]
    if token.startswith("10^"):
        return float(f"1e{token[3:]}")
    if re.fullmatch(rf"1/{_NUMBER}", token):
        divisor = float(token[2:].replace(",", "."))
        return 1.0 / divisor if divisor else None
    return float(token.replace(",", ".")) if re.fullmatch(_NUMBER, token) else None


def _quantity(words: list[str], units: list[_Unit]) -> str:
    """Return the name of the quantity that words and units mean, or an empty text."""
    dimensions = [unit.dimension for unit in units]
    for name, quantity in QUANTITIES.items():
        is_point = name in ("x", "y", "z")
        if is_point and dimensions and "length" not in dimensions:
            continue  # the z of dB(Z)
        if any(quantity.matches(word) for word in words):
            is_other = name == "count" and "angle" in dimensions
            return "angle" if is_other else name
    if any(map(CRANK.matches, words)):
        return "angle"
    return next((BY_UNIT[dimension] for dimension in dimensions if dimension in BY_UNIT), "")


def _unit_names(dimension: str) -> str:
    """Return a name of each unit of a dimension, that of the rig's files if possible."""
    by_factor = {factor: name for name, factor in RIG_UNITS[dimension].items()}
    for name, factor in UNITS[dimension].items():
        by_factor.setdefault(factor, name)
    return ", ".join(by_factor.values())


def _explain_words(quantity: str, words: list[str], has_unit: bool) -> str:
    """Return the reason why a word or number of a heading is not understood.

    The text is empty if all are understood.
    """
    meaning = QUANTITIES[quantity]
    for i, word in enumerate(words):
        value = _number(word)
        is_index = value is not None and value == int(value) and 0 <= value <= MAX_INDEX
        if (
            word in "/^-×*·"
            or meaning.matches(word)
            or word in meaning.neutral.split()
            or (word in NEUTRAL and not (quantity == "level" and word in LETTERS))
            or (quantity == "angle" and CRANK.matches(word))
            or (word in DIVISIONS and has_unit)
            or (is_index and "." not in word and words[i - 1 : i] not in _FACTOR_MARKS)
        ):
            continue
        if not meaning.dimension:
            return f"{word!r} is not a known word"
        units = _unit_names(meaning.dimension) + ", unweighted" * (quantity == "level")
        return f"{word!r} is neither a known word nor a unit of {meaning.dimension} ({units})"
    return ""
