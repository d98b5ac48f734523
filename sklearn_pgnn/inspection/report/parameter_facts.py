"""What became of the parameters: changed, at a limit, or not fixed by the records."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class ParameterFacts:
    """What became of the free parameters of a model and of its causes.

    The interval of those `changed` leaves the value out that was given; those `at_limit` are at the
    end of what the fit allowed, of the model or of a cause. The fit held those `held` where they
    were: beside the others the records do not fix them. Nor do they fix those `open`, whose
    interval is not finite.
    """

    changed: tuple[str, ...]
    at_limit: tuple[str, ...]
    held: tuple[str, ...]
    open: tuple[str, ...]

    @property
    def unidentified(self) -> tuple[str, ...]:
        """Those that the records do not fix."""
        return tuple(dict.fromkeys((*self.held, *self.open)))


def parameter_facts(diagnosis) -> ParameterFacts:
    """Return what became of the parameters."""
    fit, found = diagnosis.records_.fits[diagnosis.records_.best], diagnosis.parameters_
    free = {freedom.name: freedom for freedom in fit.freedoms}
    value = {name: parameter.value for name, parameter in fit.model.parameters.items()}
    value |= {name: parameter.value for name, parameter in found.items()}
    limited = (n for n, f in free.items() if not f.low < value[n] < f.high)
    unfixed = (n for n, p in found.items() if not math.isfinite(p.high - p.low))
    return ParameterFacts(
        changed=tuple(name for name, p in found.items() if p.changed),
        at_limit=tuple(limited),
        held=tuple(name for name in found if name not in free),
        open=tuple(unfixed),
    )
