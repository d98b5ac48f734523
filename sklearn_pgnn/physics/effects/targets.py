"""Targets of two quantities, of which one acts on the other: ``"k(x)"``."""


def pair(quantity: str, other: str) -> str:
    """Return two quantities as one target.

    Parameters
    ----------
    quantity, other : str
        What is changed, and by what.

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
        What `pair` returned.

    Returns
    -------
    tuple of str
        What is changed, and by what; the latter is empty where the target is no pair.
    """
    quantity, _, other = target.rstrip(")").partition("(")
    return quantity, other
