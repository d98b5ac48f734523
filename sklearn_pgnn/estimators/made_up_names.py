"""Names for quantities of a table that has none for them."""


def apart_from(names, columns) -> list[str]:
    """Return names that no column has, so that none is read as what is not meant.

    Parameters
    ----------
    names : sequence of str
        Proposals, each another one.
    columns : sequence of str
        The columns of the table.

    Returns
    -------
    list of str
        The proposals, with an underscore behind those that a column has.

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
