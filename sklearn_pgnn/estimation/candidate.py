"""A candidate as plain data: the effect's id and its target."""

from typing import NamedTuple


class Candidate(NamedTuple):
    """An effect and its target.

    Parameters
    ----------
    effect : str
        Id of the effect in the catalogue.
    target : str
        The state in whose rate it acts, or the input, output or parameter.

    Examples
    --------
    >>> Candidate("coulomb_friction", "omega").target
    'omega'
    """

    effect: str
    target: str
