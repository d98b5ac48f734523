"""Fail where something has become half as fast as it was, against what is compiled beside it.

Run ``python benchmarks/speed/guard.py``, which takes less than a minute; ``--record`` prints the
ratios of this machine in the form of `RECORDED`. A ratio is the time of a loop written by hand, or
of another package, over the time of ours, each the shortest of runs in turn: it depends little on
the machine and on what else runs there. What fails is measured again before it counts.
"""

import argparse
import sys
import warnings

import numpy as np
import peers
import regressions
from measure import best_times

from sklearn_pgnn.simulation.simulate import simulate

STEPS, FEW, REPEATS, TRIES = 50_000, 100, 9, 3
LOWEST = 0.5
#: how many times as fast as the other way ours was when this was last looked at
RECORDED = {
    "smooth": 0.7,
    "dry friction": 0.5,
    "six sensitivities": 0.4,
    "six sensitivities, dry friction": 0.33,
    "a short record": 0.13,
    "SINDYc": 0.48,
}


def ways():
    """Return what is compared: our way and the other one, by name."""
    t, u = peers.record(STEPS)
    start = np.zeros(2)

    def ours(model, n_numbers=0, n=STEPS):
        wrt = tuple(model.parameters)[: n_numbers - 2] if n_numbers else None
        return lambda: [
            simulate(model, t[:n], u[:n], start, wrt=wrt, substeps=1) for _ in range(STEPS // n)
        ]

    def loop():
        peers.numba_loop(t, u, np.empty((STEPS, 2)))

    def calls():
        for _ in range(STEPS // FEW):
            peers.numba_loop(t[:FEW], u[:FEW], np.empty((FEW, 2)))

    return {
        "smooth": (ours(peers.PENDULUM), loop),
        "dry friction": (ours(peers.GOLF), loop),
        "six sensitivities": (ours(peers.PENDULUM, 6), loop),
        "six sensitivities, dry friction": (ours(peers.GOLF, 6), loop),
        "a short record": (ours(peers.PENDULUM, n=FEW), calls),
        "SINDYc": regressions.fits(5_000),
    }


def speeds(compared) -> dict[str, float]:
    """Return how many times as fast as the other way ours is, by name."""
    times = {name: best_times(*pair, repeats=REPEATS) for name, pair in compared.items()}
    return {name: theirs / mine for name, (mine, theirs) in times.items()}


def as_recorded(found: dict[str, float]) -> str:
    """Return ratios in the form of `RECORDED`."""
    lines = "".join(f'    "{name}": {speed:.2g},\n' for name, speed in found.items())
    return f"RECORDED = {{\n{lines}}}"


def main() -> int:
    """Measure and judge; return 1 where something is slow."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--record", action="store_true")
    record = parser.parse_args().record
    warnings.simplefilter("ignore")
    left = ways()
    if record:
        print(as_recorded(speeds(left)))
        return 0
    for _ in range(TRIES):
        found = speeds(left)
        for name, speed in found.items():
            print(f"{name}: {speed:.2g} times as fast, recorded {RECORDED[name]:g}", flush=True)
        left = {n: left[n] for n, speed in found.items() if speed < LOWEST * RECORDED[n]}
        if not left:
            return 0
    print(f"slower than {LOWEST:g} of what was recorded: {', '.join(left)}", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
