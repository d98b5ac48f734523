"""Names of causes and candidates as people read them."""

from sklearn_pgnn.physics.effects import find_effect


def cause_name(effect: str, target: str) -> str:
    """Return the plain name of an effect on its target."""
    return find_effect(effect).title(target)


def candidate_name(effect: str, target: str) -> str:
    """Return the name of a fitted item: an effect, the model, or a part of the diagnosis."""
    if not effect:
        return "the re-tuned model"
    return cause_name(effect, target) if target else effect
