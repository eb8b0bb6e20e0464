"""Numbers, symbols and formulas as a person would write them."""

import hashlib
import math
import re
import unicodedata
from decimal import Decimal
from typing import Any

from markupsafe import Markup, escape

MINUS, TIMES, NARROW_SPACE = "\N{MINUS SIGN}", "\N{MULTIPLICATION SIGN}", "\N{NARROW NO-BREAK SPACE}"
UNKNOWN, _DOT = "\N{EN DASH}", "\N{COMBINING DOT ABOVE}"
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_GREEK: dict[str, str] = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "phi": "φ", "theta": "θ", "psi": "ψ", "tau": "τ",
    "kappa": "κ", "rho": "ρ", "omega": "ω",
}  # fmt: skip
_PLAIN_EXPONENTS = range(-4, 6)  # powers of ten that are written out
_LONGEST_STEM = 100  # file systems take 255 bytes
_SMALLEST_P = 1e-300  # below it a p-value is no longer a number that was computed


def power_of_ten(exponent: int) -> str:
    """`10⁻⁵` for -5."""
    return f"10{str(exponent).translate(_SUPERSCRIPTS)}"


def number(value: float, digits: int = 4) -> str:
    """`value` to at most `digits` significant digits, without trailing zeros; a dash when it is not a number."""
    if math.isnan(value):
        return UNKNOWN
    if math.isinf(value):
        return "∞" if value > 0 else f"{MINUS}∞"
    if value == 0.0:
        return "0"
    exponent = _exponent(value, digits)
    if exponent in _PLAIN_EXPONENTS:
        return _signed(_strip(_rounded(value, digits - 1 - exponent)))
    return f"{_signed(_strip(_rounded(_shifted(value, exponent), digits - 1)))} {TIMES} {power_of_ten(exponent)}"


def measurement(value: float, error: float) -> str:
    """`0.610 ± 0.020`: the standard error to two significant digits and the value to the same place."""
    if not math.isfinite(value) or not math.isfinite(error):
        return f"{number(value)} ± ∞" if math.isinf(error) else number(value)
    if error <= 0.0:
        return number(value)
    exponent = max(_exponent(value, 2), _exponent(error, 2)) if value else _exponent(error, 2)
    place = 1 - _exponent(error, 2)
    if exponent in _PLAIN_EXPONENTS:
        return f"{_signed(_rounded(value, place))} ± {_rounded(error, place)}"
    value, error, place = _shifted(value, exponent), _shifted(error, exponent), place + exponent
    return f"({_signed(_rounded(value, place))} ± {_rounded(error, place)}) {TIMES} {power_of_ten(exponent)}"


def p_value(p: float) -> str:
    """A p-value to two digits, and `< 10⁻³⁰⁰` where it is too small to mean more."""
    if math.isnan(p):
        return UNKNOWN
    return f"< {power_of_ten(-300)}" if p < _SMALLEST_P else number(p, 2)


def p_equals(p: float) -> str:
    """As in a sentence: `p = 0.031`, or `p < 10⁻³⁰⁰`."""
    said = p_value(p)
    return f"p {said}" if said.startswith("<") else f"p = {said}"


def percent(share: float) -> str:
    """A probability or share in percent; never 0 or 100 % for what is only close to it."""
    if math.isnan(share):
        return UNKNOWN
    if 0.0 < share < 0.001:
        return f"< 0.1{NARROW_SPACE}%"
    if 0.999 < share < 1.0:
        return f"> 99.9{NARROW_SPACE}%"
    hundredths = 100.0 * share
    digits = 1 if 0.0 < hundredths < 1.0 or 99.0 < hundredths < 100.0 else 0
    return f"{hundredths:.{digits}f}{NARROW_SPACE}%"


def ratio(value: float | None) -> str:
    """rms(residual)/σ to three digits."""
    if value is None or math.isnan(value):
        return UNKNOWN
    return f"{value:.2f}" if value < 9.995 else f"{value:.1f}" if value < 99.95 else number(value, 3)


def visible(value: Any) -> Any:
    """`value` with its control characters, such as those that reverse the order of letters, as their code points.

    What is no text stays, and what was marked as safe stays so. Line breaks and tabs stay.
    """
    # each letter is looked up once: a page with its pictures has millions
    hidden = {letter for letter in set(value) if not _shows(letter)} if isinstance(value, str) else set()
    if not hidden:
        return value
    shown = "".join(f"[U+{ord(letter):04X}]" if letter in hidden else letter for letter in value)
    return Markup(shown) if isinstance(value, Markup) else shown


def file_stem(name: str) -> str:
    """A file name without suffix for what is called `name`: plain letters, short, and another for another name."""
    plain = re.sub(r"[^A-Za-z0-9_.-]", "_", name)[:_LONGEST_STEM]
    return plain if plain == name else f"{plain}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"


def symbol(name: str) -> str:
    """A name in plain letters as on the page: `φ` for `phi`, `δ_r` for `delta_r`, `φ̇` for `phi_rate`."""
    stem, _, last = name.rpartition("_")
    if last == "rate" and (stem in _GREEK or len(stem) == 1):
        return symbol(stem) + _DOT
    return "_".join(_GREEK.get(part, part) for part in name.split("_"))


def typeset(name: str) -> Markup:
    """The same as HTML, with subscripts: `δ<sub>r</sub>`; what is no identifier stays as it is."""
    return _identifier(name) if name.isidentifier() else escape(symbol(name))


def plain_label(label: str) -> str:
    """The label of an effect in plain letters, with what it names in brackets as symbols: `sensor-bias[ψ]`."""
    return "".join(symbol(piece) for piece in _label_pieces(label))


def typeset_label(label: str) -> Markup:
    """The same as HTML, with subscripts."""
    return Markup("").join(typeset(piece) for piece in _label_pieces(label))


def _label_pieces(label: str) -> list[str]:
    """What stands before the brackets of a label, and the names and separators in them."""
    stem, bracket, inside = label.partition("[")
    return [stem, bracket, *re.split(r"([^\W\d]\w*)", inside)]


def prose(text: str) -> Markup:
    """A sentence with the Greek names of quantities in it as symbols: `φ is left at 2 σ`."""
    names = rf"(?<![\w./\\-])((?:{'|'.join(_GREEK)})(?:_\w+)?)(?![\w./\\(-])"
    pieces = re.split(names, text)
    return Markup("").join(typeset(piece) if index % 2 else escape(piece) for index, piece in enumerate(pieces))


def place_name(place: str) -> str:
    """Where a mismatch lies in words: an equation, `actuator rudder` or `sensor ψ`."""
    kind, colon, name = place.partition(":")
    said = {"input": "actuator", "sensor": "sensor"}.get(kind) if colon else None
    return f"{said} {symbol(name)}" if said else symbol(place)


def unit(text: str) -> str:
    """A unit with its powers set: `N m/(rad/s)²` for `N*m/(rad/s)/(rad/s)`, nothing for a pure number."""
    if text.strip() == "1":
        return ""
    text = re.sub(r"(?:\^|\*\*)(-?\d+)", lambda match: match[1].translate(_SUPERSCRIPTS), text).replace("*", " ")
    repeated = r"(/(?:\([^()]*\)|\w+))(\1)+"
    return re.sub(repeated, lambda m: m[1] + str(len(m[0]) // len(m[1])).translate(_SUPERSCRIPTS), text)


def formula(text: str) -> Markup:
    """A formula as HTML: true minus signs, bars for `abs`, Greek letters by name, subscripts after an underscore.

    Factors stand side by side.
    """
    text = re.sub(r"(?<!\*)\*(?!\*)", " ", text)
    text = re.sub(r"\babs\(([^()]*)\)", r"|\1|", text)
    text = re.sub(r"-(?![A-Za-z])|(?<![A-Za-z])-", MINUS, text)
    pieces = re.split(r"([^\W\d_]\w*)", text)
    return Markup("").join(_identifier(piece) if index % 2 else escape(piece) for index, piece in enumerate(pieces))


def _identifier(name: str) -> Markup:
    if "_" not in symbol(name).strip("_"):
        return escape(symbol(name))
    base, _, below = name.partition("_")
    below = "".join(symbol(part) for part in below.split("_"))
    below = re.sub(r"(\w)dot$", rf"\1{_DOT}", below)
    return Markup("{}<sub>{}</sub>").format(symbol(base), below)


def _exponent(value: float, digits: int) -> int:
    """The power of ten of `value` once it is rounded to `digits`."""
    return int(f"{value:.{digits - 1}e}".partition("e")[2])


def _shifted(value: float, exponent: int) -> float:
    # Decimal, because 10.0**exponent loses digits or underflows at the ends of the range.
    return float(Decimal(value).scaleb(-exponent))


def _rounded(value: float, place: int) -> str:
    return f"{round(value, place):.{max(place, 0)}f}"


def _strip(text: str) -> str:
    return text.rstrip("0").rstrip(".") if "." in text else text


def _signed(text: str) -> str:
    negative = text.startswith("-") and text.strip("-0.") != ""
    return f"{MINUS}{text[1:]}" if negative else text.lstrip("-")


def _shows(letter: str) -> bool:
    # narrow and no-break spaces are set on purpose, and count as not printable
    return letter.isprintable() or letter in "\n\t" or unicodedata.category(letter) == "Zs"
