"""A mass on an unstable spring that a controller holds, and records of it."""

import numpy as np

from sklearn_pgnn import Parameter, PhysicsModel

#: the instability [1/s^2]: an error grows by a factor e in 22 ms
GROWTH = 2000.0
FRICTION = 4.0
NOISE = 1e-4
#: frequencies of the reference [Hz]
TONES = (0.3, 0.9, 2.0, 4.0)


def prior(growth=GROWTH, spread=0.2) -> PhysicsModel:
    """Return the model of the mass, which knows of no friction."""
    return PhysicsModel(
        {"x": "m", "v": "m/s"},
        {"x": "v", "v": "q*x + F"},
        {"q": Parameter("q", growth, unit="1/s^2", spread=spread)},
        {"F": "N/kg"},
        outputs={"x": "x"},
        name="held mass",
    )


def record(sample_time, n_samples, friction=0.0, seed=0) -> tuple[np.ndarray, np.ndarray]:
    """Record the mass in closed loop; the input is held from sample to sample."""
    rng = np.random.default_rng(seed)
    t, x, v = sample_time * np.arange(n_samples), 0.0, 0.0
    phases = rng.uniform(0, 2 * np.pi, 4)
    aim = sum(0.02 * np.sin(2 * np.pi * f * t + p) for f, p in zip(TONES, phases, strict=True))
    F, y, fine = np.zeros(n_samples), np.zeros(n_samples), 50
    h = sample_time / fine
    for k in range(n_samples):
        y[k] = x
        F[k] = -2.5 * GROWTH * (x - aim[k]) - 80.0 * v
        for _ in range(fine):
            v += h * (GROWTH * x + F[k] - friction * np.tanh(v / 1e-3))
            x += h * v
    return np.column_stack([t, F]), y + NOISE * rng.normal(size=n_samples)
