"""What sentences about records and machines share."""

from collections.abc import Iterable


def listed(items: Iterable[str]) -> str:
    """Return a list as in a sentence, with "and" before its last entry.

    Examples
    --------
    >>> listed(["a", "b", "c"])
    'a, b and c'
    """
    items = list(items)
    return " and ".join([", ".join(items[:-1]), items[-1]] if len(items) > 1 else items)
