"""A functional mock-up unit is a prior like the model that it was made from."""

import json
import pickle
import shutil
import subprocess
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pandas as pd
import pytest
import sympy
from click.testing import CliRunner

from sklearn_pgnn import ModelDiagnosis, effects, systems
from sklearn_pgnn.cli import main
from sklearn_pgnn.exceptions import ModelError, SimulationWarning
from sklearn_pgnn.export import to_fmu
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.priors import from_fmu

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc here")
CART = systems.cart_on_spring()
NAMES = {"state.x": "x", "state.v": "v"}
T = np.arange(0, 4, 0.02)
U = np.sin(3 * T)


@pytest.fixture(params=[2, 3], ids=["FMI 2", "FMI 3"])
def path(request, tmp_path):
    return to_fmu(CART, tmp_path / "cart.fmu", 0.02, fmi=request.param)


def test_it_simulates_as_the_model_that_it_was_made_from(path):
    unit = from_fmu(path, names=NAMES)
    assert (dict(unit.inputs), dict(unit.states)) == (dict(CART.inputs), dict(CART.states))
    assert {n: (p.value, p.unit) for n, p in unit.parameters.items()} == {
        n: (p.value, p.unit) for n, p in CART.parameters.items()
    }
    assert unit.kinematic_pairs == CART.kinematic_pairs
    wrt = tuple(CART.parameters)
    for changed in ({}, {"k": 30.0}):
        one, other = (
            model.with_parameters(**changed).simulate(T, U, [0.1, 0.0], wrt=wrt)
            for model in (unit, CART)
        )
        np.testing.assert_allclose(one.y, other.y, atol=1e-9)
        np.testing.assert_allclose(one.sensitivities, other.sensitivities, rtol=1e-5, atol=1e-8)


def test_only_the_parameters_that_are_named_are_some(path):
    unit = from_fmu(path, {"k": {"spread": 0.3}}, names=NAMES | {"k": "stiffness"})
    assert list(unit.parameters) == ["stiffness"]
    assert unit.parameters["stiffness"].spread == 0.3


@pytest.mark.slow
def test_a_fixed_parameter_starts_it_anew(path, tmp_path):
    fixed = _with(path, tmp_path, 'variability="tunable"', 'variability="fixed"')
    assert not from_fmu(fixed).parameters
    unit = from_fmu(fixed, ["m", "k"], names=NAMES)
    one, other = (m.with_parameters(m=3.0).simulate(T, U) for m in (unit, CART))
    np.testing.assert_allclose(one.y, other.y, atol=1e-9)


def test_it_is_a_value(path):
    unit = from_fmu(path)
    path.unlink()
    again = pickle.loads(pickle.dumps(unit))
    assert again == unit
    np.testing.assert_array_equal(again.simulate(T, U).y, unit.simulate(T, U).y)


@pytest.mark.slow
def test_a_diagnosis_names_what_it_lacks(tmp_path):
    path = to_fmu(CART, tmp_path / "cart.fmu", 0.02)
    unit = from_fmu(path, ["k"], names=NAMES, inertia={"v": 2.0})
    rng = np.random.default_rng(0)
    truth = CART + effects.CoulombFriction("v", 1.0)
    rows = []
    for k in range(2):
        t, u = T[:100], np.repeat(rng.uniform(-6, 6, 10), 10)
        y = truth.simulate(t, u).y[:, 0] + rng.normal(scale=1e-4, size=t.size)
        rows.append(pd.DataFrame({"trajectory": k, "t": t, "force": u, "y": y}))
    table = pd.concat(rows)
    diagnosis = ModelDiagnosis(unit, catalogue=["coulomb_friction", "input_bias"], n_jobs=2).fit(
        table[["trajectory", "t", "force"]], table[["y"]].set_axis(list(CART.outputs), axis=1)
    )
    assert [cause.effect for cause in diagnosis.causes_] == ["coulomb_friction"]


def _with(path, folder, old, new):
    """Return a copy of a unit whose description says something else."""
    changed = folder / "changed.fmu"
    with zipfile.ZipFile(path) as archive, zipfile.ZipFile(changed, "w") as other:
        for name in archive.namelist():
            data = archive.read(name)
            if name == "modelDescription.xml":
                assert old.encode() in data
                data = data.replace(old.encode(), new.encode())
            other.writestr(name, data)
    return changed


def test_co_simulation_only_is_refused(tmp_path):
    late = CART + effects.InputDelay("force", 0.05)
    with pytest.raises(ModelError, match=r"co-simulation only.*Remedy: export the model for model"):
        from_fmu(to_fmu(late, tmp_path / "late.fmu", 0.02))


def test_a_unit_without_a_binary_is_refused(tmp_path):
    with pytest.raises(ModelError, match=r"expected a binary for .*, got none. Remedy"):
        from_fmu(to_fmu(CART, tmp_path / "cart.fmu", 0.02, compiler=None))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"parameters": ["mass"]}, "parameters: expected names among m, k, d, got 'mass'"),
        ({"inputs": ["k"]}, "inputs: expected names among force, got 'k'"),
        ({"names": {"x": "y", "place": "z"}}, "names: the FMU has no variable"),
    ],
)
def test_what_the_unit_lacks_is_named(given, said, path):
    with pytest.raises(ModelError, match=said):
        from_fmu(path, **given)


def test_what_is_no_unit_is_refused(tmp_path):
    (tmp_path / "a.fmu").write_text("no archive")
    with pytest.raises(ModelError, match=r"expected a functional mock-up unit \(FMU\), got"):
        from_fmu(tmp_path / "a.fmu")


def test_the_commands_take_one_in_place_of_a_model_file(path, tmp_path):
    run = CART.simulate(T, U)
    rows = pd.DataFrame({"t": T, "force": U} | dict(zip(CART.outputs, run.y.T, strict=True)))
    rows.to_csv(tmp_path / "run.csv", index=False)
    given = ["check", "--json", "--model", str(path), str(tmp_path / "run.csv")]
    found = CliRunner().invoke(main, given)
    assert found.exit_code == 0, found.output
    assert json.loads(found.stdout)["model"] == CART.name


FLAG = """static int is_high;
static void observe(instance *it)
{
"""
EVENT = "    is_high = ((instance *)it)->machine.x[0] > 0;\n    *info = nothing;\n"
HIGH = {
    "static void observe(instance *it)\n{\n": FLAG,
    "it->rate);\n    if (it->exchanged)": "it->rate);\n    it->rate[1] += is_high;\n"
    "    if (it->exchanged)",
    "    *info = nothing;\n": EVENT,
}
LASTS = {"machine.x[0] > 0;": "machine.x[0] > (is_high ? -2.0 : 2.0);"}
JUMPS = {"    *info = nothing;\n": "    *info = nothing;\n    info->values = 1;\n"}
FAILS = {"    observe(it);\n    memcpy(rates": "    if (((instance *)it)->machine.x[0] > 0.5)\n"
         "        return FAILED;\n    observe(it);\n    memcpy(rates"}  # fmt: skip


def _rebuilt(folder, *changes, events=1):
    """Return a unit of the cart by FMI 2 whose source says something else."""
    path = to_fmu(CART, folder / "source.fmu", 0.02, compiler=None)
    if events:
        old = "variableNamingConvention"
        path = _with(path, folder, old, f'numberOfEventIndicators="{events}" {old}')
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder / "unit")
    source = folder / "unit" / "sources" / "fmu.c"
    text = source.read_text()
    for change in changes:
        for old, new in change.items():
            assert old in text
            text = text.replace(old, new)
    source.write_text(text)
    built = folder / "unit" / "binaries" / "linux64"
    built.mkdir(parents=True)
    command = ["gcc", "-O1", "-shared", "-fPIC", source, "-o", built / "cart_on_a_spring.so", "-lm"]
    subprocess.run(command, check=True)
    return Path(shutil.make_archive(folder / "rebuilt", "zip", folder / "unit")).rename(
        folder / "rebuilt.fmu"
    )


def test_a_condition_is_settled_at_every_point(tmp_path):
    unit = from_fmu(_rebuilt(tmp_path, HIGH), names=NAMES)
    v = CART.equations["v"] + (1 + sympy.sign(symbol("x"))) / 2
    expected = CART.replace(equations={**CART.equations, "v": v})
    for start in ([0.4, 0.0], [-0.4, 0.0]):  # and not so long that it meets the jump
        one, other = (model.simulate(T[:12], U[:12], start) for model in (unit, expected))
        np.testing.assert_allclose(one.y, other.y, atol=1e-9)


def test_a_unit_that_remembers_is_refused(tmp_path):
    with pytest.raises(ModelError, match="expected a function that returns the same values"):
        from_fmu(_rebuilt(tmp_path, HIGH, LASTS))


@pytest.mark.parametrize("where", ["1", "((instance *)it)->machine.x[0] < -1"])
def test_a_unit_that_sets_its_states_anew_is_refused(where, tmp_path):
    with pytest.raises(ModelError, match="resets its states at"):
        from_fmu(_rebuilt(tmp_path, JUMPS, {"info->values = 1": f"info->values = {where}"}))


def test_a_state_that_events_may_set_is_refused(path, tmp_path):
    is_fmi2 = fmpy.read_model_description(str(path)).fmiVersion == "2.0"
    old = '<Real start="0.0" unit="m/s"' if is_fmi2 else 'name="state.v"'
    changed = _with(path, tmp_path, old, f'{old} reinit="true"')
    with pytest.raises(ModelError, match=r"'state.v' is a clock or changes at events.*Remedy"):
        from_fmu(changed)


@pytest.mark.slow
def test_where_a_unit_fails_it_is_no_number_and_goes_on_elsewhere(tmp_path):
    unit = from_fmu(_rebuilt(tmp_path, FAILS, events=0), names=NAMES)
    with pytest.warns(SimulationWarning, match="fmi2GetDerivatives failed with status 3"):
        unit.simulate(T, U, [0.6, 0.0])
    one, other = (model.simulate(T, U, [0.1, 0.0]) for model in (unit, CART))
    np.testing.assert_allclose(one.y, other.y, atol=1e-9)
