"""Names for quantities of a table that has none for them."""


def apart_from(names, columns) -> list[str]:
    """Return names that no column has, so that none is mistaken for another quantity.

    An underscore is appended to those that a column has.

    Examples
    --------
    >>> apart_from(["x0", "x1"], ["t", "x0"])
    ['x0_', 'x1']
    """
    found: list[str] = []
    for name in names:
        while name in columns or name in found:
            name += "_"
        found.append(name)
    return found
