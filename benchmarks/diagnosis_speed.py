"""Time the diagnosis over the number of samples, the whole catalogue suspected.

Run with ``python benchmarks/diagnosis_speed.py [THREADS]``; prints the seconds of every diagnosis,
the seconds per 10 000 samples, and what was hidden and named. The models are compiled by a first
run, whose time is given too: it tells what a new model costs once a machine.
"""

import sys
import time

from sklearn_pgnn import ModelDiagnosis, datasets, systems

SAMPLES = (12_500, 25_000, 50_000)
#: records of 5 s at 500 Hz
RECORD = {"duration": 5.0, "sample_rate": 500.0}
CASES = {
    "golf robot": (systems.golf_robot, "coulomb_friction"),
    "cart on a spring": (systems.cart_on_spring, "cubic_stiffness"),
}


def make_records(system, effect, samples):
    """Hide an effect in as many records as the samples fill."""
    n_records = round(samples / (RECORD["duration"] * RECORD["sample_rate"]))
    return datasets.make_hidden_effect(
        system(), effect, n_records=n_records, random_state=0, **RECORD
    )


def diagnose(hidden, threads):
    """Return the seconds a diagnosis takes, and what it names."""
    start = time.perf_counter()
    diagnosis = ModelDiagnosis(hidden.prior, n_jobs=threads).fit(hidden.X, hidden.y)
    seconds = time.perf_counter() - start
    return seconds, ", ".join(f"{c.effect} on {c.target}" for c in diagnosis.causes_)


def main(threads):
    """Print a table."""
    for name, (system, effect) in CASES.items():
        records = {samples: make_records(system, effect, samples) for samples in SAMPLES}
        first, _ = diagnose(records[SAMPLES[0]], threads)
        print(f"{name}, {effect} hidden, {threads} threads; first run {first:.1f} s")
        for samples, hidden in records.items():
            seconds, named = diagnose(hidden, threads)
            print(f"{samples:7d} samples {seconds:7.1f} s {1e4 * seconds / samples:6.2f} s", end="")
            print(f" per 10 000   {named or 'nothing'}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2)
