"""Parameters at an end of their spread or at a bound, in words."""

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.spread_ends import at_bounds, at_spread_ends
from sklearn_pgnn.record_quality.finding import listed


def spread_sentence(diagnosis) -> str:
    """Return which parameters lie at an end of a spread or at a bound, and what to do."""
    retuned = _retuned(diagnosis)
    spread, bounds = at_spread_ends(diagnosis.model, retuned), at_bounds(retuned)
    return " ".join(filter(None, (_at_spreads(spread), _at_bounds(bounds))))


def spread_remedy(diagnosis) -> str:
    """Return what to do first where parameters lie at an end of a spread."""
    names = at_spread_ends(diagnosis.model, _retuned(diagnosis))
    if not names:
        return ""
    spread, lie = ("wider spreads", "they lie") if len(names) > 1 else ("a wider spread", "it lies")
    return (
        f"Give {listed(names)} {spread} first, or spread: .inf where nothing is known, and "
        f"diagnose again: {lie} at the end of what was allowed, so a wrong value of a parameter "
        f"may be taken for a cause."
    )


def _retuned(diagnosis) -> PhysicsModel:
    """Return the prior with its re-tuned values."""
    values = {name: parameter.value for name, parameter in diagnosis.parameters_.items()}
    return diagnosis.model.with_parameters(**values)


def _at_spreads(names) -> str:
    if not names:
        return ""
    lies, spread = ("lie", "spreads") if len(names) > 1 else ("lies", "spread")
    return (
        f"{listed(names)} {lies} at the end of what the {spread} in the model file allowed: the "
        f"named causes and the remaining error may be due to a wrong parameter value. If it is not "
        f"known that well, give a wider spread, or spread: .inf where nothing is known, and "
        f"diagnose again."
    )


def _at_bounds(names) -> str:
    if not names:
        return ""
    lies, bounds = ("lie", "bounds") if len(names) > 1 else ("lies", "a bound")
    return (
        f"{listed(names)} {lies} at {bounds} of the model file: what is named and what is left may "
        f"be due to that. If values beyond are physically possible, give wider bounds, and "
        f"diagnose again."
    )
