"""An effect that the package does not know: one class brings all that a diagnosis needs."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import sklearn_pgnn
from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects, systems
from sklearn_pgnn.datasets import make_hidden_effect
from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.evidence import find_evidence
from sklearn_pgnn.inspection.words import verdict_sentence
from sklearn_pgnn.physics.characteristic import Characteristic
from sklearn_pgnn.physics.effect import Effect, quantity
from sklearn_pgnn.physics.effects import find_effect
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.simulation.simulate import settled_start

SOURCE = Path(sklearn_pgnn.__file__).parent


@dataclass(frozen=True)
class EddyBrake(Effect):
    """A brake by eddy currents: its force has a peak at some speed and fades beyond it."""

    peak: float = quantity("Fe", "N", low=0.0)
    speed: float = quantity("ve", "m/s", default=1.0, low=1e-6, role="shape")
    id = "eddy_brake"
    phrase = "eddy-current brake at {target}"
    summary = "A conductor moves through a magnetic field."
    check = "Take the magnet away."

    @classmethod
    def targets(cls, model):
        return tuple(name for name, port in model.ports.items() if port.unit == "N")

    def rewrite(self, model, p):
        port = model.port(self.target)
        v = port.flow
        return port.act(model, 2 * p["peak"] * p["speed"] * v / (p["speed"] ** 2 + v**2))

    @classmethod
    def starts(cls, target, model, scales):
        return tuple(cls(target, 0.0, share * scales.typical[target]) for share in (0.1, 0.5))

    @classmethod
    def limits(cls, target, model, scales):
        return {"speed": (0.01 * scales.typical[target], 2.0 * scales.typical[target])}

    def characteristic(self, model):
        return Characteristic("force", self.target, model.port(self.target).flow)


@dataclass(frozen=True)
class Fatigue(Effect):
    """An actuator that follows its command late and tires: two states of its own."""

    time_constant: float = quantity("Tf", "s", default=1.0, low=1e-6)
    id = "fatigue"

    @classmethod
    def targets(cls, model):
        return tuple(model.inputs)

    def rewrite(self, model, p):
        u, acting, strength = map(symbol, (self.target, "acting", "strength"))
        rates = {name: rate.subs(u, acting * strength) for name, rate in model.equations.items()}
        rates |= {"acting": (u - acting) / p["time_constant"], "strength": -strength / 100}
        return {
            "equations": rates,
            "states": {**model.states, "acting": model.inputs[self.target], "strength": ""},
            "settled": {**model.settled, "acting": self.target},
            "initial_state": {**model.initial_state, "strength": 1.0},
        }

    @classmethod
    def starts(cls, target, model, scales):
        return (cls(target, scales.sample_time),)


@pytest.fixture(scope="module")
def brake():
    hidden = make_hidden_effect(
        systems.cart_on_spring(),
        EddyBrake("v", peak=3.0, speed=0.5),
        n_records=4,
        sample_rate=100.0,
        random_state=0,
    )
    others = (effects.CoulombFriction, effects.ViscousFriction, effects.QuadraticDrag)
    catalogue = (*others, effects.InputBias, EddyBrake)
    return ModelDiagnosis(hidden.prior, catalogue=catalogue).fit(hidden.X, hidden.y)


@pytest.mark.slow
def test_it_is_named_with_its_size(brake):
    (cause,) = brake.causes_
    assert (cause.effect, cause.target) == ("eddy_brake", "v")
    assert brake.verdict_ == "cause_named"
    for field, value in {"peak": 3.0, "speed": 0.5}.items():
        assert cause.parameters[field].value == pytest.approx(value, rel=0.05)
    assert cause.check == EddyBrake.check


@pytest.mark.slow
def test_it_has_a_name_for_people_and_its_curve_in_the_report(brake, tmp_path):
    assert "eddy-current brake at v" in verdict_sentence(brake)
    evidence = find_evidence(brake, brake.causes_[0])
    assert "v" in evidence.x_label
    (line,) = evidence.lines
    np.testing.assert_allclose(line.y, 3.0 * line.x / (0.25 + line.x**2), atol=0.2)
    x, force = evidence.points
    error = force - 3.0 * x / (0.25 + x**2)
    assert np.nanmedian(np.abs(error)) < 0.3
    brake.to_html(tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "eddy-current brake at v" in text.lower()
    assert EddyBrake.summary in text


def test_it_is_a_function_of_its_size(brake):
    model, scales = brake.model, brake.records_.problem.scales
    half, whole = map(EddyBrake.of_size("v", model, scales), (0.5, 1.0))
    assert EddyBrake.size_field() == "peak"
    assert EddyBrake.nothing("v", model, scales) == 0.0
    assert whole.peak == pytest.approx(2 * half.peak)
    assert whole.speed == half.speed == EddyBrake.starts("v", model, scales)[1].speed


def test_states_that_an_effect_adds_start_where_it_says_and_no_others():
    lag = PhysicsModel({"F_lagged": "V"}, {"F_lagged": "F - F_lagged"}, {}, {"F": "V"})
    tired = lag + Fatigue("F", time_constant=0.1)
    assert settled_start(tired, [2.0]) == {"F_lagged": 0.0, "acting": 2.0, "strength": 1.0}
    assert find_effect("fatigue").title("F") == "fatigue on F"  # by the words of its id


@pytest.mark.core
def test_an_effect_is_found_by_its_id_wherever_it_is_defined():
    assert find_effect("eddy_brake") is EddyBrake
    assert cause_name("coulomb_friction", "v") == "Coulomb friction on v"
    with pytest.raises(OptionError, match="expected the id of an effect, got 'coulomb'"):
        find_effect("coulomb")


@pytest.mark.core
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("torque", "v"), "shows: expected one of force, rate"),
        (("force", "v"), "over: expected what the force is plotted over, got None"),
        (("rate", "v", symbol("v")), "over: expected None, since a rate is plotted over the rate"),
        (("input", "u", symbol("v")), "over: expected None or the time t, got v"),
        (("parameter", "k", symbol("v")), "law: expected the parameter's value"),
    ],
)
def test_a_curve_that_cannot_be_drawn_is_refused(arguments, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        Characteristic(*arguments)


@pytest.mark.core
def test_a_quantity_has_a_known_role():
    with pytest.raises(ValueError, match="role: expected one of size, shape, end, got 'width'"):
        quantity("w", "m", role="width")


#: files outside of the catalogue that name an effect, and why
NAMED = {
    "estimation/equivalence.py": {"WrongParameter"},  # a parameter that is freed is the model's own
    "estimation/freedoms.py": {"WrongParameter"},
    "estimation/hypothesis.py": {"WrongParameter"},
    "estimation/same_in_equations.py": {"WrongParameter"},
    "diagnosis/moves.py": {"WrongParameter"},
    "diagnosis/unexplained.py": {"Formula"},  # what no cause explains
    "diagnosis/description.py": {"Formula", "WrongParameter"},  # which of its terms have a name
    "diagnosis/investigation.py": {"SensorSaturation"},  # a record shows clipping by itself
    "datasets/hidden_effect.py": {"InputDeadZone"},  # what a rig hides
    "cli/demo.py": {"StribeckFriction"},
    "cli/app/jobs.py": {"CoulombFriction"},  # what the example hides
}


@pytest.mark.core
def test_no_other_file_names_an_effect():
    kinds = "|".join((*(kind.__name__ for kind in effects.CATALOGUE), "Formula"))
    imported = re.compile(r"^from sklearn_pgnn\.physics\.effects\S* import .*$", re.MULTILINE)
    for path in SOURCE.rglob("*.py"):
        place = path.relative_to(SOURCE).as_posix()
        if place.startswith("physics/effects/"):
            continue
        lines = imported.findall(path.read_text(encoding="utf-8"))
        found = {name for line in lines for name in re.findall(rf"\b({kinds})\b", line)}
        assert found <= NAMED.get(place, set()), place
