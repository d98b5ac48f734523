"""Detectability: the sizes it states are those at which the diagnosis finds or misses."""

import sys
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

import sklearn_pgnn.experiment_design.detectability as detectability_module
from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects
from sklearn_pgnn.estimation.autocorrelation import autocorrelation_times
from sklearn_pgnn.estimation.criterion import SelectionCriterion, log_likelihood_ratio
from sklearn_pgnn.experiment_design.detectability import inject
from sklearn_pgnn.experiment_design.power import Noise, PowerAnalysis, strength_along
from sklearn_pgnn.inspection import DetectabilityDisplay
from sklearn_pgnn.inspection.numbers import least_size

TRIED = (effects.CoulombFriction, effects.InputDeadZone, effects.InputDelay)


def cart():
    return PhysicsModel(
        {"x": "m", "v": "m/s"},
        {"x": "v", "v": "(b*F - k*x - d*v)/m"},
        {
            "m": {"value": 2.0, "unit": "kg"},
            "d": {"value": 1.0, "unit": "N s/m"},
            "k": {"value": 10.0, "unit": "N/m"},
            "b": {"value": 1.0, "fixed": True},
        },
        {"F": "N"},
        {"position": "x"},
        inertia={"v": "m"},
    )


def records(noise=2e-3, seed=0):
    rng, t = np.random.default_rng(seed), np.arange(0, 8, 0.02)
    tables = []
    for record in range(4):
        u = 4 * np.sin((1.3 + 0.4 * record) * t) + 3 * np.sin((3.1 + record) * t) + 2 * (t % 3 > 2)
        x = cart().simulate(t, u, substeps=4).y[:, 0] + noise * rng.standard_normal(t.size)
        tables.append(pd.DataFrame({"trajectory": record, "t": t, "F": u, "position": x}))
    return pd.concat(tables, ignore_index=True)


@pytest.fixture(scope="module")
def diagnosis():
    table = records()
    fitted = ModelDiagnosis(cart(), catalogue=TRIED)
    return fitted.fit(table[["trajectory", "t", "F"]], table["position"])


@pytest.fixture(scope="module")
def detectability(diagnosis):
    return diagnosis.detectability(TRIED)


def bench(diagnosis, seed=0):
    return PowerAnalysis(diagnosis.records_, False, SelectionCriterion(0.01, 0.05, 20), 100, seed)


@pytest.mark.slow
def test_an_output_that_is_measured_more_rarely_shows_effects_too():
    table = records()
    y = table["position"].where(np.arange(len(table)) % 2 == 0)
    rare = ModelDiagnosis(cart(), catalogue=TRIED).fit(table[["trajectory", "t", "F"]], y)
    white = bench(rare)._white_part
    assert 0.8 < white[0] <= 1.0
    (row,) = rare.detectability([effects.CoulombFriction], n_repeats=50).rows
    assert not row.reason
    assert np.isfinite(row.smallest)


def of_main_size(diagnosis, kind, target, value):
    """Return an effect whose main quantity has a value, the others in step."""
    model, scales = diagnosis.extended_model_, diagnosis.records_.problem.scales
    of_size, field = kind.of_size(target, model, scales), kind.size_field()
    effects_ = [of_size(size) for size in np.geomspace(1e-6, 1.0, 2001)]
    nearest = min(effects_, key=lambda effect: abs(getattr(effect, field) - value))
    return replace(nearest, **{field: value})


def named(diagnosis, kind, target, value, seed):
    """Put an effect of some size into the machine and diagnose it anew."""
    effect = of_main_size(diagnosis, kind, target, value)
    X, y = inject(bench(diagnosis), effect, seed)
    found = ModelDiagnosis(diagnosis.extended_model_, catalogue=TRIED).fit(X, y)
    return [(cause.effect, cause.target) for cause in found.causes_]


@pytest.mark.slow
@pytest.mark.parametrize("kind", TRIED)
def test_the_diagnosis_finds_twice_the_smallest_size_and_misses_a_quarter(
    kind, diagnosis, detectability
):
    (row,) = [row for row in detectability.rows if row.effect == kind.id]
    for seed in (1, 2):
        found = named(diagnosis, kind, row.target, 2 * row.smallest, seed)
        assert found == [(row.effect, row.target)]
        assert named(diagnosis, kind, row.target, row.smallest / 4, seed) == []


@pytest.mark.slow
def test_the_table_has_a_row_an_effect_with_its_unit(detectability):
    table = detectability.to_frame().set_index("effect")
    assert table.index.tolist() == [kind.id for kind in TRIED]
    assert table["unit"].tolist() == ["N", "N", "s"]
    assert (table["smallest"] > 0).all()
    assert table["reason"].tolist() == ["", "", ""]
    powers = table[[f"power at {size}x" for size in ("0.25", "0.5", "1", "2")]].to_numpy()
    assert (np.diff(powers, axis=1) >= 0).all()
    assert (powers[:, 2] >= 0.85).all()
    assert (powers[:, 0] < 0.1).all()


@pytest.mark.slow
def test_more_noise_makes_every_smallest_size_larger(detectability):
    table = records(noise=1e-2)
    noisy = ModelDiagnosis(cart(), catalogue=()).fit(
        table[["trajectory", "t", "F"]], table["position"]
    )
    rows = noisy.detectability(TRIED).rows
    for quiet, loud in zip(detectability.rows, rows, strict=True):
        assert 2 < loud.smallest / quiet.smallest < 8


@pytest.mark.slow
def test_what_can_never_be_seen_comes_with_its_reason(diagnosis):
    seen = diagnosis.detectability((effects.InputSaturation, effects.ViscousFriction), ["F"])
    (saturation,) = seen.rows
    assert saturation.smallest < diagnosis.records_.problem.scales.peak["F"]
    wide = cart().with_parameters(d=cart().parameters["d"].with_spread(5.0))
    table = records()
    free = ModelDiagnosis(wide, catalogue=()).fit(
        table[["trajectory", "t", "F"]], table["position"]
    )
    (row,) = free.detectability((effects.WrongParameter,), ["d"]).rows
    assert np.isnan(row.smallest)
    assert "lies within the parameter's spread" in row.reason


def test_what_re_tuning_imitates_is_said_to_be_imitated():
    free = cart().with_parameters(**{
        name: cart().parameters[name].with_spread(5.0) for name in ("m", "d", "k")
    })  # fmt: skip
    table = records()
    fitted = ModelDiagnosis(free, catalogue=()).fit(
        table[["trajectory", "t", "F"]], table["position"]
    )
    (row,) = fitted.detectability((effects.SensorGain,)).rows
    assert np.isnan(row.smallest)
    assert "is imitated by re-tuning" in row.reason
    assert {"m", "d", "k"} & set(row.reason.split())


def test_an_effect_the_inputs_never_bring_to_act_is_said_so():
    table = records()
    table["F2"] = 0.0
    two = cart().replace(
        inputs={"F": "N", "F2": "N"}, equations={"x": "v", "v": "(b*F + F2 - k*x - d*v)/m"}
    )
    fitted = ModelDiagnosis(two, catalogue=()).fit(
        table[["trajectory", "t", "F", "F2"]], table["position"]
    )
    (row,) = fitted.detectability((effects.InputDelay,), ["F2"]).rows
    assert "hardly changes the outputs" in row.reason


def test_a_memory_is_found_by_its_size_and_not_by_being_there(diagnosis):
    """Play without width is a lag of a sample, which these records show."""
    (row,) = diagnosis.detectability((effects.InputBacklash,), ["F"]).rows
    assert row.smallest > 1e-3 * diagnosis.records_.problem.scales.typical["F"]
    assert row.curve[1][1] < 0.1


@pytest.mark.filterwarnings("error")
def test_a_parameter_that_is_zero_has_a_size_too():
    zero = cart().replace(
        equations={"x": "v", "v": "(b*F - k*x - d*v - c*x**3)/m"},
        parameters={**cart().parameters, "c": {"value": 0.0, "unit": "N/m^3"}},
    )
    table = records()
    fitted = ModelDiagnosis(zero, catalogue=()).fit(
        table[["trajectory", "t", "F"]], table["position"]
    )
    table = fitted.detectability((effects.WrongParameter,), ["c"])
    (row,) = table.rows
    assert 0 < row.smallest <= 1.0
    assert table.to_frame().loc[0, "power at 1x"] >= 0.9


@pytest.mark.slow
def test_verify_runs_the_diagnosis_itself(diagnosis):
    rows = diagnosis.detectability((effects.InputDelay,), verify=True, power=0.95).rows
    assert [row.found for row in rows] == [True]


def test_noise_along_a_signal_is_that_of_a_long_simulation():
    rng = np.random.default_rng(0)
    white = rng.standard_normal(200_000)
    coloured = (white + np.roll(white, 1)) / np.sqrt(2)
    signal = np.sin(0.05 * np.arange(1000))
    along = coloured.reshape(200, 1000) @ signal / np.sqrt(np.sum(signal**2))
    padded = np.pad(signal, (0, coloured.size - signal.size))
    assert strength_along(coloured, padded, 2.0) == pytest.approx(np.var(along), rel=0.25)
    assert strength_along(white, padded, 1.0) == pytest.approx(1.0, rel=0.15)


def test_a_signal_in_noise_has_the_autocorrelation_time_of_both_together():
    rng, segment = np.random.default_rng(0), np.repeat(np.arange(200), 500)
    noise = rng.standard_normal((100_000, 1))
    signal = np.repeat(rng.standard_normal(2_000), 50)[:, None]
    found = Noise.of(noise, segment, 0.0, white=False)
    size, times = np.linalg.norm(signal, axis=0), autocorrelation_times(signal, segment)
    ((before, after),) = found.draws(size, times, found.power, rng, 1)
    (expected,) = autocorrelation_times(noise + signal, segment)
    assert before.times == pytest.approx(expected, rel=0.1)
    assert after.times == pytest.approx(1.0, rel=0.1)


def test_likelihood_ratios_are_those_of_the_draws():
    noise = Noise(np.array([1.0, 0.0, 2.0]), np.array([50.0, 20.0, 0.0]), np.array([3.0, 1.0, 1.0]))
    signal = np.array([4.0, 0.0, 1.0]), np.array([9.0, 1.0, 1.0]), noise.power
    found = noise.likelihood_ratios(*signal, np.random.default_rng(0), 7)
    pairs = noise.draws(*signal, np.random.default_rng(0), 7)
    np.testing.assert_allclose(found, [log_likelihood_ratio(*pair) for pair in pairs])
    assert np.ptp(found) > 0


@pytest.mark.parametrize(
    "kind", [kind for kind in effects.CATALOGUE if kind.targets(cart()) and kind.size_field()]
)
def test_every_effect_of_the_catalogue_grows_with_its_size(kind, diagnosis):
    model, scales = cart(), diagnosis.records_.problem.scales
    target = kind.targets(model)[0]
    of_size, none = kind.of_size(target, model, scales), kind.nothing(target, model, scales)
    values = [abs(getattr(of_size(s), kind.size_field()) - none) for s in (0.1, 0.3, 1.0)]
    assert 0 < values[0] < values[1] <= values[2]


def test_the_picture_names_every_effect_and_its_size(detectability):
    display = detectability.plot()
    assert isinstance(display, DetectabilityDisplay)
    labels = [label.get_text() for label in display.axes_.get_yticklabels()]
    assert labels == ["Coulomb friction on v", "input dead zone of F", "input delay of F"]
    texts = [text.get_text() for text in display.axes_.texts]
    assert texts[0].startswith("level ")
    assert texts[0].endswith(" N")
    assert display.figure_ is plt.gcf()
    plt.close(display.figure_)


def test_unusable_options_are_refused(diagnosis):
    with pytest.raises(ValueError, match=r"power: expected a number between 0 and 1, got 90"):
        diagnosis.detectability(power=90)
    with pytest.raises(ValueError, match=r"noise: expected 'residual' or 'white', got 'pink'"):
        diagnosis.detectability(noise="pink")


def test_joblib_sees_that_an_analysis_holds_records(diagnosis):
    records = diagnosis.records_
    analysis = PowerAnalysis(records, True, SelectionCriterion(0.01, 0.05, 3), 20, 0)
    assert sys.getsizeof(analysis) > records.windows.t.nbytes + records.windows.y.nbytes
    sizeof = pytest.importorskip("dask.sizeof").sizeof
    assert sizeof(analysis) > 1e3  # what joblib sends to a cluster once is larger


@pytest.mark.parametrize(("powers", "told", "is_least"), [
    ({1.0: 1.0, 0.1: 1.0, 0.01: 1.0}, True, True),
    ({1.0: 1.0, 0.1: 1.0, 0.01: 0.2}, True, False),
    ({1.0: 0.3, 0.1: 0.1, 0.01: 0.0}, False, False),
])  # fmt: skip
def test_of_sizes_below_the_smallest_tried_nothing_is_said(diagnosis, powers, told, is_least):
    cause = effects.CoulombFriction("v")
    analysis = PowerAnalysis(diagnosis.records_, True, SelectionCriterion(0.01, 0.05, 1), 10, 0)
    row = detectability_module._Sizes(analysis, cause).described(powers, 0.9)
    assert (row.smallest > 0) == told
    assert row.is_least_tried == is_least
    assert "however small" not in row.reason
    assert ("smallest tried" in least_size(row)) == is_least
