"""How often what has a probability is right: a table's lines and a diagram."""

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

PICTURE = Path(__file__).parents[2] / "docs" / "_static" / "validation_chances.png"
#: edges of the bins of probabilities
EDGES = (0.0, 0.05, 0.2, 0.4, 0.6, 0.8, 0.95, 0.99, 1.0)


def binomial_interval(count: int, total: int) -> tuple[float, float]:
    """Return the 95 % interval of a share, by Clopper and Pearson."""
    ends = binomtest(count, total).proportion_ci()
    return float(ends.low), float(ends.high)


@dataclass(frozen=True)
class Bin:
    """The causes and rivals whose probabilities lie between two edges.

    Parameters
    ----------
    low, high : float
        The edges.
    mean : float
        Mean of the probabilities.
    right, count : int
        How many are right, and how many there are.
    """

    low: float
    high: float
    mean: float
    right: int
    count: int

    @property
    def share(self) -> float:
        """The share that is right."""
        return self.right / self.count

    @property
    def interval(self) -> tuple[float, float]:
        """Its 95 % interval."""
        return binomial_interval(self.right, self.count)


def bins_of(outcomes) -> list[Bin]:
    """Sort all causes and rivals by their probabilities; bins without any are left out."""
    said = [(chance, right) for o in outcomes for chance, right in o.chances]
    chances, rights = np.array([c for c, _ in said]), np.array([r for _, r in said], dtype=bool)
    places = np.digitize(chances, EDGES[1:-1])
    return [
        Bin(low, high, float(chances[of].mean()), int(rights[of].sum()), int(of.sum()))
        for low, high, of in (
            (low, high, places == place)
            for place, (low, high) in enumerate(itertools.pairwise(EDGES))
        )
        if of.any()
    ]


def mean_error(bins: list[Bin]) -> float:
    """Return the mean distance of probabilities from shares."""
    total = sum(each.count for each in bins)
    return sum(abs(each.mean - each.share) * each.count for each in bins) / total


def draw(bins: list[Bin]) -> None:
    """Draw shares over probabilities, with intervals and counts."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(4.6, 4.2), layout="constrained")
    axes.plot([0, 1], [0, 1], color="0.6", linewidth=1, label="calibrated")
    means, shares = [each.mean for each in bins], [each.share for each in bins]
    low, high = np.transpose([each.interval for each in bins])
    apart = np.maximum([shares - low, high - shares], 0.0)
    axes.errorbar(means, shares, apart, fmt="o", capsize=3, label="measured, 95 % interval")
    for i, each in enumerate(bins):
        axes.annotate(
            str(each.count), (each.mean, each.share), xytext=(5, -11) if i % 2 else (-5, 5),
            ha="left" if i % 2 else "right", textcoords="offset points", fontsize="small",
        )  # fmt: skip
    axes.set(xlabel="probability given", ylabel="share that is right", aspect="equal")
    axes.margins(0.08)
    figure.legend(loc="outside upper center", ncols=2, frameon=False)
    figure.savefig(PICTURE, dpi=120)
    plt.close(figure)
