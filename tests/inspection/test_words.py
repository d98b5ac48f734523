"""The verdict in words, and what to do about a parameter at the end of what was allowed."""

import math
from types import SimpleNamespace

import pytest

from sklearn_pgnn import PhysicsModel, systems
from sklearn_pgnn.diagnosis.structure import Structure
from sklearn_pgnn.inspection import words
from sklearn_pgnn.inspection.report import finding
from sklearn_pgnn.inspection.report.finding import next_step
from sklearn_pgnn.inspection.words import spread_remedy, spread_sentence
from sklearn_pgnn.record_quality.finding import Finding


def test_that_no_cause_acts_is_one_of_the_answers():
    rival = SimpleNamespace(effect="coulomb_friction", target="v", probability=0.05)
    cause = SimpleNamespace(probability=0.5, confused_with=(rival,))
    assert words.rivals(cause) == f"Coulomb friction on v (5 %) and {words.UNNAMED} (45 %)"
    cause.probability = 0.949
    assert words.rivals(cause) == "Coulomb friction on v (5 %)"
    cause.confused_with = ()
    assert words.rivals(cause) == f"{words.UNNAMED} (5 %)"
    cause.probability = 0.999
    assert words.rivals(cause) == ""
    cause.probability, rival.probability, cause.confused_with = math.nan, math.nan, (rival,)
    assert words.rivals(cause) == "Coulomb friction on v (not tested)"


def test_where_a_parameter_differs_between_records_no_physics_is_called_missing(monkeypatch):
    """Fits of single records explain it: no one value is right, however wide its spread is."""
    errors = {"x": SimpleNamespace(extended=4.56)}
    monkeypatch.setattr(words, "over_windows", lambda _: errors)
    model = systems.cart_on_spring()
    of_noise = Finding("drift between records", "position", "the noise differs", 3.0, "look")
    differs = Finding("drift between records", "d", "d goes from 1 to 2", 1.0, "find the reason")
    pinned = model.parameters["d"].value + model.parameters["d"].reach
    found = SimpleNamespace(
        remaining_=SimpleNamespace(kind="structure", law=Structure("v", 0.1)),
        discrepancy_=None,
        model=model,
        data_quality_=(of_noise,),
        verdict_="unexplained",
        parameters_={"d": SimpleNamespace(value=pinned)},
    )
    assert words.remaining_sentence(found).endswith("so physics is still missing.")
    assert next_step(found).startswith("Give d a wider spread first")
    found.data_quality_ = (of_noise, differs)
    said = words.remaining_sentence(found)
    assert "missing" not in said
    assert "fitted to each record alone explains most of it: d goes from 1 to 2." in said
    assert next_step(found).startswith("Improve the records first (drift between records of d): ")
    found.complete_, found.remaining_.kind = True, "disturbance"
    assert "fitted to each record alone explains most of it" in words.remaining_sentence(found)


def test_what_is_likelier_than_every_name_stands_beside_the_names():
    rival = SimpleNamespace(effect="input_bias", target="F", probability=0.03)
    sure = {"probability": 0.2, "outside": 0.7, "parameters": {}, "confused_with": (rival,)}
    cause = SimpleNamespace(effect="coulomb_friction", target="v", **sure)
    found = SimpleNamespace(causes_=(cause,))
    assert words.lacks(found.causes_) == "lacks something like Coulomb friction on v"
    assert words._others(found) == f"input bias of F or {words.UNNAMED} in its place"
    assert finding._alternatives(cause).endswith(f"input bias of F or {words.UNNAMED}")
    cause.outside = 0.05
    assert words.lacks(found.causes_) == "lacks Coulomb friction on v"
    assert words._others(found) == "input bias of F in its place"
    assert finding._alternatives(cause).endswith("on v or input bias of F")


@pytest.mark.parametrize(("unit", "amplitude"), [("1", "3.5 about 2"), ("V", "3.5 V about 2 V")])
def test_an_input_without_a_unit_has_none_in_an_experiment(unit, amplitude):
    sizes = {"amplitude": 3.5, "offset": 2.0, "reached": {}, "repeats": 1, "duration": 10.0}
    told = {"difference": 4.0, "evidence": 5.0, "excitation": "steps", "input": "u", "unit": unit}
    best = SimpleNamespace(**sizes, **told)
    pair = (SimpleNamespace(effect=effect, target="u") for effect in ("input_bias", "input_gain"))
    found = dict(zip(("cause", "other"), pair, strict=True))
    asked = SimpleNamespace(equivalent=False, separable=True, experiments=[best], **found)
    assert f"steps, u by {amplitude}, for 10 s" in words.separation_sentence(asked)


def test_a_parameter_at_the_end_of_its_spread_is_told_with_the_remedy():
    model = systems.cart_on_spring()
    free = [name for name in model.free_parameters if 0 < model.parameters[name].reach < math.inf]
    values = {name: model.parameters[name].value for name in free}
    found = {name: SimpleNamespace(value=value) for name, value in values.items()}
    inside = SimpleNamespace(model=model, parameters_=found, causes_=())
    assert spread_sentence(inside) == spread_remedy(inside) == ""
    first = free[0]
    reach = model.parameters[first].reach
    found[first] = SimpleNamespace(value=values[first] + reach)
    said = spread_sentence(SimpleNamespace(model=model, parameters_=found, causes_=()))
    assert "named" not in said
    assert said.startswith(f"{first} lies at the end of what the spread in the model file allowed")
    assert said.endswith(", or spread: .inf, and diagnose again.")
    lag = PhysicsModel({"y": ""}, {"y": "-k*y"}, {"k": {"value": 2.0, "spread": math.inf}})
    turned = SimpleNamespace(model=lag, parameters_={"k": SimpleNamespace(value=-0.1)}, causes_=())
    assert spread_sentence(turned) == "k changed sign: give bounds if that cannot be."


def test_a_parameter_at_a_bound_is_told_with_the_remedy():
    model = systems.cart_on_spring()
    m, d = model.parameters["m"], model.parameters["d"]
    found = {"m": SimpleNamespace(value=m.bounds[1]), "d": SimpleNamespace(value=d.bounds[0])}
    said = spread_sentence(SimpleNamespace(model=model, parameters_=found, causes_=()))
    assert d.bounds[0] == 0.0
    assert said.startswith("m lies at a bound of the model file: ")
    assert said.endswith("give wider bounds, and diagnose again.")
