r"""The inertial parameters of a robot that records can determine, the others held as they are.

Torques are linear in the ten inertial parameters :math:`\pi` of every link,
:math:`\tau = Y(q, w, \dot w)\, \pi`, yet columns of the regressor :math:`Y` depend on each other:
of a link that only turns about an upright axis, the inertia about that axis is all that acts. At
random states a QR decomposition with pivoting, :math:`Y P = Q R`, takes the columns in the order of
what each adds to those before it; the first :math:`\operatorname{rank} Y` are a base [1]_. With the
others held, each of the base takes up what acts as it does.

References
----------
.. [1] M. Gautier, "Numerical calculation of the base inertial parameters of robots", IEEE
   International Conference on Robotics and Automation, 1990.
"""

from dataclasses import replace

import numpy as np
from scipy.linalg import qr

from sklearn_pgnn.priors.rigid_tree import Added, RigidTree
from sklearn_pgnn.readings import reading

#: the ten inertial parameters of a link: word, power of a length in it, and least value
WORDS = {
    "mass": (0, 0.0),
    **{f"moment_{axis}": (1, -np.inf) for axis in "xyz"},
    **{f"inertia_{a}": (2, 0.0 if a[0] == a[1] else -np.inf)
       for a in ("xx", "xy", "xz", "yy", "yz", "zz")},
}  # fmt: skip
UNITS = ("kg", "kg m", "kg m^2")
#: random states for every parameter, and the share of a column that counts as nothing
STATES, NOTHING = 2, 1e-9
#: a change beside a link's own inertia that leaves all inertias positive
SMALL = 1e-4


def base_inertias(tree: RigidTree, armatures: list[int]) -> tuple[Added, ...]:
    """Return a base of the inertial parameters, beside armatures of some joints and the payload."""
    every = inertias_of(tree)
    columns = regressor(replace(tree, added=(*tree.added, *every)))
    n, first = tree.size, len(tree.added)
    kept = columns[:, [*armatures, *range(n, n + first)]]
    sizes = np.array([each.small for each in every]) / SMALL
    chosen = independent(columns[:, n + first :] * sizes, beside=kept)
    return tuple(every[place] for place in chosen)


def inertias_of(tree: RigidTree) -> list[Added]:
    """Return the ten parameters of every link with a mass, about its point."""
    return [
        each for link, mass in enumerate(tree.masses) if mass > 0 for each in _ten_of(tree, link)
    ]


def _ten_of(tree: RigidTree, link: int) -> list[Added]:
    mass, r = tree.masses[link], np.array(tree.centres[link])
    tensor = np.array(tree.tensors[link]) + mass * (r @ r * np.eye(3) - np.outer(r, r))
    values = (mass, *(mass * r), *tensor[np.triu_indices(3)])
    length = np.sqrt(np.trace(tensor) / mass)
    ones, name = np.eye(10), tree.joints[link]
    return [
        Added(f"{word}_{name}", link, tuple(one.tolist()), UNITS[power], low, float(value),
              float(SMALL * mass * length**power))
        for (word, (power, low)), value, one in zip(WORDS.items(), values, ones, strict=True)
    ]  # fmt: skip


def regressor(tree: RigidTree, seed: int = 0) -> np.ndarray:
    """Return the slopes of torques at random states, by every armature and all that is added."""
    n, rng = tree.size, np.random.default_rng(seed)
    slopes, rows = reading("rigid_body_slopes"), []
    for _ in range(STATES * (tree.arguments // n + 1)):
        point = np.zeros(tree.arguments)
        point[: 2 * n] = rng.uniform(-3.0, 3.0, 2 * n)
        by_mass, by_torque, _ = slopes(tree.arrays, point)
        rows.append((by_mass[2 * n :] @ rng.uniform(-3.0, 3.0, n) + by_torque[2 * n :]).T)
    return np.vstack(rows)


def independent(columns: np.ndarray, beside: np.ndarray) -> list[int]:
    """Return the places of columns that are a base of all, beside others that stay.

    >>> columns = np.array([[1.0, 2.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    >>> independent(columns, beside=columns[:, :0]), independent(columns, beside=columns[:, 3:])
    ([1, 2, 3], [1, 2])
    """
    scale = np.linalg.norm(columns, axis=0).max()
    stays = qr(beside / np.linalg.norm(beside, axis=0), mode="economic")[0]
    left = columns - stays @ (stays.T @ columns)
    _, triangle, order = qr(left, mode="economic", pivoting=True)
    rank = int(np.sum(np.abs(np.diag(triangle)) > NOTHING * scale))
    return sorted(order[:rank].tolist())
