r"""A tree of joints with one coordinate each, and its dynamics as functions that equations call.

.. math:: M(q)\, \ddot q + h(q, \dot q) = \tau

The equations of an arm of six joints would fill books; the entries of :math:`M^{-1}` and :math:`h`
are computed, see `sklearn_pgnn.simulation.rigid_bodies`, and so are their derivatives.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np

from sklearn_pgnn.physics.external import ExternalFunction, external_function
from sklearn_pgnn.readings import reading

Numbers = tuple[float, ...]
#: points at which it is looked what depends on what, and the share that counts as nothing
PROBED, NOTHING = 8, 1e-12


class Added(NamedTuple):
    """An inertia that a link may have more of: for an amount of one, as its ten numbers.

    They are mass, first moment (x, y, z) and tensor (xx, xy, xz, yy, yz, zz) about the link's
    point. The amount is the parameter `name` less what of it the link has already, `known`.
    """

    name: str
    link: int
    inertia: Numbers
    unit: str
    low: float
    known: float
    #: a small amount beside the inertia of the link
    small: float


@dataclass(frozen=True)
class RigidTree:
    """Joints and links in the world's axes, as they stand where every coordinate is zero.

    A link is what a joint moves; all its vectors begin at a point of the joint's axis. `parents`
    gives the link before each, the number of links for the base; `offsets` the way from its point
    to this one; `zeros` the coordinates' values there in the file; `added` what links may have
    beside their own inertia.
    """

    joints: tuple[str, ...]
    parents: tuple[int, ...]
    slides: tuple[bool, ...]
    axes: tuple[Numbers, ...]
    offsets: tuple[Numbers, ...]
    masses: Numbers
    centres: tuple[Numbers, ...]
    tensors: tuple[tuple[Numbers, ...], ...]
    gravity: Numbers
    zeros: Numbers
    added: tuple[Added, ...] = ()

    @property
    def size(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @property
    def arguments(self) -> int:
        """Number of positions, velocities, armatures, and amounts of what may be added."""
        return 3 * self.size + len(self.added)

    @cached_property
    def arrays(self) -> tuple:
        """The tree as compiled code takes it."""
        vectors = (self.axes, self.offsets, self.masses, self.centres, self.tensors, self.gravity)
        axes, offsets, masses, centres, tensors, gravity = (np.array(v, float) for v in vectors)
        joints = np.array(self.parents, np.int64), np.array(self.slides, bool)
        return (*joints, axes, offsets, masses, centres, tensors, gravity, *self._added_arrays)

    @property
    def _added_arrays(self) -> tuple:
        """Links, masses, first moments and tensors of what may be added."""
        rows = np.array([each.inertia for each in self.added], float).reshape(-1, 10)
        links = np.array([each.link for each in self.added], np.int64)
        tensors = rows[:, [4, 5, 6, 5, 7, 8, 6, 8, 9]].reshape(-1, 3, 3)
        return links, rows[:, 0].copy(), rows[:, 1:4].copy(), tensors

    def __reduce__(self):
        return RigidTree, tuple(getattr(self, name) for name in self.__dataclass_fields__)


@dataclass(frozen=True)
class TreeSlopes:
    """Derivatives of the dynamics; of each `which` gives the argument, the row and the column."""

    tree: RigidTree
    which: tuple[tuple[int, int, int], ...]

    def __call__(self, point: Numbers) -> list[float]:
        """Return them at a point."""
        return reading("rigid_bodies")(self)(point)

    @property
    def size(self) -> int:
        """Number of results."""
        return len(self.which)


@dataclass(frozen=True)
class TreeDynamics:
    r"""The upper half of :math:`M^{-1}`, row by row, and :math:`h`, the last column.

    The arguments are positions, velocities, armatures and amounts of what is added; results depend
    on those of the last two kinds that are `free`, by their places.
    """

    tree: RigidTree
    free: tuple[int, ...] = ()

    def __call__(self, point: Numbers) -> list[float]:
        """Return them at a point."""
        return reading("rigid_bodies")(self)(point)

    @property
    def size(self) -> int:
        """Number of results."""
        return len(self.entries)

    @cached_property
    def entries(self) -> tuple[tuple[int, int], ...]:
        """Row and column of every result."""
        n = self.tree.size
        return (*combinations_with_replacement(range(n), 2), *((i, n) for i in range(n)))

    @cached_property
    def slopes(self) -> TreeSlopes:
        """The derivatives that are not always zero, tried at some points."""
        n = self.tree.size
        every = [(a, *entry) for a in (*range(2 * n), *self.free) for entry in self.entries]
        points = np.random.default_rng(0).uniform(-3.0, 3.0, (PROBED, self.tree.arguments))
        small = [*(n * [0.1]), *(each.small for each in self.tree.added)]
        points[:, 2 * n :] = np.isin(range(2 * n, self.tree.arguments), self.free) * small
        known = TreeSlopes(self.tree, tuple(every))
        sizes = np.abs([known(tuple(point)) for point in points]).max(axis=0)
        matters = sizes > NOTHING * sizes.max()
        return TreeSlopes(
            self.tree, tuple(one for one, does in zip(every, matters, strict=True) if does)
        )

    @cached_property
    def outside(self) -> tuple[ExternalFunction, ExternalFunction]:
        """The dynamics and their derivatives as functions that equations can call."""
        t, n = self.tree.joints, self.tree.size
        names = [f"{letter}_{joint}" for letter in "qwI" for joint in t]
        names += [each.name for each in self.tree.added]
        results = [f"1/M {i + 1} {j + 1}" if j < n else f"h {i + 1}" for i, j in self.entries]
        entry = dict(zip(self.entries, results, strict=True))
        slopes = [f"d({entry[i, j]})/d({names[a]})" for a, i, j in self.slopes.which]
        given = ((self, "dynamics", results), (self.slopes, "slope", slopes))
        own = len(names) - 2 * n
        value, slope = (external_function(call, name, names, r, own) for call, name, r in given)
        return value, slope

    @cached_property
    def _slope_places(self) -> dict[tuple[int, int, int], int]:
        return {one: place for place, one in enumerate(self.slopes.which)}

    def arguments(self, result: int) -> tuple[int, ...]:
        """Return the places of the arguments that a result depends on."""
        entry = self.entries[result]
        return tuple(a for a, *of in self.slopes.which if tuple(of) == entry)

    def slope(self, result: int, argument: int) -> tuple[ExternalFunction, int] | None:
        """Return the derivative of a result by an argument, None where it is zero."""
        place = self._slope_places.get((argument, *self.entries[result]))
        return None if place is None else (self.outside[1], place)

    def __reduce__(self):
        return TreeDynamics, (self.tree, self.free)
