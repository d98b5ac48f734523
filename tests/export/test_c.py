"""Exported C gives the numbers of the simulation, and compiles without a warning."""

import ctypes

import numpy as np
import pytest
from c_program import compile_c, run_c
from rubbing_machines import cart_pendulum, stacked_blocks, two_link_arm

from sklearn_pgnn import PhysicsModel, effects, systems
from sklearn_pgnn.exceptions import ModelError, OptionError
from sklearn_pgnn.export import to_c
from sklearn_pgnn.physics.dry_friction import dry_friction
from sklearn_pgnn.physics.scales import Scales

pytestmark = pytest.mark.core

#: a binary fraction, so that both clocks have the same instants to the last digit
INTERVAL, SAMPLES = 1 / 128, 100_000
CART = systems.cart_on_spring()
GOLF = systems.golf_robot() + effects.StribeckFriction("omega", 0.1, 0.1, 0.3)
TANKS = systems.two_tanks() + effects.Overflow("x1", limit=7.0, steepness=1.0, share=0.6)
SHAFT = PhysicsModel(
    {"a": "rad", "b": "rad", "v": "rad/s", "w": "rad/s"},
    {"a": "v", "b": "w", "v": "(u - k*(a - b))/J", "w": "k*(a - b)/J"},
    {"J": 0.01, "k": 3.0},
    {"u": "N m"},
)
OVEN = PhysicsModel({"T": "K"}, {"T": "P/C"}, {"C": 80.0}, {"P": "W", "T_room": "K"})
HOUSE = PhysicsModel(
    {"T": "K"}, {"T": "(P + h*(To - T))/C"}, {"C": 80.0, "h": 2.0}, {"P": "W", "To": "K"}
)
CELL = PhysicsModel({"z": ""}, {"z": "I/Q"}, {"Q": 9.0, "R": 0.1}, {"I": "A"}, {"V": "z + R*I"})
CLOCK = PhysicsModel(
    {"x": "m"},
    {"x": "abs(sin(w*t))**1.5*sign(sin(w*t)) - x - floor(3*x)/9 + atan2(x, 2)/4 + t/(1 + t**5)"},
    {"w": 0.3},
    outputs={"seen": "exp(-x**2) + ceil(x)*pi"},
    initial_state={"x": 0.5},
    name="2nd",
)


def wave(n, size, offset=0.0):
    t = np.arange(n) * INTERVAL
    return t, offset + size * (np.sin(0.7 * t) + 0.5 * np.sin(3.1 * t))


def both(model, folder, size=1.0, offset=0.0, n=5000, **options):
    """Run a model by the package and as C; return the states and outputs of either."""
    t, u = wave(n, size, offset)
    u = np.column_stack([u * (1 + i) for i in range(len(model.inputs))]) if model.inputs else None
    written = {key: options.pop(key) for key in ("precision", "parameters") if key in options}
    text = to_c(model, INTERVAL, name="machine", **written, **options)
    hold, precision = options.get("hold", "zoh"), written.get("precision", "double")
    by_struct = written.get("parameters") == "struct"
    X, Y = run_c(
        text, folder, "machine", model, u, n=n, hold=hold, precision=precision, by_struct=by_struct
    )
    run = model.simulate(t, u, **{"method": "rk4", **options})
    return (X, Y), (run.x, run.y)


def agree(found, expected, size=1e-12):
    pairs = zip(found, expected, strict=True)
    return all(np.abs(a - b).max() <= size * max(1.0, np.abs(b).max()) for a, b in pairs)


@pytest.mark.parametrize(
    ("model", "size", "offset"), [(GOLF, 0.2, 0.0), (TANKS, 1.0, 3.0)], ids=["robot", "tanks"]
)
def test_c_gives_the_numbers_of_the_simulation_over_a_hundred_thousand_steps(
    model, size, offset, tmp_path
):
    assert agree(*both(model, tmp_path, size, offset, n=SAMPLES))


def test_friction_that_sticks_does_so_in_c(tmp_path):
    (X, _), (x, _) = both(CART + effects.CoulombFriction("v", 3.0), tmp_path, 4.0)
    assert np.array_equal(X[:, 1] == 0, x[:, 1] == 0)
    assert 0.05 < np.mean(X[:, 1] == 0) < 0.95


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize(
    ("model", "size"),
    [
        (cart_pendulum(Fc=2.0, Fp=0.4), 3.0),
        (stacked_blocks(F=2.0, G=1.5), 3.0),
        (two_link_arm(F1=7.0, F2=2.0), 1.5),
    ],
    ids=lambda each: getattr(each, "name", ""),
)
def test_frictions_that_act_on_each_other_stick_in_c(model, size, hold, tmp_path):
    rates = model.equations
    model = model.replace(outputs={f"rate_of_{v}": rates[v] for v in list(model.states)[-2:]})
    found, expected = both(model, tmp_path, size, n=1500, hold=hold, substeps=2)
    assert agree(found, expected, 1e-9)
    flows = expected[0] @ np.array(dry_friction(model).rows).T
    at_rest = (np.abs(flows) < 1e-12).mean(axis=0)
    assert np.all((at_rest > 0.01) & (at_rest < 0.99))


@pytest.mark.parametrize("kind", effects.CATALOGUE, ids=lambda kind: kind.id)
def test_every_effect_of_the_catalogue_is_in_the_c(kind, tmp_path):
    machines = (CART, systems.two_tanks(), systems.golf_robot(), OVEN, SHAFT, HOUSE, CELL)
    model = next(machine for machine in machines if kind.targets(machine))
    target = kind.targets(model)[0]
    effect = (*kind.starts(target, model, scales_of(model)), kind(target))[0]
    assert agree(*both(model + effect, tmp_path, 0.3, 1.0, n=2000))


def scales_of(model):
    """Return how large the signals of a model are that is driven by the wave."""
    t, u = wave(2000, 0.3, 1.0)
    run = model.simulate(t, np.tile(u[:, None], len(model.inputs)))
    signals = dict.fromkeys(model.inputs, u)
    signals |= dict(zip((*model.states, *model.outputs), (*run.x.T, *run.y.T), strict=True))
    typical = {name: float(np.std(values)) for name, values in signals.items()}
    peak = {name: float(np.abs(values).max()) for name, values in signals.items()}
    rate = {name: float(np.std(np.gradient(signals[name], t))) for name in model.states}
    return Scales(typical, peak, rate, INTERVAL, 2.0)


@pytest.mark.parametrize(
    "effect",
    [
        effects.Hysteresis("v", level=3.0, deflection=0.01),
        effects.LoadFriction("v", 1.0, 0.2),
        effects.AsymmetricFriction("v", 1.0, 2.0),
        effects.InputDelay("force", delay=0.033),
        effects.InputDelay("force", delay=0.004),
        effects.InputDelay("force", delay=2 * INTERVAL),
        effects.InputDeadZone("force", 0.3),
        effects.InputSaturation("force", 1.0),
        effects.InputBacklash("force", 0.6, 0.02),
        effects.InputRateLimit("force", 3.0, 0.02),
        effects.ActuatorLag("force", 0.05),
        effects.SensorRectification("position"),
    ],
    ids=lambda effect: effect.id,
)
def test_effects_act_on_inputs_that_run_straight(effect, tmp_path):
    assert agree(*both(CART + effect, tmp_path, 2.0, hold="foh"))


@pytest.mark.parametrize(
    "options",
    [
        {"method": "euler"},
        {"substeps": 3},
        {"substeps": 4, "hold": "foh"},
        {"parameters": "struct"},
    ],
    ids=str,
)
def test_options_mean_in_c_what_they_mean_in_python(options, tmp_path):
    assert agree(*both(GOLF, tmp_path, 0.2, **options))


def test_a_model_of_the_time_and_of_no_input(tmp_path):
    assert agree(*both(CLOCK, tmp_path))


def test_every_output_that_depends_on_the_direction_and_late_inputs(tmp_path):
    model = CART.replace(
        inputs={"force": "N", "push": "N"},
        equations={"x": "v", "v": "(-k*x - d*v + force - 2*sign(v) + push)/m"},
        parameters={**CART.parameters, "tau": 0.05},
        outputs={"side": "sign(v)*2 + push", "x": "x"},
        delays={"push": "tau"},
        inertia={},
        energy={},
    )
    for parameters in ("constants", "struct"):
        assert agree(*both(model, tmp_path, 1.0, parameters=parameters, hold="foh"))


@pytest.mark.parametrize(("model", "size", "error"), [(GOLF, 0.2, 1e-4), (TANKS, 1.0, 1e-4)])
def test_single_precision_is_near(model, size, error, tmp_path):
    found = both(model, tmp_path, size, 3.0 if model is TANKS else 0.0, precision="single")
    assert agree(*found, size=error)
    assert not agree(*found)


def test_a_parameter_is_changed_while_the_program_runs(tmp_path):
    text = (
        to_c(CART, INTERVAL, name="cart", parameters="struct")
        + """
double after(double m);
double after(double m)
{
    cart_parameters p = cart_nominal;
    cart_machine machine;
    const double u[1] = {1.0};
    double y[1];
    int k;
    p.m = m;
    cart_start(&machine, u);
    for (k = 0; k < 100; k++)
        cart_step(&machine, &p, u);
    cart_output(&machine, &p, u, y);
    return y[cart_y_position];
}
"""
    )
    library = ctypes.CDLL(str(compile_c(text, tmp_path)))
    library.after.restype, library.after.argtypes = ctypes.c_double, [ctypes.c_double]
    run = CART.with_parameters(m=3.0).simulate(np.arange(101) * INTERVAL, np.ones(101))
    assert library.after(3.0) == pytest.approx(run.y[-1, 0], rel=1e-12)


def test_names_that_c_does_not_know_are_written_otherwise(tmp_path):
    model = PhysicsModel(
        {"x": "m*/", "double": "??/", "μ": "°"},
        {"x": "pow - c0", "double": "-double*u03bc**17", "μ": "out - μ*c0"},
        {"c0": 0.5, "pow": 1.0, "u03bc": 0.9},
        {"out": "a\nb"},
        name="a */ b",
        outputs={"x": "x", "out": "out", "y": "min(x, double, 3)"},
    )
    assert agree(*both(model, tmp_path))


def test_two_files_share_the_declarations_only(tmp_path):
    text = to_c(CART, INTERVAL, name="cart")
    (tmp_path / "cart.c").write_text(text)
    user = '#define CART_DECLARATIONS\n#include "cart.c"\n' + (
        "void use(cart_machine *cart, const double *u);\n"
        "void use(cart_machine *cart, const double *u)\n{\n    cart_step(cart, u);\n}\n"
    )
    compile_c(user, tmp_path, "user.c")


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"interval": 0}, "interval: expected the sample interval in seconds, .* got 0"),
        ({"interval": None}, "Remedy"),
        ({"precision": "half"}, "precision: expected one of double, single"),
        ({"parameters": "heap"}, "parameters: expected one of"),
        ({"substeps": 0}, "substeps: expected an integer"),
        ({"substeps": True}, "substeps: expected an integer >= 1, got True"),
        ({"method": "rk5"}, "method: expected one of euler, rk4"),
    ],
)
def test_an_option_that_is_none_is_refused(options, what):
    with pytest.raises(OptionError, match=what):
        to_c(CART, **{"interval": 0.01, **options})


def test_a_number_that_a_float_cannot_hold_is_refused():
    model = CART.replace(initial_state={"x": 1e39})
    with pytest.raises(ModelError, match=r"1e\+39 cannot be held by a float. Remedy"):
        to_c(model, 0.01, precision="single")


def test_what_is_no_model_is_refused():
    with pytest.raises(OptionError, match="expected a PhysicsModel"):
        to_c("robot", 0.01)
