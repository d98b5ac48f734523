"""Names of quantities in C."""

from collections.abc import Collection, Iterable

from sklearn_pgnn.export.c_expression import FUNCTIONS

_KEYWORDS = (
    "auto break case char const continue default do double else enum extern float for goto if "
    "inline int long register restrict return short signed sizeof static struct switch typedef "
    "union unsigned void volatile while _Bool"
)
#: names used by the code itself, and names that ``math.h`` may define
_TAKEN = "asm out p side t u x INFINITY NAN HUGE_VAL math_errhandling"
RESERVED = frozenset({*_KEYWORDS.split(), *_TAKEN.split(), *FUNCTIONS}) | {
    f"{f}f" for f in FUNCTIONS
}


def c_name(text: str) -> str:
    """Return a text as an identifier of C99.

    Examples
    --------
    >>> c_name("golf robot"), c_name("μ"), c_name("2 tanks")
    ('golf_robot', 'u03bc', 'm2_tanks')
    """
    name = "".join(map(_letter, text.strip())) or "model"
    return f"m{name}" if name[0].isdigit() else name


def c_names(texts: Iterable[str], taken: Collection[str] = RESERVED) -> dict[str, str]:
    """Return a unique identifier for every text, none of them taken.

    Examples
    --------
    >>> c_names(["x", "x_", "phi", "c0", "double"])
    {'x': 'x_', 'x_': 'x__', 'phi': 'phi', 'c0': 'c0_', 'double': 'double_'}
    """
    found: dict[str, str] = {}
    for text in texts:
        name = c_name(text)
        while name in taken or name in found.values() or _is_shared(name):
            name += "_"
        found[text] = name
    return found


def _is_shared(name: str) -> bool:
    """Return whether a name may be that of a shared expression in the code."""
    return name[0] == "c" and name[1:].isdigit()


def _letter(c: str) -> str:
    if c.isascii() and (c.isalnum() or c == "_"):
        return c
    return f"u{ord(c):04x}" if c.isalnum() else "_"
