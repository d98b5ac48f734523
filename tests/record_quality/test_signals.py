"""Checks of single signals and clocks: silent on clean ones, blind to units."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from sklearn_pgnn.record_quality.clock import find_gaps, find_jitter, find_unused_samples
from sklearn_pgnn.record_quality.excitation import find_first_steps
from sklearn_pgnn.record_quality.refits import find_uneven_noise
from sklearn_pgnn.record_quality.sensors import (
    find_clipping,
    find_held_samples,
    find_outliers,
    find_quantisation,
)
from sklearn_pgnn.record_quality.signals import Signal
from sklearn_pgnn.trajectories.grid import grid_step


def signal(*pieces, dt=0.01):
    times = [dt * np.arange(len(piece)) for piece in pieces]
    return Signal("y", "V", [*map(np.asarray, pieces)], times, [*map(str, range(len(pieces)))])


def test_rest_is_no_clipping():
    settled = np.concatenate([np.zeros(50), 1 - np.exp(-np.arange(2000) / 15.0)])
    assert find_clipping(signal(settled)) is None


def test_rest_before_and_after_a_noisy_motion_is_no_clipping():
    """A speed that is counted is zero at rest, without noise."""
    noise = 0.01 * np.random.default_rng(2).standard_normal(400)
    speed = 1.0 + 0.5 * np.sin(0.05 * np.arange(400)) + noise
    assert find_clipping(signal(np.concatenate([np.zeros(40), speed, np.zeros(40)]))) is None
    cut = np.where(np.arange(400) // 40 % 3 == 1, speed.max(), speed)
    assert find_clipping(signal(cut)) is not None


@pytest.mark.filterwarnings("error")
def test_a_record_that_lacks_the_output_changes_nothing():
    rng, t = np.random.default_rng(0), 0.01 * np.arange(800)
    loud, quiet = (np.sin(3 * t) + noise * rng.standard_normal(t.size) for noise in (0.1, 0.01))
    whole, lacking = signal(loud, quiet), signal(loud, np.full(800, np.nan), quiet)
    assert whole.noisy
    assert lacking.noisy
    found = find_uneven_noise(lacking)
    assert found.value == find_uneven_noise(whole).value
    assert "in record 0 and" in found.text
    assert found.text.endswith("in record 2")
    for check in (find_clipping, find_quantisation, find_held_samples):
        assert (check(lacking) is None) == (check(whole) is None)
    assert not signal(np.full(800, np.nan)).noisy


@pytest.mark.slow
def test_record_checks_are_silent_on_many_clean_signals():
    """Every check speaks up by chance in at most one of a thousand; 2 % in all is asked for."""
    rng, spoke = np.random.default_rng(0), 0
    for _ in range(300):
        t = 0.01 * np.arange(rng.integers(200, 1500))
        waves = np.sin(np.outer(t, rng.uniform(0.5, 12, 3)) + rng.uniform(0, 6, 3)).sum(axis=1)
        noise = 10.0 ** rng.uniform(-4, -1)
        clean = signal(*(waves + noise * rng.standard_normal(t.size) for _ in range(2)))
        checks = (find_clipping, find_quantisation, find_held_samples, find_uneven_noise)
        found = [check(clean) for check in checks]
        found += [find_outliers(clean, clean), find_gaps(clean.times, clean.records)]
        spoke += any(finding is not None for finding in found)
    assert spoke <= 6


@given(
    step=st.sampled_from([1e-3, 0.02, 0.25, 3.0]),
    offset=st.floats(-5, 5),
    seed=st.integers(0, 2**16),
)
def test_the_step_of_a_grid_is_found_wherever_the_grid_lies(step, offset, seed):
    counts = np.random.default_rng(seed).integers(-40, 40, 300)
    assert grid_step(offset + step * counts) == pytest.approx(step, rel=1e-6)


def test_the_step_is_found_where_values_lie_far_from_each_other():
    counts = np.random.default_rng(0).integers(-400, 400, 600)
    written = np.round(2 * np.pi / 4096 * counts, 5)
    assert grid_step(written) == pytest.approx(1e-5, rel=1e-6)


def swing():
    t = np.arange(4000)
    noise = 4e-4 * np.random.default_rng(0).standard_normal(t.size)
    return np.exp(-t / 300) * np.sin(t / 15) + noise


def test_an_encoder_at_rest_drops_no_samples_however_its_counts_are_written():
    steps = 0.00115059, 2 * np.pi / 4096
    fine, coarse = (step * np.rint(swing() / step) for step in steps)
    for records in ([np.round(fine, 5)], [coarse], [np.round(fine, 5), coarse]):
        y = signal(*records)
        assert find_held_samples(y) is None
        assert find_quantisation(y).kind == "quantisation"
        assert find_quantisation(y, left=0.99 * y.resolution).kind == "quantisation"
        assert find_quantisation(y, left=1.01 * y.resolution) is None


def test_a_thermistor_whose_steps_are_uneven_drops_no_samples():
    rng, t = np.random.default_rng(0), np.arange(4000)
    counts = np.rint(600 + 200 * np.sin(t / 500) + 0.4 * rng.standard_normal(t.size))
    temperature = np.round(1 / (1 / 298 + np.log(1023 / counts - 1) / 3950) - 273, 2)
    assert find_held_samples(signal(temperature)) is None


def test_samples_that_a_logger_held_are_counted_however_few_decimals_it_wrote():
    y = np.round(swing(), 5)
    y[100::50] = y[99:-1:50]
    assert find_held_samples(signal(y)).value >= 78


def coarse(kind, step, noise, decimals, seed):
    """Return a motion in steps of a sensor: even ones, written with more decimals, or uneven."""
    rng, t = np.random.default_rng(seed), np.arange(1500)
    levels = lfilter([0.05], [1, -0.95], np.repeat(rng.normal(size=15), 100))
    motions = {
        "swing": np.exp(-t / 300) * np.sin(t * rng.uniform(0.01, 0.1)),
        "steps": levels / np.ptp(levels),
        "ramp": t / t.size,
    }
    y = step * np.rint(motions[kind] / step + noise * rng.standard_normal(t.size))
    return {"even": y, "written": np.round(y, 6), "uneven": y + 0.1 * y**2}[decimals]


@pytest.mark.parametrize("decimals", ["even", "written", "uneven"])
@pytest.mark.parametrize("noise", [0.0, 0.15, 1.0, 3.0])
@pytest.mark.parametrize("kind", ["swing", "steps", "ramp"])
def test_a_coarse_sensor_that_repeats_at_rest_and_at_turning_points_drops_none(
    kind, noise, decimals
):
    """A smooth signal repeats wherever it moves by less than a step in a sample."""
    for seed, step in enumerate([0.0301, 0.01003, 0.003007, 0.00101]):
        assert find_held_samples(signal(coarse(kind, step, noise, decimals, seed))) is None


@pytest.mark.parametrize("decimals", ["even", "written", "uneven"])
@pytest.mark.parametrize("noise", [0.0, 0.3, 3.0, 10.0])
def test_samples_held_in_motion_are_found_however_coarse_the_sensor(noise, decimals):
    rng, step = np.random.default_rng(1), 0.002003
    y = step * np.rint(np.sin(np.arange(1500) / 13) / step + noise * rng.standard_normal(1500))
    y = {"even": y, "written": np.round(y, 6), "uneven": y + 0.1 * y**2}[decimals]
    assert find_held_samples(signal(y)) is None
    y[50::50] = y[49:-1:50]
    assert find_held_samples(signal(y)).value >= 15


def test_samples_held_for_longer_are_counted():
    y = np.round(swing(), 6)
    for start in range(100, 3000, 200):
        y[start : start + 4] = y[start - 1]
    assert find_held_samples(signal(y)).value == pytest.approx(60, abs=20)


def stop_and_go(rng, t):
    """A geared motor under steps of voltage: below a voltage it stands still."""
    volt, speed, turned = np.repeat(rng.normal(size=t.size // 50 + 1), 50)[: t.size], 0.0, 0.0
    angle, dt = np.empty(t.size), t[1]
    level, lag, gain = rng.uniform(0.2, 0.8), dt * rng.uniform(3, 30), rng.uniform(0.5, 20)
    for k, u in enumerate(volt):
        angle[k] = turned
        side = np.sign(speed) if speed else np.sign(u) * (abs(u) > level)
        after = speed + dt * (gain * (u * bool(side) - level * side) - speed) / lag
        speed = 0.0 if speed * after < 0 else after
        turned += dt * speed
    return angle


def turning(rng, t):
    """An angle: a swing that dies away, stop and go, a slow motion with rests, waves, a step."""
    rests = np.repeat(rng.uniform(size=t.size // 100 + 1) > 0.4, 100)[: t.size]
    pace = lfilter([0.1], [1, -0.9], rests * np.repeat(rng.normal(size=20), 80)[: t.size])
    late, w = np.maximum(t - t[t.size // 4], 0), rng.uniform(1, 8)
    return [
        rng.uniform(0.2, 3) * np.exp(-rng.uniform(0.005, 0.1) * w * t) * np.cos(w * t),
        stop_and_go(rng, t),
        np.cumsum(pace) * t[1] * 10 ** rng.uniform(-2, 0),
        np.sin(np.outer(t, rng.uniform(0.2, 6, 3)) + rng.uniform(0, 6, 3)).sum(axis=1),
        1 - np.exp(-2 * w * late) * (1 + 2 * w * late),
    ][rng.integers(5)]


def encoder(seed):
    """Two records of an encoder of 100 to 10 000 counts a turn, and what a right model leaves."""
    rng = np.random.default_rng(seed)
    step, dt = 2 * np.pi / 10 ** rng.uniform(2, 4), 10 ** rng.uniform(-3, -1)
    noise, decimals, zero = rng.choice([0, 0.05, 0.2, 0.5, 1.5]), rng.choice([5, 12]), rng.uniform()
    angles = [turning(rng, dt * np.arange(rng.integers(300, 1200))) for _ in range(2)]
    counts = [np.floor(a / step + zero + noise * rng.standard_normal(a.size)) for a in angles]
    read = [np.round(step * each, decimals) for each in counts]
    left = [y - angle for y, angle in zip(read, angles, strict=True)]
    return signal(*read, dt=dt), signal(*left, dt=dt), step


@pytest.mark.slow
def test_coarse_encoders_have_no_faults_at_rest_or_in_slow_motion():
    """Of every check at most one in a thousand speaks up; a faultless 600 have one at most."""
    spoke = dict.fromkeys(("clipping", "dropped samples", "outliers", "drift between records"), 0)
    for seed in range(600):
        y, left, _ = encoder(seed)
        if not all(y.is_still):
            found = (find_clipping(y), find_held_samples(y), find_uneven_noise(y))
            for finding in filter(None, (*found, find_outliers(y, left))):
                spoke[finding.kind] += 1
    assert max(spoke.values()) <= 1, spoke


@pytest.mark.slow
def test_real_faults_of_coarse_encoders_are_found():
    """Beside waves that leave no doubt: a cut, single far samples, and values that were held."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        step, t = 2 * np.pi / 10 ** rng.uniform(2.5, 4), 0.01 * np.arange(1200)
        angle = 2 * np.sin(rng.uniform(2, 4) * t) + np.sin(rng.uniform(5, 7) * t)
        y = np.round(step * np.floor(angle / step), 6)
        assert find_clipping(signal(np.minimum(y, y[np.argsort(y)[900]]))) is not None
        far = y.copy()
        far[[200, 700]] += [40 * step, -40 * step]
        assert find_outliers(signal(far), signal(far - angle)).value == 2
        held = y.copy()
        held[50::50] = held[49:-1:50]
        assert find_held_samples(signal(held)).value >= 8


@pytest.mark.parametrize("decimals", [5, 12])
def test_the_step_of_an_encoder_is_found_in_any_decimals(decimals):
    for seed in range(40):
        y, _, step = encoder(seed)
        if min(np.unique(piece).size for piece in y.pieces) > 100:
            rounded = [np.round(step * np.rint(piece / step), decimals) for piece in y.pieces]
            assert signal(*rounded).resolution == pytest.approx(step, rel=0.01)


@pytest.mark.slow
@given(scale=st.floats(1e-6, 1e6), shift=st.floats(-10, 10))
def test_findings_do_not_depend_on_the_unit(scale, shift):
    rng = np.random.default_rng(5)
    y = np.sin(0.03 * np.arange(600)) + 0.01 * rng.standard_normal(600)
    y[[100, 300]] += [1.0, -1.0]
    y = np.minimum(y, 0.8)
    moved = signal(scale * (y + shift))
    assert find_clipping(moved).value == find_clipping(signal(y)).value
    assert find_outliers(moved, moved).value == find_outliers(signal(y), signal(y)).value == 2


@given(share=st.floats(0.02, 0.2), seed=st.integers(0, 2**16))
def test_every_missing_sample_of_a_regular_clock_is_counted(share, seed):
    rng = np.random.default_rng(seed)
    keep = rng.uniform(size=500) > share / 2
    keep[[0, -1]] = True
    t = 0.01 * np.arange(500)
    found = find_gaps([t[keep]], ["a"])
    missing = np.count_nonzero(~keep)
    assert (0 if found is None else found.value) == missing


def test_time_stamps_rounded_to_milliseconds_are_no_jitter():
    y = np.sin(np.arange(3000) / 30) + 1e-3 * np.random.default_rng(0).standard_normal(3000)
    times = [np.round(np.arange(3000) / 300, 3)]
    assert find_jitter([Signal("y", "V", [y], times, ["a"])]) is None


def two_clocks(*steps, jitter=0.0):
    rng = np.random.default_rng(0)
    times = [step * np.arange(1500) for step in steps]
    times[-1] = times[-1] + jitter * steps[-1] * rng.uniform(-1, 1, 1500)
    pieces = [np.sin(3 * t) + 1e-3 * rng.standard_normal(t.size) for t in times]
    return Signal("y", "V", pieces, times, [str(i) for i in range(len(steps))])


@pytest.mark.parametrize("steps", [(0.002, 0.003), (0.002, 0.004), (0.002, 0.002, 0.02)])
def test_files_of_different_sample_times_are_neither_jitter_nor_gaps(steps):
    assert find_jitter([two_clocks(*steps)]) is None
    assert find_gaps(two_clocks(*steps).times, "abc"[: len(steps)]) is None


def test_the_record_whose_clock_jitters_is_named():
    finding = find_jitter([two_clocks(0.02, 0.03, jitter=0.2)])
    assert "sample time of 0.0299" in finding.text
    assert "in record 1" in finding.text


def test_gaps_are_counted_on_the_clock_of_their_own_record():
    times = [0.002 * np.arange(900), np.delete(0.004 * np.arange(900), [100, 101])]
    finding = find_gaps(times, ["a", "b"])
    assert finding.value == 2
    assert "from a clock of 0.004 s, the first after record b" in finding.text


def test_samples_between_gaps_are_told_where_they_are_many():
    """A logger that rests takes a battery's pauses in steps of a minute."""
    t = np.concatenate([np.arange(500.0), 500.0 + 60.0 * np.arange(1, 51)])
    finding = find_unused_samples([t], used=500)
    assert (finding.kind, finding.value) == ("unused samples", 50)
    assert finding.text.startswith("50 of 550 samples lie in pieces of fewer than 4 samples")
    assert find_unused_samples([t], used=540) is None


def test_records_that_begin_with_their_only_step_are_told():
    steps = signal(np.full(50, 2.0), np.full(50, 4.0))
    still, lively = signal(np.zeros(50), np.zeros(50)), signal(np.zeros(50), np.arange(50.0))
    assert find_first_steps([steps, still]).where == "y"
    assert find_first_steps([steps, lively]) is None
    assert find_first_steps([still]) is None  # released, and left alone
    assert find_first_steps([]) is None
