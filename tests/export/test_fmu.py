"""Functional mock-up units pass validation, and run as the simulation does."""

import shutil
import zipfile

import fmpy
import numpy as np
import pytest
from c_program import compile_c
from fmpy.validation import validate_fmu

from sklearn_pgnn import effects, systems
from sklearn_pgnn.exceptions import ModelError, OptionError
from sklearn_pgnn.export import to_fmu

STEP, SAMPLES = 1 / 64, 2000
CART = systems.cart_on_spring()
ROBOT = systems.golf_robot() + effects.StribeckFriction("omega", 0.1, 0.1, 0.3)
DELAY = effects.InputDelay("force", 0.05)
T = np.arange(SAMPLES) * STEP
U = 0.3 * np.sin(0.7 * T) + 0.1 * np.sin(3.1 * T)
gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc here")


def run(path, model, **start):
    """Run a unit along the input with FMPy, sample by sample; return its output."""
    (name,) = model.inputs
    inputs = np.array(list(zip(T, U, strict=True)), dtype=[("time", float), (name, float)])
    found = fmpy.simulate_fmu(
        path, stop_time=T[-1], output_interval=STEP, input=inputs, start_values=start,
        fmi_type="CoSimulation", output=list(model.outputs),
    )  # fmt: skip
    return found[next(iter(model.outputs))]


@gcc
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(
    "model",
    [ROBOT, CART, CART + DELAY],
    ids=["robot", "cart", "late"],
)
def test_a_unit_is_valid_and_runs_as_the_simulation(model, fmi, tmp_path):
    path = to_fmu(model, tmp_path / "unit.fmu", STEP, fmi=fmi)
    assert validate_fmu(str(path)) == []
    expected = model.simulate(T, U).y[:, 0]
    # FMPy passes the inputs of a sample before it steps on from there
    assert np.abs(run(str(path), model) - expected).max() < 1e-9


@gcc
@pytest.mark.parametrize("fmi", [2, 3])
def test_parameters_and_initial_states_are_set(fmi, tmp_path):
    path = to_fmu(CART, tmp_path / "cart.fmu", STEP, fmi=fmi)
    found = run(str(path), CART, **{"state.x": 0.1, "k": 20.0})
    expected = CART.with_parameters(k=20.0).simulate(T, U, [0.1, 0.0]).y[:, 0]
    assert np.abs(found - expected).max() < 1e-9


@gcc
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("model", [ROBOT, CART], ids=["robot", "cart"])
def test_the_source_compiles_without_a_warning(model, fmi, tmp_path):
    path = to_fmu(model, tmp_path / "unit.fmu", STEP, fmi=fmi, compiler=None)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path)
        assert not [name for name in archive.namelist() if name.startswith("binaries")]
    text = (tmp_path / "sources" / "fmu.c").read_text()
    compile_c(text, tmp_path / "sources", "again.c")


@gcc
def test_a_state_is_kept_and_restored(tmp_path):
    path = to_fmu(ROBOT, tmp_path / "robot.fmu", STEP)
    description = fmpy.read_model_description(str(path))
    folder = fmpy.extract(str(path), unzipdir=str(tmp_path / "unit"))
    unit = fmpy.instantiate_fmu(folder, description, "CoSimulation")
    number = {v.name: v.valueReference for v in description.modelVariables}
    unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    unit.setReal([number["torque"]], [0.3])
    unit.exitInitializationMode()

    def angle_after(steps):
        unit.doStep(currentCommunicationPoint=0.0, communicationStepSize=steps * STEP)
        return unit.getReal([number["phi_measured"]])[0]

    angle_after(10)
    kept = unit.getFMUstate()
    first = angle_after(20)
    unit.setFMUstate(kept)
    assert angle_after(20) == first
    unit.deSerializeFMUstate(unit.serializeFMUstate(kept), kept)
    unit.freeFMUstate(kept)
    with pytest.raises(fmpy.fmi1.FMICallException):
        unit.doStep(currentCommunicationPoint=0.0, communicationStepSize=0.4 * STEP)
    unit.terminate()
    unit.freeInstance()


@gcc
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_solver_outside_goes_on_with_its_rates(fmi, tmp_path):
    path = to_fmu(CART, tmp_path / "cart.fmu", STEP, fmi=fmi)
    # under a constant force: CVode is not told that a held one jumps
    found = fmpy.simulate_fmu(
        str(path), stop_time=T[-1], output_interval=STEP, relative_tolerance=1e-9,
        start_values={"state.x": 0.1, "k": 20.0, "force": 0.3}, fmi_type="ModelExchange",
        output=list(CART.outputs),
    )  # fmt: skip
    exact = CART.with_parameters(k=20.0).simulate(T, np.full(SAMPLES, 0.3), [0.1, 0.0], substeps=8)
    assert np.abs(found[next(iter(CART.outputs))] - exact.y[:, 0]).max() < 1e-6


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(
    ("model", "exchanges"), [(CART, True), (ROBOT, False), (CART + DELAY, False)]
)
def test_what_sticks_or_is_late_is_for_co_simulation_only(model, exchanges, fmi, tmp_path):
    path = to_fmu(model, tmp_path / "unit.fmu", STEP, fmi=fmi, compiler=None)
    description = fmpy.read_model_description(str(path))
    assert (description.modelExchange is not None) == exchanges
    assert [rate.variable.derivative.name for rate in description.derivatives] == (
        ["state.x", "state.v"] if exchanges else []
    )


def test_the_same_model_gives_the_same_bytes(tmp_path):
    paths = [to_fmu(CART, tmp_path / name, STEP, compiler=None) for name in ("a.fmu", "b.fmu")]
    assert paths[0].read_bytes() == paths[1].read_bytes()


@pytest.mark.parametrize(
    ("options", "error", "what"),
    [
        ({"fmi": 1}, OptionError, "expected 2 or 3"),
        ({"compiler": "no-compiler"}, OptionError, "compiler=None"),
        ({"model": "robot"}, OptionError, "expected a PhysicsModel"),
        ({"model": CART.replace(simulation={"hold": "foh"})}, ModelError, "'zoh'"),
    ],
)
def test_what_it_cannot_be_is_refused(options, error, what, tmp_path):
    with pytest.raises(error, match=what):
        to_fmu(**{"model": CART, "path": tmp_path / "a.fmu", "interval": STEP, **options})
