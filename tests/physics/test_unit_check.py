"""Equations against their units: what fits is not warned of, and what does not is named."""

import warnings

import pytest

from sklearn_pgnn import PhysicsModel, effects, systems
from sklearn_pgnn.exceptions import UnitWarning
from sklearn_pgnn.physics.unit_check import check_units, output_measure
from sklearn_pgnn.physics.units import read_unit

SYSTEMS = [getattr(systems, name) for name in systems.__all__]


def cart(**changes):
    units = {"m": "kg", "k": "N/m", "d": "N s/m", "x": "m", "v": "m/s", "F": "N", **changes}
    return PhysicsModel(
        {"x": units["x"], "v": units["v"]},
        {"x": "v", "v": "(F - k*x - d*v)/m"},
        {name: {"value": 1.0, "unit": units[name]} for name in "mkd"},
        {"F": units["F"]},
        inertia={"v": "m"},
    )


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_ready_systems_fit_their_units_with_every_effect_of_the_catalogue(system):
    model = system()
    assert check_units(model) == ()
    for kind in effects.CATALOGUE:
        for target in kind.targets(model):
            assert check_units(model + kind(target)) == (), (kind.id, target)


@pytest.mark.parametrize(
    ("changes", "terms"),
    [
        ({}, []),
        ({"k": "N"}, ["-k*x"]),
        ({"d": "N/m"}, ["-d*v"]),
        ({"F": "V"}, ["F"]),
        ({"F": "kN"}, ["F"]),
        ({"m": "g"}, ["F", "-k*x", "-d*v"]),
        ({"k": "N", "d": ""}, ["-k*x"]),
        ({"k": ""}, []),
        ({"k": "bananas"}, []),
        ({"v": "mm/s"}, ["v", "F", "-k*x"]),
    ],
)
def test_the_term_that_does_not_fit_is_named(changes, terms):
    said = check_units(cart(**changes))
    assert sorted(text.split("the term ")[1].split(" is in")[0] for text in said) == sorted(terms)


def test_another_scale_has_its_factor():
    (said,) = check_units(cart(F="kN"))
    assert said == "equations.v: the term F is in 1000 N, expected N (a factor of 1000)."
    cell = PhysicsModel({"z": ""}, {"z": "I/Q"}, {"Q": {"value": 2.9, "unit": "A h"}}, {"I": "A"})
    assert "expected 1/s (a factor of 0.0002778)" in check_units(cell)[0]


def test_a_number_in_front_of_another_kind_is_no_gravity():
    (said,) = check_units(one_state("-a*sqrt(2*9.81*x)/x", a="m/s"))
    assert "-4.429*a" in said
    assert "define a constant such as 9.81 m/s^2 as a fixed parameter" in said


def one_state(rate, unit="m", **parameters):
    values = {name: {"value": 1.0, "unit": unit} for name, unit in parameters.items()}
    return PhysicsModel({"x": unit}, {"x": rate}, values)


@pytest.mark.parametrize(
    ("model", "fits"),
    [
        (one_state("-x/T", T="s"), True),
        (one_state("-x/T", T="ms"), False),
        (one_state("-1000*x/T", T="ms"), True),
        (one_state("a*sin(w*t)", a="m/s", w="rad/s"), True),
        (one_state("a*sin(t)", a="m/s"), False),
        (one_state("a*sin(p)", a="m/s", p="deg"), False),
        (one_state("a*sin(p*pi/180)", a="m/s", p="deg"), True),
        (one_state("-k*sqrt(x)", k="m^0.5/s"), True),
        (one_state("-k*sqrt(x)", k="m/s"), False),
        (one_state("min(a, b)", a="m/s", b="m"), False),
        (one_state("a*max(x, 0)/b", a="m/s", b="m"), True),
        (one_state("a*exp(-x/b)", a="m/s", b="m"), True),
        (one_state("a*exp(-x)", a="m/s"), False),
        (one_state("a*(1 - x/b)", a="m/s", b="m"), True),
        (one_state("a*(1 - x)", a="m/s"), False),
        (one_state("a*tanh(x/b)**2", a="m/s", b="m"), True),
        (one_state("-k*sqrt(max(b - x, 0.01))", k="m^0.5/s", b="m"), True),
        (one_state("-k*sqrt(abs(b - x) + 1)", k="m^0.5/s", b="m"), True),
        (one_state("-k*sqrt(max(b - x, 0.01))", k="m/s", b="m"), False),
    ],
)
def test_functions_powers_and_bounds_are_looked_into(model, fits):
    assert (check_units(model) == ()) == fits


def test_a_model_file_that_does_not_fit_is_warned_of_with_its_line(tmp_path):
    path = tmp_path / "cart.yaml"
    cart(d="N/m").to_yaml(path)
    with pytest.warns(UnitWarning, match=r"cart.yaml:\d+:\d+: equations.v: the term -d\*v is in"):
        model = PhysicsModel.from_yaml(path)
    assert model == cart(d="N/m")
    cart().to_yaml(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        PhysicsModel.from_yaml(path)


def test_a_number_that_converts_a_sum_is_seen_as_one():
    cell = PhysicsModel(
        {"v": "V"}, {"v": "-v"}, {"E": {"value": 3.0, "unit": "V"}},
        outputs={"converted": "1000*(E - v)", "half": "E - 0.5*v", "bare": "E - v"},
    )  # fmt: skip
    assert output_measure(cell, "converted") is None
    assert output_measure(cell, "half") == output_measure(cell, "bare") == read_unit("V")
