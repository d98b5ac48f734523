"""What is hidden: an effect's name and target, and what it does to a rig, written by hand."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from rigs import Rig

#: sizes over the typical effort, least and largest
LEAST, LARGEST = 0.15, 0.4
#: laws that are sums of others: two levels of dry friction are their mean, and a load of half of
#: what they differ by, also where they hold a machine
SUMS = {"asymmetric_friction": ("coulomb_friction", "constant_load")}


@dataclass(frozen=True)
class Hidden:
    """A hidden effect.

    Parameters
    ----------
    effect : str
        Its id in the catalogue.
    target : str
        Where it is: a port, or what the catalogue calls its target.
    also : tuple of (str, str)
        Names that are as right.
    """

    effect: str
    target: str
    also: tuple[tuple[str, str], ...] = ()

    @property
    def accepted(self) -> set[tuple[str, str]]:
        """Every right name."""
        return {(self.effect, self.target), *self.also}

    @property
    def places(self) -> set[str]:
        """Every right place."""
        return {target for _, target in self.accepted}

    def is_sum_of(self, named: Sequence[set[tuple[str, str]]]) -> bool:
        """Return whether causes, each with all that it may be, make up what is hidden."""
        parts = [{(law, at) for at in self.places} for law in SUMS.get(self.effect, ())]
        orders = permutations(named) if len(named) == len(parts) else ()
        return any(all(map(set.intersection, parts, order)) for order in orders)


@dataclass(frozen=True)
class Changed:
    """A rig with what is hidden.

    Parameters
    ----------
    rates : callable
        Rates of all states, those added last, from states and inputs.
    outputs : callable
        Outputs from states and inputs.
    added : int
        Number of added states.
    during : callable, optional
        Of states and inputs, the rates until the end of a step; else `rates`.
    """

    rates: Callable
    outputs: Callable
    added: int = 0
    during: Callable | None = None


def plain(rig: Rig, p) -> Changed:
    """Return a rig in which nothing is hidden."""

    def outputs(x, u):
        return rig.outputs(x, rig.rates(x, u, p), u, p)

    return Changed(lambda x, u: rig.rates(x, u, p), outputs)


# -- at the ports of mechanisms --------------------------------------------------------------------


def law(effect: str, size: float, flow: float, travel: float):
    """Return an effort over flow and displacement."""
    if effect == "quadratic_drag":
        return lambda f, x: size * np.abs(f) * f / flow**2
    if effect == "cubic_stiffness":
        return lambda f, x: size * (x / travel) ** 3
    if effect == "constant_load":
        return lambda f, x: size + 0 * f
    raise ValueError(effect)


def levels(effect: str, size: float, flow: float, rng):
    """Return the least and largest effort of dry friction over the flow; None for another law."""
    if effect == "coulomb_friction":
        return lambda f: (-size, size)
    if effect == "asymmetric_friction":
        back = size * rng.uniform(0.3, 0.6)
        return lambda f: (-back, size)
    if effect == "stribeck_friction":
        extra, speed = size * rng.uniform(0.6, 1.2), flow * rng.uniform(0.15, 0.3)

        def both(f):
            level = size + extra * np.exp(-((f / speed) ** 2))
            return -level, level

        return both
    return None


def at_port(rig: Rig, p, what: Hidden, calm, h: float, rng) -> Changed:
    """Let an effort act at a port; its size follows from a run without it, with steps h."""
    x, rates = calm
    weights, place = (np.asarray(w, dtype=float) for w in rig.ports[what.target])
    flow, travel = np.std(x @ weights), np.std(x @ place)
    sample = x.reshape(-1, x.shape[-1])[:: max(1, x.size // 2000)]
    mobility = np.mean(np.einsum("i,rij,j->r", weights, rig.slopes(sample, p), weights))
    size = np.std(rates @ weights) / mobility * rng.uniform(LEAST, LARGEST)
    dry = levels(what.effect, size, flow, rng)
    effort = None if dry else law(what.effect, size, flow, travel)

    def acting(x, u):
        return _held(rig, p, weights, dry, x, u, h) if dry else effort(x @ weights, x @ place)

    def less(x, u, e):
        return rig.rates(x, u, p) - e[:, None] * (rig.slopes(x, p) @ weights)

    def changed(x, u):
        return less(x, u, acting(x, u))

    def during(x, u):
        e = acting(x, u)
        return lambda x, u: less(x, u, e)

    def outputs(x, u):
        return rig.outputs(x, changed(x, u), u, p)

    return Changed(changed, outputs, during=during if dry else None)


def _held(rig: Rig, p, weights, dry, x, u, h: float):
    r"""Return the effort that brings a flow to rest within a step, as far as friction can.

    .. math:: e = \mathrm{clip}\Bigl(\frac{f/h + \dot f}{w^\top M^{-1} w}\Bigr)

    So does Moreau's time stepping. The levels are those in the middle of the step.
    """
    f, rate = x @ weights, rig.rates(x, u, p) @ weights
    slope = rig.slopes(x, p) @ weights @ weights
    to_rest = (f / h + rate) / slope
    middle = f + h / 2 * (rate - slope * np.clip(to_rest, *dry(f)))
    return np.clip(to_rest, *dry(middle))


# -- in networks, and in parameters ----------------------------------------------------------------


def by_parameter(rig: Rig, p, name: str, value) -> Changed:
    """Give a parameter another value, which may depend on states and inputs."""

    def now(x, u):
        return {**p, name: value(x, u)}

    def outputs(x, u):
        return rig.outputs(x, rig.rates(x, u, now(x, u)), u, now(x, u))

    return Changed(lambda x, u: rig.rates(x, u, now(x, u)), outputs)


def second_store(rig: Rig, p, state: int, exchange: float, lag: float) -> Changed:
    r"""Put a store behind another: it takes :math:`k (x - z)`, and :math:`T \dot z = x - z`."""

    def rates(x, u):
        own, behind = x[:, :-1], x[:, -1]
        change = rig.rates(own, u, p)
        change[:, state] -= exchange * (own[:, state] - behind)
        return np.column_stack([change, (own[:, state] - behind) / lag])

    def outputs(x, u):
        return rig.outputs(x[:, :-1], rates(x, u)[:, :-1], u, p)

    return Changed(rates, outputs, added=1)


def power_loss(rig: Rig, p, state: int, surroundings: int, rate: float, power: float) -> Changed:
    r"""Let a loss act: :math:`\lambda d |d|^m` to surroundings, an input."""

    def rates(x, u):
        d = x[:, state] - u[:, surroundings]
        change = rig.rates(x, u, p)
        change[:, state] -= rate * d * np.abs(d) ** power
        return change

    return Changed(rates, lambda x, u: rig.outputs(x, rates(x, u), u, p))


def relaxation_branch(rig: Rig, p, resistance: float, lag: float) -> Changed:
    """Put a further branch between the terminals of a cell."""

    def rates(x, u):
        own, bent = x[:, :-1], x[:, -1]
        return np.column_stack([rig.rates(own, u, p), (u[:, 0] - bent) / lag])

    def outputs(x, u):
        own = rig.outputs(x[:, :-1], rates(x, u)[:, :-1], u, p)
        return own - resistance * x[:, -1:]

    return Changed(rates, outputs, added=1)
