"""The files of a diagnosis: for programs, the extended model, one with every rival."""

import json
import re
from collections.abc import Callable, Iterator, Mapping
from functools import cache

from sklearn_pgnn.estimation.plain_data import finite
from sklearn_pgnn.inspection.case import model_with_all
from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.report.causes import all_members

#: the file of a diagnosis, in the folder that the command line writes
FILE = "diagnosis.json"
EXTENDED = "extended_model.yaml"
#: pattern of the file names of rivals
RIVALS = "extended_model_with_*_for_*.yaml"


def as_strict_json(data: Mapping) -> str:
    """Return plain data as strict JSON; null where a number is not finite.

    >>> print(as_strict_json({"free_run": float("inf")}), end="")
    {
      "free_run": null
    }
    """
    return json.dumps(finite(data), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def model_files(diagnosis) -> dict[str, Callable[[], str]]:
    """Return functions that give the text of every model file, by file name.

    The extended model comes first, then one with each rival in the place of its cause; there are
    none where the model calls functions that have no equation.
    """
    if diagnosis.model.opaque_functions:
        return {}
    members = cache(lambda: all_members(diagnosis))
    rivals = {
        name: lambda at=(cause, 1 + place): members()[at[0]][at[1]].model.to_yaml()
        for name, cause, place in _rivals(diagnosis)
    }
    return {EXTENDED: lambda: model_with_all(diagnosis).to_yaml(), **rivals}


def described_models(diagnosis) -> dict[str, str]:
    """Return a description of every model file, by file name."""
    if diagnosis.model.opaque_functions:
        return {}
    held = "re-tuned and extended by what was named" if diagnosis.causes_ else "re-tuned"
    if diagnosis.discrepancy_ is not None:
        held += ", with the formula for what no cause explains"
    elif not diagnosis.causes_:
        held += " only"
    described = {EXTENDED: f"the model, {held}; a model file again"}
    for name, number, place in _rivals(diagnosis):
        cause = diagnosis.causes_[number]
        pair = (cause.confused_with[place], cause)
        rival, named = (cause_name(each.effect, each.target) for each in pair)
        described[name] = f"the same with {rival} in the place of {named}"
    return described


def _rivals(diagnosis) -> Iterator[tuple[str, int, int]]:
    """Yield the file of every rival, the number of its cause, and its place among the rivals."""
    for number, cause in enumerate(diagnosis.causes_):
        for place, rival in enumerate(cause.confused_with):
            words = f"with_{rival.effect}_{rival.target}_for_{cause.effect}_{cause.target}"
            name = re.sub(r"[^\w.-]", "_", words)
            yield f"extended_model_{name}.yaml", number, place
