"""A diagnosis in words: what an engineer reads on a screen or in a report."""

import itertools
import math
import re

from sklearn_pgnn.estimation.hypothesis import commute
from sklearn_pgnn.physics.effects import find_effect

VERDICTS = {
    "model_adequate": "Model adequate",
    "cause_named": "Cause named",
    "ambiguous": "Several causes fit",
    "unexplained": "Not explained",
}


def number(value: float, digits: int = 4) -> str:
    """Write a number with some significant digits.

    Examples
    --------
    >>> number(0.0804999), number(float("nan")), number(12345678.0)
    ('0.0805', '-', '1.235e+07')
    """
    return f"{value:.{digits}g}" if math.isfinite(value) else "-"


def free_run_error(value: float) -> str:
    """Return the error of a free run in words.

    Examples
    --------
    >>> free_run_error(0.0123), free_run_error(float("inf"))
    ('0.0123', 'runs away')
    """
    return number(value, 3) if math.isfinite(value) else "runs away"


def measured(value: float, low: float, high: float, unit: str = "") -> str:
    """Write a value with its interval, no finer than the interval makes sense.

    Examples
    --------
    >>> measured(0.0804999, 0.07912, 0.08188, "N m")
    '0.0805 (0.0791 to 0.0819) N m'
    >>> measured(2.0, 2.0, 2.0)
    '2'
    """
    if not (math.isfinite(low) and math.isfinite(high)) or low == high:
        return f"{number(value)} {unit}".rstrip()
    places = _places(value, (high - low) / 2)
    text = " ".join(
        (_rounded(value, places), f"({_rounded(low, places)} to {_rounded(high, places)})", unit)
    )
    return text.rstrip()


def _places(value: float, half_width: float) -> int:
    """Return the decimals that show one or two digits of the half-width, six of the value."""
    places = -math.floor(math.log10(half_width / 3))
    if value:
        places = min(places, 5 - math.floor(math.log10(abs(value))))
    return places


def _rounded(value: float, places: int) -> str:
    if value and not 1e-4 <= abs(value) < 1e6 and abs(round(value, places)) > 0:
        return f"{value:.{max(places + math.floor(math.log10(abs(value))), 0)}e}"
    return f"{round(value, places):.{max(places, 0)}f}"


def typeset_unit(unit: str) -> str:
    """Write the powers of a unit as superscripts.

    Examples
    --------
    >>> typeset_unit("kg m^2"), typeset_unit("N m s**-1"), typeset_unit("m^0.5")
    ('kg m²', 'N m s⁻¹', 'm^0.5')
    """
    raised = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    power = r"(?:\^|\*\*)(-?\d+)(?![\d.])"
    return re.sub(power, lambda found: found[1].translate(raised), unit)


def left_alone(left: float) -> str:
    """Return the share of the error power that a candidate leaves, as text.

    Examples
    --------
    >>> left_alone(0.704), left_alone(1.0), left_alone(207.99)
    ('70 %', '100 %', 'makes it worse')
    """
    worse = math.isfinite(left) and round(100 * left) > 100
    return "makes it worse" if worse else percent(left)


def percent(part: float) -> str:
    """Return a share in percent; one just below 1 is not rounded to 100 %.

    Examples
    --------
    >>> percent(0.704), percent(0.9934), percent(0.99996), percent(1.0)
    ('70 %', '99.3 %', '> 99.9 %', '100 %')
    """
    if not math.isfinite(part):
        return "-"
    if part >= 1.0 or part <= 0.0:
        return f"{100 * part:.0f} %"
    if part > 0.9995:
        return "> 99.9 %"
    return f"{100 * part:.{1 if part > 0.985 else 0}f} %"


def chance(probability: float) -> str:
    """Return a probability in percent; one that is nearly 0 or 1 is not rounded to it.

    Examples
    --------
    >>> chance(0.213), chance(0.9999), chance(1.0), chance(2e-4)
    ('21 %', '> 99.9 %', '> 99.9 %', '< 0.1 %')
    """
    if probability > 0.999:
        return "> 99.9 %"
    if probability < 0.001:
        return "< 0.1 %"
    return f"{100 * probability:.{1 if not 0.01 <= probability <= 0.985 else 0}f} %"


def rivals(cause) -> str:
    """Return what a cause is confused with, each with its probability; empty if it is nothing.

    Parameters
    ----------
    cause : NamedCause
        A cause of a diagnosis.

    Returns
    -------
    str
        The list, as in a sentence.
    """
    return listed(
        f"{cause_name(other.effect, other.target)} ({chance(other.probability)})"
        for other in cause.confused_with
    )


def share(gain) -> str:
    """Write the explained share of a gain with its interval.

    Examples
    --------
    >>> from types import SimpleNamespace as Gain
    >>> share(Gain(explained_share=0.927, low=0.874, high=0.963))
    '93 % (87 to 96 %)'
    >>> share(Gain(explained_share=1.0, low=0.9999, high=1.0))
    '> 99.9 %'
    """
    low, high = 100 * gain.low, 100 * gain.high
    if low > 99.95:
        return "> 99.9 %"
    places = 1 if low > 98.5 else 0
    return f"{100 * gain.explained_share:.{places}f} % ({low:.{places}f} to {high:.{places}f} %)"


def cause_name(effect: str, target: str) -> str:
    """Return what people call an effect and what it acts on.

    Parameters
    ----------
    effect, target : str
        Id of an effect, of the catalogue or of one's own, and what it acts on.

    Returns
    -------
    str
        What the effect itself says, see `Effect.title`.

    Examples
    --------
    >>> cause_name("coulomb_friction", "omega"), cause_name("wrong_parameter", "J")
    ('Coulomb friction on omega', 'wrong value of J')
    """
    return find_effect(effect).title(target)


def suspect_name(effect: str, target: str) -> str:
    """Return the name of what was fitted: an effect, the model, or a part of the diagnosis."""
    if not effect:
        return "the re-tuned model"
    return cause_name(effect, target) if target else effect


def listed(items) -> str:
    """Return a list as in a sentence, with "and" before its last entry.

    Examples
    --------
    >>> listed(["a", "b", "c"])
    'a, b and c'
    """
    items = list(items)
    return " and ".join([", ".join(items[:-1]), items[-1]] if len(items) > 1 else items)


def verdict_sentence(diagnosis) -> str:
    """Return the verdict of a diagnosis in plain words.

    Parameters
    ----------
    diagnosis : ModelDiagnosis
        A fitted diagnosis.

    Returns
    -------
    str
        One or two sentences.
    """
    causes = diagnosis.causes_
    names = listed(cause_name(c.effect, c.target) for c in causes)
    found = _found(diagnosis, names) if causes or diagnosis.complete_ else _so_far(diagnosis)
    return f"{stopped_sentence(diagnosis)}{found}".rstrip()


def _so_far(diagnosis) -> str:
    """Return a sentence on the prior's error, where the search ended before a cause was found."""
    if diagnosis.verdict_ == "model_adequate":
        return f"The re-tuned model of the {diagnosis.model.name} leaves hardly more than noise."
    return f"The model of the {diagnosis.model.name} misses something, and no cause was found yet."


def stopped_sentence(diagnosis) -> str:
    """Return why a diagnosis ended early; empty if it did not."""
    if not diagnosis.stopped_:
        return ""
    left = "the search was complete" if diagnosis.complete_ else "this is the best found until then"
    return f"Ended early ({diagnosis.stopped_}); {left}. "


def unusable_sentence(diagnosis) -> str:
    """Return how many candidates could not be fitted, and which; empty if there are none.

    Parameters
    ----------
    diagnosis : ModelDiagnosis
        A fitted diagnosis.

    Returns
    -------
    str
        A sentence, or nothing.
    """
    lost = diagnosis.unusable_
    if not lost:
        return ""
    names = listed(dict.fromkeys(suspect_name(effect, target) for effect, target, _ in lost))
    fits = "fit" if len(lost) == 1 else "fits"
    return f"{len(lost)} {fits} broke down and could not be judged: {names}."


def _found(diagnosis, names: str) -> str:
    """Return a sentence on what was found."""
    name = diagnosis.model.name
    sentences = {
        "model_adequate": f"The model of the {name} is adequate: no effect of the catalogue makes "
        f"it better.",
        "cause_named": f"The model of the {name} misses {names}. {_order(diagnosis)}"
        f"{_worth(diagnosis)} {_described(diagnosis)}",
        "ambiguous": f"The model of the {name} misses {names}, or {_others(diagnosis)}: "
        f"these records cannot tell. {_order(diagnosis)}{_worth(diagnosis)} "
        f"{_described(diagnosis)}",
        "unexplained": f"The model of the {name} misses something that no known effect "
        f"explains. {_described(diagnosis)}",
    }
    return sentences[diagnosis.verdict_].rstrip()


def remaining_sentence(diagnosis) -> str:
    """Return what the named causes leave of the records: noise, a disturbance or structure.

    Parameters
    ----------
    diagnosis : ModelDiagnosis
        A fitted diagnosis.

    Returns
    -------
    str
        One sentence.
    """
    remaining = diagnosis.remaining_
    if remaining.kind == "noise":
        return "What is left is white noise."
    times = listed(
        f"{number(x, 2)} times the white noise of {output}"
        for output, x in sorted(remaining.times_noise.items(), key=lambda item: -item[1])
    )
    if remaining.kind == "structure":
        on = listed(remaining.depends_on) or "what was recorded"
        return (
            f"What is left is structure ({times}): it depends on {on}, so physics is still missing."
        )
    if not diagnosis.complete_:
        return f"What is left is more than noise ({times}); what it depends on was not asked."
    return (
        f"What is left is coloured noise or a disturbance ({times}): it depends on nothing that "
        f"was recorded."
    )


def missing_place(diagnosis, part) -> str:
    """Return where something unnamed is missing."""
    return f"the rate of {part.target}" if part.target in diagnosis.model.states else part.target


def _described(diagnosis) -> str:
    """Return where something unnamed is missing, and its formula; empty if there is none."""
    part = diagnosis.discrepancy_
    if part is None:
        return ""
    on = (
        f"It depends on {listed(part.quantities)}, which explain {percent(part.share)} of its "
        f"smoothed course. "
        if part.quantities
        else ""
    )
    return (
        f"Something is missing in {missing_place(diagnosis, part)}. {on}With {part.formula} added "
        f"there the model leaves {number(part.error, 3)} times the noise."
    )


def _others(diagnosis) -> str:
    others = {
        cause_name(other.effect, other.target): None
        for cause in diagnosis.causes_
        for other in cause.confused_with
    }
    place = "in its place" if len(diagnosis.causes_) == 1 else "in the place of one of them"
    return f"{' or '.join(others)} {place}"


def _order(diagnosis) -> str:
    """Return the order in which a signal meets causes, where another would change the model.

    An effect added to a model later acts on a command earlier, and on a sensor's signal later.
    """
    model, said = diagnosis.model, ""
    for signal in (*model.inputs, *model.outputs):
        met = [cause for cause in diagnosis.records_.causes if cause.target == signal]
        if not all(commute(model, *pair) for pair in itertools.combinations(met, 2)):
            met = met[::-1] if signal in model.inputs else met
            names = [cause_name(effect.id, effect.target) for effect in met]
            said += f"{signal} meets {', then '.join(names)}: the order matters. "
    return said


def _worth(diagnosis) -> str:
    """Return how much of the error the extension removes, output by output."""
    parts = [
        f"{share(gain).replace('> ', 'more than ')} of the error power of {output} above the noise"
        for output, gain in diagnosis.gain_.items()
    ]
    said = f"The extended model removes {listed(parts)}, on data held out of the fit."
    if all(error.tells for error in diagnosis.free_run_.values()):
        return said
    return (
        f"{said} The free run says nothing: without restarts, no model is nearer to the records "
        f"than their mean is, as with an unstable or chaotic machine."
    )


def separation_sentence(separation) -> str:
    """Return a sentence on the experiment that would separate two causes.

    Parameters
    ----------
    separation : Separation
        How two causes can be told apart.

    Returns
    -------
    str
        One or two sentences.
    """
    one, other = (cause_name(c.effect, c.target) for c in (separation.cause, separation.other))
    if separation.equivalent:
        return (
            f"No experiment with these inputs and outputs separates {one} from {other}: in the "
            f"equations they are one and the same."
        )
    if not separation.separable:
        return (
            f"No experiment tried within these amplitudes separates {one} from {other}: look for "
            f"another sensor, a larger range or a higher sampling rate."
        )
    best = separation.experiments[0]
    reached = listed(f"{name} up to {number(top, 2)}" for name, top in best.reached.items())
    times = f", recorded {best.repeats:g} times" if best.repeats > 1 else ""
    return (
        f"To tell {one} from {other}: {best.excitation}, {best.input} by "
        f"{number(best.amplitude, 2)} {best.unit} about {number(best.offset, 2)} {best.unit}, for "
        f"{number(best.duration, 3)} s ({reached}){times}. The two then differ by "
        f"{number(best.difference, 2)} times the noise, {number(best.evidence, 2)} standard errors "
        f"in one record."
    )
