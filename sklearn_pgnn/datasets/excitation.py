r"""Excitations of a test rig, each with a largest magnitude of 1.

A record of length :math:`T` is excited between :math:`2/T` and :math:`20/T` hertz.
"""

import numpy as np

#: lowest and highest frequency of an excitation, in periods per record
PERIODS = (2.0, 20.0)
#: sines in a multi-sine; levels in a record of steps, and the fraction of levels that are zero
SINES, LEVELS, PAUSES = 6, 12, 0.2


def multisine(t, rng):
    r"""Add up sines of random frequency and phase, :math:`\sum_i \sin(2\pi f_i t + \alpha_i)`.

    >>> wave = multisine(np.linspace(0, 10, 1001), np.random.RandomState(0))
    >>> float(np.abs(wave).max())
    1.0
    """
    low, high = np.log(PERIODS)
    cycles = np.exp(rng.uniform(low, high, SINES)) * _progress(t)[:, None]
    return _normalised(np.sin(2 * np.pi * (cycles + rng.uniform(size=SINES))).sum(axis=1))


def sine(t, rng):
    r"""Return one sine of random frequency from rest, :math:`\sin(2\pi f t)`.

    >>> float(sine(np.linspace(0, 10, 1001), np.random.RandomState(0))[0])
    0.0
    """
    cycles = np.exp(rng.uniform(*np.log(PERIODS)))
    return _normalised(np.sin(2 * np.pi * cycles * _progress(t)))


def chirp(t, rng):
    """Sweep a sine over the whole band, its frequency growing exponentially.

    >>> wave = chirp(np.linspace(0, 10, 1001), np.random.RandomState(0))
    >>> bool(np.abs(wave).max() > 0.99)
    True
    """
    low, high = PERIODS
    rate = np.log(high / low)
    cycles = low * np.expm1(rate * _progress(t)) / rate
    wave = _normalised(np.sin(2 * np.pi * (cycles + rng.uniform())))
    return wave if rng.uniform() < 0.5 else wave[::-1]


def steps(t, rng):
    """Hold random levels, some of them zero, for random times.

    >>> wave = steps(np.linspace(0, 10, 1001), np.random.RandomState(0))
    >>> len(np.unique(wave)) <= 12
    True
    """
    levels = rng.uniform(-1, 1, LEVELS)
    levels[rng.uniform(size=LEVELS) < PAUSES] = 0.0
    levels[rng.randint(LEVELS)] = rng.choice([-1.0, 1.0])
    edges = np.sort(rng.uniform(size=LEVELS - 1))
    return _normalised(levels[np.searchsorted(edges, _progress(t))])


#: every excitation by name
EXCITATIONS = {"multisine": multisine, "sine": sine, "chirp": chirp, "steps": steps}
#: excitations that `excitation="mixed"` takes in turn
MIXED = ("multisine", "chirp", "steps")


def excite(kinds, t, n_records: int, n_inputs: int, rng):
    """Draw the excitations of a set of records, independently for every input.

    `kinds` are names in `EXCITATIONS`, taken in turn record by record; ``"mixed"`` stands for
    `MIXED`. The excitations, of shape (n_records, n_samples, n_inputs), have a largest magnitude of
    1.

    >>> excite("mixed", np.linspace(0, 10, 1001), 4, 1, np.random.RandomState(0)).shape
    (4, 1001, 1)
    """
    kinds = MIXED if kinds == "mixed" else (kinds,) if isinstance(kinds, str) else tuple(kinds)
    unknown = [kind for kind in kinds if kind not in EXCITATIONS]
    if unknown or not kinds:
        raise ValueError(
            f"excitation: expected 'mixed' or names among {', '.join(EXCITATIONS)}, got {kinds!r}."
        )
    waves = np.empty((n_records, t.size, n_inputs))
    for record in range(n_records):
        for i in range(n_inputs):
            waves[record, :, i] = EXCITATIONS[kinds[record % len(kinds)]](t, rng)
    return waves


def _progress(t):
    """Return the time as a fraction of the record's duration."""
    return (t - t[0]) / max(t[-1] - t[0], np.finfo(float).tiny)


def _normalised(wave):
    """Scale the largest magnitude to 1."""
    peak = np.abs(wave).max()
    return wave / peak if peak > 0 else wave
