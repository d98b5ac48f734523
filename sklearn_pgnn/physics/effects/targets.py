"""Targets of two quantities, one of which depends on the other: ``"k(x)"``."""


def pair(quantity: str, other: str) -> str:
    """Return two quantities as one target.

    Examples
    --------
    >>> pair("R", "T"), parts("R(T)")
    ('R(T)', ('R', 'T'))
    """
    return f"{quantity}({other})"


def parts(target: str) -> tuple[str, str]:
    """Return the two quantities of a target."""
    quantity, _, other = target.rstrip(")").partition("(")
    return quantity, other
