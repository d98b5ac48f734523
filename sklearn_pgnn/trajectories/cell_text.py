"""Numbers and times in texts, as people and programs write them.

A date counts in a record only by what differs from row to row, so that the order of day and month
matters only where the date changes: there it is told by the dots of ``31.01.2026``, by a name of a
month, or by the one reading in which all dates exist, or follow each other in even steps. Where
both readings are left, it is refused.
"""

import datetime
import math
import re
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from decimal import Decimal
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd

# -- numbers: the mark of the decimals, groups of thousands, exponents of Fortran ------------------

#: texts for a value that is missing, in small letters
NOTHING = frozenset({"", "nan", "na", "n/a", "#n/a", "null", "none", "-", "+nan", "-nan", "nat"})
#: how C's library of Microsoft writes that there is none
_NO_NUMBER = re.compile(r"[+-]?(1\.#(qnan|snan|ind)\w*|nan\((ind|snan)\))", re.IGNORECASE)
_SIGNS = str.maketrans({"−": "-", "\u00a0": " ", "\u202f": " ", "\u2009": " ", "’": "'"})
_EXPONENT = re.compile(r"[dDqQ](?=[+-]?\d+$)")
#: longest text of a number
LONGEST = 400


def _pattern(mark: str, other: str) -> re.Pattern[str]:
    """Return the pattern of numbers, maybe with groups of three digits before the mark."""
    grouped = rf"[1-9]\d{{0,2}}(?P<gap>[{other} '])\d{{3}}(?:(?P=gap)\d{{3}})*(?:{mark}\d*)?"
    return re.compile(rf"[+-]?(?:{grouped}|(?=\d|{mark}\d)\d*(?:{mark}\d*)?([eEdDqQ][+-]?\d+)?)")


_PATTERNS = {".": _pattern(r"\.", ","), ",": _pattern(",", r"\.")}


def read_number(cell: Any, mark: str = ".") -> float | None:
    """Return a number, NaN for an empty cell, None for anything else.

    >>> read_number("1,736.9"), read_number("1.736,9", ","), read_number("2.5D-03")
    (1736.9, 1736.9, 0.0025)
    >>> read_number("1.#QNAN"), read_number("half")
    (nan, None)
    """
    if type(cell) is str:
        known = _as_computers_write(cell, mark)
        if known is not None:
            return known
    elif isinstance(cell, Real | Decimal):
        return float(cell)
    else:
        missing = cell is None or (pd.api.types.is_scalar(cell) and pd.isna(cell))
        return math.nan if missing else None
    text = cell.strip()
    if text.lower() in NOTHING or _NO_NUMBER.fullmatch(text):
        return math.nan
    return _number(text, mark)


def _as_computers_write(cell: str, mark: str) -> float | None:
    """Return a number in Python's own form, but for the mark: most cells, and ten times as fast."""
    if mark == ",":
        if "." in cell:
            return None
        cell = cell.replace(",", ".")
    try:
        return float(cell) if "_" not in cell else None
    except ValueError:
        return None


def _number(text: str, mark: str) -> float | None:
    text = text.translate(_SIGNS)
    found = _PATTERNS[mark].fullmatch(text) if len(text) <= LONGEST else None
    if found is None:
        return math.inf if text.lower().lstrip("+-") in ("inf", "infinity") else None
    if found["gap"]:
        text = text.replace(found["gap"], "")
    return float(_EXPONENT.sub("e", text.replace(mark, ".")))


def mark_of(cells: Iterable[Any]) -> str:
    """Return the mark of the decimals that the first telling cell has; nothing if both may be.

    >>> mark_of(["2", "0,5"]), mark_of(["1.736"]), mark_of(["1,736.9"])
    (',', '', '.')
    """
    for cell in cells:
        if isinstance(cell, str) and ("," in cell or "." in cell):
            can = [mark for mark in _PATTERNS if _number(cell.strip(), mark) is not None]
            if len(can) == 1:
                return can[0]
    return ""


def may_be_two(cell: Any) -> bool:
    """Whether a text is one number with a decimal point and another with a decimal comma.

    >>> may_be_two("1,736"), may_be_two("0,736"), may_be_two("12")
    (True, False, False)
    """
    if not isinstance(cell, str):
        return False
    point, comma = (_number(cell.strip(), mark) for mark in _PATTERNS)
    return point is not None and comma is not None and point != comma


def whole_numbers(cells: Sequence[Any]) -> np.ndarray | None:
    """Return whole numbers with more digits than a float has, such as nanoseconds; else None."""
    try:
        ticks = [int(cell) for cell in cells if not isinstance(cell, float)]
    except (TypeError, ValueError):
        return None
    long = len(ticks) == len(cells) and bool(ticks) and 2**53 < max(ticks) < 2**63
    return np.array(ticks, dtype=np.int64) if long and min(ticks) >= 0 else None


# -- dates and times of day, as time differences ---------------------------------------------------

_CLOCK = (
    r"(?:(?P<days>-?\d{1,5}) days?,? \+?)?(?:(?P<h>\d{1,3}):)?(?P<m>\d{1,2}):(?P<s>\d{1,2})"
    r"(?:[.,](?P<f>\d{1,9})|:(?P<ms>\d{3}))?(?: ?(?P<half>[AaPp])\.?[Mm]\.?)?"
)
_TIME = re.compile(_CLOCK)
_DATED = re.compile(
    r"(?P<a>\d{1,4}|[^\W\d]{3,9})\.?(?P<gap>[./\- ])\s*(?P<b>\d{1,2}|[^\W\d]{3,9})\.?,?[./\- ]\s*"
    rf"(?P<c>\d{{1,4}})(?:,?[ T]\s*{_CLOCK})?"
)
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_NUMBER_OF = {name: k for k, name in enumerate(_MONTHS, 1)}
_NUMBER_OF |= {"mär": 3, "mrz": 3, "mai": 5, "okt": 10, "dez": 12, "fév": 2, "avr": 4, "déc": 12}
#: a time of day, and one in minutes and seconds, begin again after so many seconds
DAY, HOUR = 86_400, 3_600
_NS = 10**9
_Date = tuple[str, str, str]


class UnclearTimes(ValueError):
    """Times with more than one meaning: the text says which and ends with the remedy."""


def read_times(cells: list[Any]) -> pd.Series | None:
    """Return dates or time differences, NaT where a cell is neither; None if the first is none.

    >>> read_times(["31.01.2026 12:00:00,500", "1.2.2026 12:00:00"]).diff()[1]
    Timedelta('0 days 23:59:59.500000')
    >>> read_times(["23:59:59.98", "00:00:00.00"]).diff()[1]
    Timedelta('0 days 00:00:00.020000')
    """
    if not cells:
        return None
    if not isinstance(cells[0], str):
        return _of_objects(cells)
    texts = [cell.strip() if isinstance(cell, str) else "" for cell in cells]
    if not re.search(r"\d[:./\-]\d|\d{8}T\d|\d[ \-.][^\W\d]{3}|[^\W\d]{3} \d", texts[0]):
        return None
    if _DATED.fullmatch(texts[0]) and not re.match(r"\d{4}-", texts[0]):
        return _of_dates([_DATED.fullmatch(text) for text in texts])
    if _TIME.fullmatch(texts[0]):
        return _of_clock([_TIME.fullmatch(text) for text in texts])
    texts = [text.replace(",", ".") for text in texts]
    dates = pd.to_datetime(pd.Series(texts), format="ISO8601", utc=True, errors="coerce")
    return None if pd.isna(dates[0]) else dates


def _of_objects(cells: list[Any]) -> pd.Series | None:
    """Return what a spreadsheet has as dates, times of day or time differences."""
    first = cells[0]
    if isinstance(first, datetime.time):
        texts = [c.isoformat("microseconds") if isinstance(c, datetime.time) else "" for c in cells]
        return _of_clock([_TIME.fullmatch(text) for text in texts])
    if isinstance(first, datetime.timedelta):
        return pd.to_timedelta(pd.Series(cells, dtype=object), errors="coerce")
    if isinstance(first, datetime.date):
        return pd.to_datetime(pd.Series(cells, dtype=object), errors="coerce", utc=True)
    return None


def _of_clock(found: list[re.Match[str] | None]) -> pd.Series:
    """Return times of day, or minutes and seconds, that go on where they begin again."""
    full = any(part and (part["h"] or part["days"]) for part in found)
    if not full and not any(part and part["f"] for part in found):
        raise UnclearTimes("Remedy: write times as hh:mm:ss, for 10:05 may be hours or minutes.")
    ns = np.array([_nanoseconds(part) for part in found], dtype=float)
    drops = np.diff(ns, prepend=ns[:1])
    period = (DAY if full else HOUR) * _NS
    told = any(part and part["days"] for part in found)
    again = (drops < -period / 2) & (not told)
    return _series(ns + period * np.cumsum(again))


def _of_dates(found: list[re.Match[str] | None]) -> pd.Series:
    """Return dates with times of day since the first date."""
    dates = [None if part is None else (part["a"], part["b"], part["c"]) for part in found]
    known = [date for date in dict.fromkeys(dates) if date]
    dotted = bool(found[0] and found[0]["gap"] == ".")
    readings = [_days(reading, known) for reading in (_day_first, _month_first)[: 2 - dotted]]
    most = max(map(len, readings))
    clock = np.array([np.nan if p is None else _nanoseconds(p, dated=True) for p in found])
    told = [
        clock + np.array([np.nan if d is None else DAY * _NS * days.get(d, np.nan) for d in dates])
        for days in readings
        if len(days) == most
    ]
    even = [ns for ns in told if _is_even(ns)]
    told = even if len(even) == 1 else told
    if not np.array_equal(told[0], told[-1], equal_nan=True):
        raise UnclearTimes(
            "Remedy: write dates as 2026-01-31 12:00:00.005, for 02/03 may be in February or March."
        )
    return _series(told[0])


def _is_even(ns: np.ndarray) -> bool:
    """Whether no step is more than twice the usual one."""
    steps = np.diff(ns)
    return not steps.size or bool(0 < steps.max() <= 2 * np.median(steps))


def _series(ns: np.ndarray) -> pd.Series:
    bad = np.isnan(ns)
    whole = np.where(bad, np.iinfo(np.int64).min, np.nan_to_num(ns)).astype("int64")
    return pd.Series(whole.view("m8[ns]"))


def _nanoseconds(part: re.Match[str] | None, dated: bool = False) -> float:
    """Return the time of day [ns]; with a date, two numbers are hours and minutes."""
    if part is None:
        return np.nan
    if part["m"] is None:
        return 0.0
    hours, minutes, seconds = (int(part[name] or 0) for name in "hms")
    if dated and part["h"] is None:
        hours, minutes, seconds = minutes, seconds, 0
    if part["half"]:
        hours = hours % 12 + 12 * (part["half"] in "Pp")
    days = int(part["days"] or 0)
    fraction = int(f"{part['f'] or part['ms'] or ''}".ljust(9, "0") or 0)
    if minutes > 59 or seconds > 59:
        return np.nan
    return float((((days * 24 + hours) * 60 + minutes) * 60 + seconds) * _NS + fraction)


# -- day, month and year ---------------------------------------------------------------------------


def _day_first(date: _Date) -> tuple[int, int, int]:
    """Return year, month and day of ``31/01/2026``, or of ``2026/01/31``."""
    a, b, c = date
    if len(a) == 4 and a.isdecimal():
        return int(a), _month(b), int(c)
    return _year(c), *((_month(a), int(b)) if not a.isdecimal() else (_month(b), int(a)))


def _month_first(date: _Date) -> tuple[int, int, int]:
    """Return year, month and day of ``01/31/2026``; a month by its name, or after a year, as is."""
    a, b, c = date
    if not (a.isdecimal() and b.isdecimal()) or len(a) == 4:
        return _day_first(date)
    return _year(c), int(a), int(b)


def _year(text: str) -> int:
    return int(text) + (2000 if len(text) < 3 else 0)


def _month(text: str) -> int:
    return int(text) if text.isdecimal() else _NUMBER_OF[text.lower()[:3]]


def _days(
    reading: Callable[[_Date], tuple[int, int, int]], dates: list[_Date]
) -> dict[_Date, float]:
    """Return the days of the dates that exist, since the first."""
    found: dict[_Date, float] = {}
    for date in dates:
        with suppress(ValueError, KeyError):
            found[date] = float(datetime.date(*reading(date)).toordinal())
    first = next(iter(found.values()), 0.0)
    return {date: day - first for date, day in found.items()}
