"""The options of a diagnosis: their valid values, and the messages for invalid ones."""

from numbers import Integral, Real

from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.physics.model_parts import HOLDS


def check_options(hold: str, alpha: float, smallest_share: float) -> None:
    """Raise `OptionError` unless the rates lie between 0 and 1, and the hold is a known one."""
    for name, value in (("alpha", alpha), ("smallest_share", smallest_share)):
        if not (isinstance(value, Real) and 0 < float(value) < 1):
            raise OptionError(f"{name}: expected a number between 0 and 1, got {value!r}.")
    if hold not in ("auto", *HOLDS):
        raise OptionError(f"hold: expected one of auto, {', '.join(HOLDS)}, got {hold!r}.")


def check_max_causes(count: int) -> None:
    """Raise `OptionError` unless a number of causes is a non-negative integer."""
    if not isinstance(count, Integral) or count < 0:
        raise OptionError(f"max_causes: expected an integer >= 0, got {count!r}.")


def check_time_limit(limit: float | None) -> None:
    """Raise `OptionError` unless a limit is a time above 0 s, or None."""
    if limit is not None and not (isinstance(limit, Real) and float(limit) > 0):
        raise OptionError(f"time_limit: expected a time above 0 s or None, got {limit!r}.")


def check_detectability(power: float, noise: str) -> None:
    """Raise `ValueError` unless a power lies between 0 and 1, and the noise is a known kind."""
    if not 0 < power < 1:
        raise ValueError(f"power: expected a number between 0 and 1, got {power!r}.")
    if noise not in ("residual", "white"):
        raise ValueError(f"noise: expected 'residual' or 'white', got {noise!r}.")
