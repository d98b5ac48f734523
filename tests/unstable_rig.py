"""A ball that hovers below a magnet: unstable, and recorded while a controller holds it."""

import numpy as np

from sklearn_pgnn import Parameter, PhysicsModel

#: gravity [mm/s^2], strength of the magnet [mm^3/(s^2 A^2)] and its gap [mm]. About its rest an
#: error grows by a factor e in 23 ms
GRAVITY, STRENGTH, GAP = 9810.0, 4.08e6, 5.2
#: dry friction of a guide [mm/s^2]
FRICTION = 1000.0
NOISE = 0.01
#: frequencies of the reference [Hz]
TONES = (0.3, 0.9, 2.0, 4.0)
#: the controller: current at rest [A], and its gains for the gap and the speed
REST, GAIN, DAMPING = 0.5, 0.12, 0.002


def hovering(strength=STRENGTH, gap=GAP, spread=0.2) -> PhysicsModel:
    """Return the model of the ball, which knows of no friction; the current is its input."""
    return PhysicsModel(
        {"y": "mm", "v": "mm/s"},
        {"y": "v", "v": "g - Q*(i/(a + y))**2"},
        {
            "g": Parameter("g", GRAVITY, unit="mm/s^2", fixed=True),
            "Q": Parameter("Q", strength, unit="mm^3/(s^2*A^2)", spread=spread),
            "a": Parameter("a", gap, unit="mm", spread=spread),
        },
        {"i": "A"},
        outputs={"y": "y"},
        name="hovering ball",
    )


def record(
    sample_time, n_samples, friction=0.0, seed=0, noise=NOISE
) -> tuple[np.ndarray, np.ndarray]:
    """Record the current and the position; the current is held from sample to sample."""
    rng = np.random.default_rng(seed)
    t, y, v = sample_time * np.arange(n_samples), 5.0, 0.0
    phases = rng.uniform(0, 2 * np.pi, len(TONES))
    waves = [np.sin(2 * np.pi * f * t + p) for f, p in zip(TONES, phases, strict=True)]
    aim = 5.0 + 0.3 * np.sum(waves, axis=0)
    current, seen, fine = np.zeros(n_samples), np.zeros(n_samples), 50
    h = sample_time / fine
    for k in range(n_samples):
        seen[k] = y
        current[k] = np.clip(REST + GAIN * (y - aim[k]) + DAMPING * v, 0.0, 2.0)
        for _ in range(fine):
            v += h * (GRAVITY - STRENGTH * (current[k] / (GAP + y)) ** 2 - friction * np.tanh(v))
            y += h * v
    return np.column_stack([t, current]), seen + noise * rng.normal(size=n_samples)
