"""Targets of two quantities, one of which depends on the other: ``"k(x)"``."""


def pair(quantity: str, other: str) -> str:
    """Return two quantities as one target.

    Parameters
    ----------
    quantity, other : str
        The quantity that is changed, and the one it depends on.

    Returns
    -------
    str
        The target.

    Examples
    --------
    >>> pair("R", "T"), parts("R(T)")
    ('R(T)', ('R', 'T'))
    """
    return f"{quantity}({other})"


def parts(target: str) -> tuple[str, str]:
    """Return the two quantities of a target.

    Parameters
    ----------
    target : str
        Target as returned by `pair`.

    Returns
    -------
    tuple of str
        The quantity that is changed, and the one it depends on; the latter is empty if the target
        is not a pair.
    """
    quantity, _, other = target.rstrip(")").partition("(")
    return quantity, other
