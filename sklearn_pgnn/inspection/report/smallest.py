"""How small an effect these records would have shown, where nothing was named."""

from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.least_size import least_size


def smallest_rows(detectability) -> list[dict]:
    """Return the smallest size of every effect that would have been named."""
    if detectability is None:
        return []
    return [
        {
            "name": cause_name(row.effect, row.target),
            "size": _size(row),
            "reason": row.reason,
        }
        for row in detectability.rows
    ]


def _size(row) -> str:
    if not row.smallest > 0:
        return ""
    return f"{row.parameter.replace('_', ' ')} {least_size(row)}"
