"""Names of causes and candidates, and the sizes of causes, as people read them."""

from sklearn_pgnn.inspection.numbers import measured, typeset_unit
from sklearn_pgnn.physics.effects import find_effect


def cause_name(effect: str, target: str) -> str:
    """Return the plain name of an effect on its target."""
    return find_effect(effect).title(target)


def candidate_name(effect: str, target: str) -> str:
    """Return the name of a fitted item: an effect, the model, or a part of the diagnosis."""
    if not effect:
        return "the re-tuned model"
    return cause_name(effect, target) if target else effect


def sizes_of(cause) -> dict[str, str]:
    """Return the sizes of a named cause with their intervals, by what each is called."""
    found, words = cause.parameters.items(), find_effect(cause.effect).words
    return {
        words.get(field, field.replace("_", " ")): measured(e.value, e.low, e.high, unit)
        for field, e, unit in ((field, e, typeset_unit(e.unit)) for field, e in found)
    }
