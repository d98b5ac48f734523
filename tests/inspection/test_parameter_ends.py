"""A parameter at the end of what was allowed is told, with the remedy."""

import math
from types import SimpleNamespace

from sklearn_pgnn import systems
from sklearn_pgnn.inspection.remedies import spread_remedy, spread_sentence
from sklearn_pgnn.inspection.report.finding import next_step


def test_a_parameter_at_the_end_of_its_spread_is_told_with_the_remedy():
    model = systems.cart_on_spring()
    free = [name for name in model.free_parameters if 0 < model.parameters[name].reach < math.inf]
    values = {name: model.parameters[name].value for name in free}
    found = {name: SimpleNamespace(value=value) for name, value in values.items()}
    inside = SimpleNamespace(model=model, parameters_=found)
    assert spread_sentence(inside) == spread_remedy(inside) == ""
    first = free[0]
    reach = model.parameters[first].reach
    found[first] = SimpleNamespace(value=values[first] + reach)
    assert spread_sentence(SimpleNamespace(model=model, parameters_=found)) == (
        f"{first} lies at the end of what the spread in the model file allowed: the named causes "
        f"and the remaining error may be due to a wrong parameter value. If it is not known that "
        f"well, give a wider spread, or spread: .inf where nothing is known, and diagnose again."
    )


def test_a_parameter_at_a_bound_is_told_with_the_remedy():
    model = systems.cart_on_spring()
    m, d = model.parameters["m"], model.parameters["d"]
    found = {"m": SimpleNamespace(value=m.bounds[1]), "d": SimpleNamespace(value=d.bounds[0])}
    said = spread_sentence(SimpleNamespace(model=model, parameters_=found))
    assert d.bounds[0] == 0.0
    assert said == (
        "m lies at a bound of the model file: what is named and what is left may be due to that. "
        "If values beyond are physically possible, give wider bounds, and diagnose again."
    )


def test_a_wider_spread_is_the_first_step_whatever_else_is_wrong():
    model = systems.cart_on_spring()
    name = next(n for n in model.free_parameters if 0 < model.parameters[n].reach < math.inf)
    parameter = model.parameters[name]
    pinned = SimpleNamespace(
        model=model,
        parameters_={name: SimpleNamespace(value=parameter.value + parameter.reach)},
        verdict_="cause_named",
        complete_=False,
        discrepancy_=None,
        data_quality_=(SimpleNamespace(kind="clipping", where="v", remedy="drive it less"),),
    )
    assert next_step(pinned).startswith(f"Give {name} a wider spread first, or spread: .inf")
    pinned.parameters_[name].value = parameter.value
    assert next_step(pinned).startswith("Improve the records first (clipping of v)")
