r"""Find sensor faults and a leak in the air path of a turbocharged engine, and when they begin.

The engine and its faults follow the public description of the LiU-ICE benchmark (D. Jung, E. Frisk,
M. Krysander: *Residual selection for fault detection and isolation using convex optimization*,
Automatica 97, 2018, and the DX competition of 2024); its data are not used. Pressures in front of
and behind the throttle and the air flow are measured at 20 Hz, throttle, engine speed and wastegate
are known:

.. math::
    \dot p_{ic} = \frac{R T}{V_{ic}} (W_c - W_t), \qquad
    \dot p_{im} = \frac{R T}{V_{im}} (W_t - W_e - W_l), \qquad
    \dot r = \frac{W_e (1 - g) / W_0 - r}{\tau}

with the compressor :math:`W_c = c\,(p_a (1 + b r) - p_{ic})`, the throttle
:math:`W_t = A \alpha^2 p_{ic} \sqrt{1 - p_{im}/p_{ic}}`, the cylinders
:math:`W_e = \eta V_d N p_{im} / (2 R T)` and a leak :math:`W_l = L\,(p_{im} - p_a)`. From 120 s
on a sensor reads :math:`(1 + f)` times its quantity, or there is a leak.

Each diagnosis has one cycle without a fault and another, on which the fault begins; further ones
have none. Run ``python benchmarks/engine_air_path.py [--jobs 2]``.
"""

import argparse
import warnings
from dataclasses import dataclass

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from scipy.ndimage import gaussian_filter1d

from sklearn_pgnn import ModelDiagnosis, PhysicsModel
from sklearn_pgnn.datasets.integrator import integrate
from sklearn_pgnn.physics.effects.differences import SINCE
from sklearn_pgnn.physics.effects.targets import parts
from sklearn_pgnn.physics.expressions import symbol

#: X and y of a record
Tables = tuple[pd.DataFrame, pd.DataFrame]
#: sampling rate [Hz], length of a cycle and onset of a fault [s]
RATE, LENGTH, ONSET = 20.0, 240.0, 120.0
#: noise of the sensors [kPa, kPa, kg/s]
NOISE = np.array([0.3, 0.3, 2e-4])
#: the faults: relative errors of a sensor, and sizes of the leak [kg/s/kPa]
SENSORS, SIZES, LEAKS = ("p_ic", "p_im", "W_af"), (-0.15, -0.05, 0.05, 0.15), (1e-4, 4e-4)
#: cycles that are diagnosed, none of them that without a fault
CYCLES = (1, 2)


def engine() -> PhysicsModel:
    """Return the model of the air path, with a leak of size zero."""
    compressor, cylinders = "c*(p_a*(1 + b*r) - pic)", "eta*V_d*N*pim/(2*R*T)"
    throttle = "A*alpha**2*pic*sqrt(max(1 - pim/pic, 0))"
    known = {
        "V_d": (2e-3, "m^3"),
        "V_ic": (12e-3, "m^3"),
        "V_im": (6e-3, "m^3"),
        "R": (0.287, "kPa m^3/(kg K)"),
        "T": (310.0, "K"),
        "p_a": (100.0, "kPa"),
        "W_0": (0.05, "kg/s"),
    }
    free = {
        "A": {"value": 2.2e-3, "unit": "kg/s/kPa", "bounds": [1e-4, 1e-1]},
        "eta": {"value": 0.85, "bounds": [0.3, 1.2]},
        "b": {"value": 1.1, "bounds": [0.1, 5.0]},
        "c": {"value": 4e-3, "unit": "kg/s/kPa", "bounds": [1e-4, 1e-1]},
        "tau": {"value": 1.2, "unit": "s", "bounds": [0.1, 10.0]},
        "L": {"value": 0.0, "unit": "kg/s/kPa", "bounds": [0.0, 0.01]},
    }
    fixed = {n: {"value": v, "unit": unit, "fixed": True} for n, (v, unit) in known.items()}
    return PhysicsModel(
        name="engine air path",
        states={"pic": "kPa", "pim": "kPa", "r": ""},
        inputs={"alpha": "", "N": "1/s", "g": ""},
        outputs={"p_ic": "pic", "p_im": "pim", "W_af": compressor},
        parameters={**free, **fixed},
        equations={
            "pic": f"R*T/V_ic*({compressor} - {throttle})",
            "pim": f"R*T/V_im*({throttle} - {cylinders} - L*(pim - p_a))",
            "r": f"({cylinders}*(1 - g)/W_0 - r)/tau",
        },
    )


def cycle(number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return time and inputs of a driving cycle: throttle, speed [1/s] and wastegate."""
    rng = np.random.default_rng(number)
    t = np.arange(0.0, LENGTH, 1.0 / RATE)
    lows, highs = (0.25, 20.0, 0.1), (0.8, 60.0, 0.7)
    inputs = []
    for low, high, hold in zip(lows, highs, (4.0, 8.0, 10.0), strict=True):
        levels = rng.uniform(low, high, int(LENGTH / hold) + 1)
        stairs = levels[np.minimum((t / hold).astype(int), len(levels) - 1)]
        inputs.append(gaussian_filter1d(stairs, 0.3 * RATE))
    return t, np.column_stack(inputs)


@dataclass(frozen=True)
class Fault:
    """A fault: a sensor and its relative error, or the leak "L" and its size."""

    where: str
    size: float


def simulated(cases: list[tuple[int, Fault | None]]) -> list[tuple[pd.DataFrame, pd.DataFrame]]:
    """Return driving cycles, each with a fault, if any, from its onset on."""
    leaky = engine()
    rates = {**leaky.equations, "pim": leaky.equations["pim"].subs(symbol("L"), symbol("leak"))}
    leaky = leaky.replace(inputs={**leaky.inputs, "leak": ""}, equations=rates)
    t, later = cycle(0)[0], cycle(0)[0] >= ONSET
    leaks = [fault.size * later if fault and fault.where == "L" else 0.0 * t for _, fault in cases]
    driven = [cycle(number)[1] for number, _ in cases]
    u = np.stack([np.column_stack(pair) for pair in zip(driven, leaks, strict=True)])
    start = np.tile([105.0, 90.0, 0.3], (len(cases), 1))
    _, measured = integrate(leaky, t, u, start, substeps=8)
    tables = []
    for (number, fault), inputs, y in zip(cases, u, measured, strict=True):
        if fault and fault.where in SENSORS:
            y[:, SENSORS.index(fault.where)] *= 1.0 + fault.size * later
        noise = NOISE * np.random.default_rng([number, 1]).normal(size=y.shape)
        X = pd.DataFrame(inputs[:, :3], columns=list(engine().inputs))
        X = X.assign(t=t, trajectory=f"cycle_{number}")
        tables.append((X, pd.DataFrame(y + noise, columns=SENSORS)))
    return tables


def given() -> PhysicsModel:
    """Return the model that is given, its parameters a few percent off."""
    wrong = {"A": 1.04, "eta": 0.97, "b": 1.05, "c": 0.96, "tau": 1.06}
    model = engine()
    return model.with_parameters(**{n: model.parameters[n].value * f for n, f in wrong.items()})


def run(number: int, fault: Fault | None, *tables: Tables) -> tuple[bool, bool, float, str]:
    """Diagnose a cycle beside that without a fault.

    Return whether a fault is said, whether it is the right one in the right record within three per
    cent of its length, its probability, and what is said.
    """
    X, y = (pd.concat(part, ignore_index=True) for part in zip(*tables, strict=True))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        diagnosis = ModelDiagnosis(given(), catalogue=()).fit(X, y)
    said = "; ".join(f"{c.effect} of {c.target}" for c in diagnosis.causes_)
    if fault is None:
        return bool(diagnosis.causes_), not diagnosis.causes_, 0.0, said
    chance, is_right = 0.0, False
    for cause in diagnosis.causes_:
        where, column = parts(cause.target)
        here = where == fault.where and column.startswith(f"in_cycle_{number}{SINCE}")
        if here and abs(cause.onset.value - ONSET) < 0.03 * LENGTH:
            chance, is_right = cause.probability, True
    return bool(diagnosis.causes_), is_right, chance, said


def main():
    """Diagnose every fault on every cycle, and count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=1)
    said = parser.parse_args()
    faults = [Fault(sensor, size) for sensor in SENSORS for size in SIZES]
    faults += [Fault("L", size) for size in LEAKS]
    cases = [(number, fault) for number in CYCLES for fault in faults]
    cases += [(number, None) for number in range(1, 11)]
    usual, *others = simulated([(0, None), *cases])
    found = Parallel(n_jobs=said.jobs, return_as="generator")(
        delayed(run)(*case, usual, other) for case, other in zip(cases, others, strict=True)
    )
    rows = []
    for (number, fault), row in zip(cases, found, strict=True):
        rows.append((fault, *row))
        print(number, fault or "no fault", *row, flush=True)
    faulty, fine = [r for r in rows if r[0]], [r for r in rows if not r[0]]
    print(f"detected: {sum(r[1] for r in faulty)} of {len(faulty)}")
    print(f"right fault, record and onset: {sum(r[2] for r in faulty)} of {len(faulty)}")
    print(f"its mean probability: {np.mean([r[3] for r in faulty]):.3f}")
    print(f"false alarms: {sum(r[1] for r in fine)} of {len(fine)}")


if __name__ == "__main__":
    main()
