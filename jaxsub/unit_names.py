"""The unit names that people write in logs, and the unit that each one means.

pint alone knows too many: it reads `pct` as picocarat, `rads` as a dose of radiation, `amps` as attometre per second.
So only what is listed here is a unit.
"""

import functools

# what pint calls the unit: its symbols, written as they are, and the prefixes that they may have
_SYMBOLS = {
    "meter": ("m", "n u m c d k"),
    "second": ("s", "n u m"),
    "gram": ("g", "u m k"),
    "newton": ("N", "m k M"),
    "newton*meter": ("Nm", "m k M"),
    "newton*millimeter": ("Nmm", ""),
    "pascal": ("Pa", "m h k M"),
    "bar": ("bar", "m d"),
    "volt": ("V", "u m k"),
    "ampere": ("A", "u m"),
    "watt": ("W", "m k M"),
    "joule": ("J", "m k M"),
    "hertz": ("Hz", "m k M"),
    "tesla": ("T", "n u m"),
    "tesla/10000": ("Gs", "m"),
    "siemens": ("S", "u m"),
    "ohm": ("ohm Ω", "m k M"),
    "mole": ("mol", "n u m"),
    "liter": ("l L", "u m c d"),
    "kelvin": ("K", "m"),
    "radian": ("rad", "u m"),
    "degree": ("deg °", "u m c d"),
    "degree*1e-7": ("degE7", ""),
    "degree*1e-5": ("degE5", ""),
    "degree/second": ("dps", "m"),
    "degree_Celsius": ("degC °C ℃", ""),
    "degree_Fahrenheit": ("degF °F ℉", ""),
    "minute": ("min", ""),
    "hour": ("h", ""),
    "day": ("d", ""),
    "inch": ("in", ""),
    "foot": ("ft", ""),
    "knot": ("kn kt", ""),
    "nautical_mile": ("nmi", ""),
    "tonne": ("t", ""),
    "pound": ("lb lbm", ""),
    "force_pound": ("lbf", ""),
    "force_kilogram": ("kgf", ""),
    "foot*force_pound": ("ftlb ftlbf", ""),
    "pound_force_per_square_inch": ("psi", ""),
    "standard_gravity": ("g_n g_0 g0 gn", "m"),
    "percent": ("%", ""),
    "ppm": ("ppm", ""),
}  # fmt: skip

# words, in capitals or not, one or many
_WORDS = {
    "meter": "meter metre",
    "second": "second sec",
    "gram": "gram gramme",
    "newton": "newton",
    "pascal": "pascal",
    "bar": "bar",
    "volt": "volt",
    "ampere": "ampere amp",
    "watt": "watt",
    "joule": "joule",
    "hertz": "hertz",
    "tesla": "tesla",
    "tesla/10000": "gauss",
    "liter": "liter litre",
    "kelvin": "kelvin",
    "radian": "radian rad",
    "degree": "degree deg degrees_north degrees_east degrees_true degree_north degree_east degree_true degT degM",
    "degree_Celsius": "celsius degree_celsius degrees_celsius deg_C degreeC degreesC",
    "degree_Fahrenheit": "fahrenheit degree_fahrenheit degrees_fahrenheit deg_F degreeF degreesF",
    "minute": "minute min",
    "hour": "hour hr",
    "day": "day",
    "inch": "inch inches",
    "foot": "foot feet",
    "yard": "yard yd",
    "fathom": "fathom",
    "mile": "mile",
    "nautical_mile": "nmile nautical_mile",
    "knot": "knot kts",
    "meter/second": "mps",
    "kilometer/hour": "kph kmh kmph",
    "mile/hour": "mph",
    "foot/second": "fps",
    "tonne": "tonne",
    "pound": "pound lbs",
    "slug": "slug",
    "millibar": "mb",
    "atmosphere": "atm atmosphere",
    "mmHg": "mmHg torr",
    "cubic_centimeter": "cc",
    "turn": "turn rev revolution cycle",
    "turn/minute": "rpm",
    "turn/second": "rps",
    "grade": "gon grad",
    "arcminute": "arcmin",
    "arcsecond": "arcsec",
    "percent": "percent pct",
    "dimensionless": "unitless dimensionless nodim none ratio fraction psu pss count raw bool boolean flag enum",
    "standard_gravity": "gee gravity standard_gravity",
}
_PREFIXES = {"n": "nano", "u": "micro", "m": "milli", "c": "centi", "d": "deci", "h": "hecto", "k": "kilo", "M": "mega"}
_PREFIXED_WORDS = ("meter", "second", "gram", "newton", "pascal", "bar", "volt", "ampere", "watt", "hertz", "tesla",
                   "tesla/10000", "liter", "radian", "degree")  # fmt: skip

# several units in common use have these names, or none does: what to write instead
AMBIGUOUS = {
    "M": "m (metre), nmi (nautical mile) or mol/l",
    "C": "degC",
    "F": "degF",
    "G": "g_n (gravity) or gauss",
    "mG": "milligauss, or 0.001 g_n",
    "nm": "nmi (nautical mile), N m or nanometer",
    "NM": "nmi (nautical mile) or N m",
    "ppt": "1e-3 (per thousand) or 1e-12",
    "mil": "mrad or 0.001 inch",
    "mi": "mile or nmi (nautical mile)",
    "ton": "tonne, or lb with its factor",
    "tons": "tonne, or lb with its factor",
    "kilo": "kg",
    "kilos": "kg",
    "r": "rad or rev",
    "D": "deg or day",
}

# whole texts, without regard to capitals
PHRASES = {
    "": "dimensionless",
    "-": "dimensionless",
    "--": "dimensionless",
    "n/a": "dimensionless",
    "pss-78": "dimensionless",
    "pss78": "dimensionless",
    "deg c": "degree_Celsius",
    "deg. c": "degree_Celsius",
    "deg f": "degree_Fahrenheit",
    "degree c": "degree_Celsius",
    "degrees c": "degree_Celsius",
    "° c": "degree_Celsius",
    "per cent": "percent",
    "r/min": "turn/minute",
    "km/h": "kilometer/hour",
    "m/s": "meter/second",
    "ft-lb": "foot*force_pound",
    "ft lb": "foot*force_pound",
    "g's": "standard_gravity",
}


@functools.cache
def unit_name(name: str) -> str | None:
    """What pint calls the unit `name`, such as `degree` for `Degs`; None where it is none or one of several."""
    symbols, words = _tables()
    if name in AMBIGUOUS:
        return None
    if found := symbols.get(name) or words.get(name.lower()):
        return found
    # HZ, KG and kpa, but not MM: a capital M is mega
    same = {spelt: unit for spelt, unit in symbols.items() if spelt.lower() == name.lower() and len(spelt) > 1}
    plain = not (name.startswith("M") and any(spelt.startswith("m") for spelt in same))
    return next(iter(same.values())) if len(set(same.values())) == 1 and plain else None


@functools.cache
def _tables() -> tuple[dict[str, str], dict[str, str]]:
    """Units by symbol and by word in small letters; `kilo` before what pint calls a unit is a kilo of it."""
    symbols: dict[str, str] = {}
    words = {"usec": "microsecond", "msec": "millisecond", "nsec": "nanosecond"}
    for unit, (spellings, prefixes) in _SYMBOLS.items():
        for symbol in spellings.split():
            symbols[symbol] = unit
            symbols |= {f"{short}{symbol}": f"{_PREFIXES[short]}{unit}" for short in prefixes.split()}
    for unit, spellings in _WORDS.items():
        prefixes = _PREFIXES.values() if unit in _PREFIXED_WORDS else ()
        for word in spellings.lower().split():
            for spelt in (word,) if word.endswith("s") else (word, f"{word}s"):
                words[spelt] = unit
                words |= {f"{prefix}{spelt}": f"{prefix}{unit}" for prefix in prefixes}
    return symbols, words
