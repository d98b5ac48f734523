"""Parts of a report: one that cannot be made does not cost the others."""

from collections.abc import Callable
from typing import Any

from sklearn_pgnn.exceptions import DiagnosisWarning
from sklearn_pgnn.user_line import warn_user


def part(what: str, make: Callable[..., Any], *of: Any, without: Any) -> Any:
    """Return a part of a report; after an error what stands in its place, with a warning."""
    try:
        return make(*of)
    except Exception as error:
        warning = DiagnosisWarning(
            f"the report lacks {what} ({type(error).__name__}: {error}). Remedy: report it as a "
            f"bug of sklearn-pgnn; all else of the report is there."
        )
        warning.__cause__ = error
        warn_user(warning, DiagnosisWarning)
        return without
