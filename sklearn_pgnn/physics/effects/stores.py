"""Memory behind a place: a further store, a branch that relaxes, a spring that creeps."""

from dataclasses import dataclass
from typing import cast

import sympy

from sklearn_pgnn.physics.characteristic import Characteristic
from sklearn_pgnn.physics.effect import Effect, Symbols, quantity
from sklearn_pgnn.physics.effects.levels import StateEffect, first_order_states
from sklearn_pgnn.physics.effects.losses import surroundings
from sklearn_pgnn.physics.effects.rates import PositionEffect, force_scale
from sklearn_pgnn.physics.effects.springs import LinearStiffness
from sklearn_pgnn.physics.effects.targets import free_name, pair, parts
from sklearn_pgnn.physics.expressions import TIME, symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.scales import Scales

#: capacities of a further store that a fit starts from, as multiples of the modelled one's
CAPACITIES = (0.2, 1.0)
#: ratios of the conductances on both sides of a wall that a fit starts from
RATIOS = (0.5, 5.0)
#: least capacity of a further store, as a multiple of the modelled one's: less is none
LEAST = 1e-3


def memories(scales: Scales) -> tuple[float, ...]:
    """Return time constants [s] that records show, in order: within a window, and as long."""
    longest = min(scales.window, scales.duration)
    shares = (0.03, 0.2, 1.0)
    return tuple(sorted({max(3 * scales.sample_time, share * longest) for share in shares}))


def memory_limits(scales: Scales) -> tuple[float, float]:
    """Return the shortest and the longest time constant [s] that records show."""
    longest = min(scales.duration, 20.0 * scales.window)
    return scales.sample_time, max(longest, 4.0 * scales.sample_time)


@dataclass(frozen=True)
class SecondStore(StateEffect):
    r"""A further store behind a store: a wall behind the air, a heat sink, a side tank.

    .. math:: \dot x = f - k\,(x - x_2), \qquad T\,\dot x_2 = x - x_2

    The store :math:`x_2` begins as full as the other one, unless the records tell otherwise.

    Parameters
    ----------
    target : str
        The state.
    exchange : float, default=0
        Exchange :math:`k` [1/s], that is conductance per capacity of the modelled store.
    time_constant : float, default=1
        Time constant :math:`T` [s] of the further store; it holds :math:`k T` times as much as
        the modelled one.

    References
    ----------
    .. [1] P. Bacher, H. Madsen, "Identifying suitable models for the heat dynamics of buildings",
       Energy and Buildings 43(7), 2011, :doi:`10.1016/j.enbuild.2011.02.005`.

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> room = PhysicsModel({"T": "K"}, {"T": "P/C - h*T"}, {"C": 9.0, "h": 0.1}, {"P": "W"})
    >>> print((room + SecondStore("T", exchange=0.2, time_constant=60.0)).to_text())
    T' = -T*h - k2_T*(T - T_behind) + P/C
    T_behind' = (T - T_behind)/T2_T
    """

    exchange: float = quantity("k2", "1/s", low=0.0)
    time_constant: float = quantity("T2", "s", default=1.0, low=1e-9, role="shape")
    id = "second_store"
    phrase = "second store behind {target}"
    summary = "A slower store exchanges with this one: a wall, a heat sink, a side tank, a buffer."
    check = "Step the supply and record for long: a fast rise is followed by a slow one."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the first-order states that have no further store yet, and are none."""
        stores = (s for s in super().targets(model) if f"{s}_behind" not in model.states)
        return tuple(s for s in stores if s not in model.settled)

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Let the target exchange with a further state."""
        behind = f"{self.target}_behind"
        ahead = symbol(self.target) - symbol(behind)
        rates = dict(model.equations)
        rates[self.target] -= p["exchange"] * ahead
        return {
            "equations": {**rates, behind: ahead / p["time_constant"]},
            "states": {**model.states, behind: model.states[self.target]},
            "initial_state": {**model.initial_state, behind: model.initial_state[self.target]},
            "settled": {**model.settled, behind: self.target},
        }

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from a fast to a slow store, a small and a large one."""
        return tuple(cls(target, c / T, T) for T in memories(scales) for c in CAPACITIES)

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the exchange and the store within what the records show."""
        shortest, longest = memory_limits(scales)
        exchange = (LEAST / longest, 1.0 / shortest)
        return {"exchange": exchange, "time_constant": (shortest, longest)}

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the missing rate over the difference of the two stores."""
        ahead = symbol(self.target) - symbol(f"{self.target}_behind")
        return Characteristic("force", self.target, ahead, unit=model.unit(self.target))


@dataclass(frozen=True)
class StoreBetween(Effect):
    r"""A store between a store and what it loses to: a wall between a room and the weather.

    .. math:: \dot x = f + s\,\bigl((1 + r)\,w - a - r\,x\bigr), \qquad
              T\,\dot w = \frac{a + r\,x}{1 + r} - w

    with :math:`s = \partial f/\partial a`: what came from the surroundings :math:`a` comes from the
    wall :math:`w`, and at rest nothing changes.

    Parameters
    ----------
    target : str
        State and surroundings (an input or a parameter of its rate), as ``"T(T_out)"``.
    time_constant : float, default=1
        Time constant :math:`T` [s] of the store between.
    ratio : float, default=1
        Its conductance to the state per conductance to the surroundings, :math:`r` [-].

    References
    ----------
    .. [1] P. Bacher, H. Madsen, "Identifying suitable models for the heat dynamics of buildings",
       Energy and Buildings 43(7), 2011, :doi:`10.1016/j.enbuild.2011.02.005`.

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> house = PhysicsModel(
    ...     {"T": "K"}, {"T": "P/C + h*(To - T)"}, {"C": 9.0, "h": 0.1}, {"P": "W", "To": "K"}
    ... )
    >>> print((house + StoreBetween("T(To)", time_constant=60.0)).to_text())
    T' = h*(-T + To) + h*(-T*rw_T_To + T_wall*(rw_T_To + 1) - To) + P/C
    T_wall' = (-T_wall + (T*rw_T_To + To)/(rw_T_To + 1))/Tw_T_To
    """

    time_constant: float = quantity("Tw", "s", default=1.0, low=1e-9)
    ratio: float = quantity("rw", "", default=1.0, low=0.0, role="shape")
    id = "store_between"
    summary = "A slow store between this one and its surroundings: a wall, a pipe, an insulation."
    check = "Change the surroundings by a step: this store follows late, as through a wall."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the first-order states with what their rates lose to, if there is no wall yet."""
        stores = (s for s in first_order_states(model) if f"{s}_wall" not in model.states)
        return tuple(pair(s, a) for s in stores for a in surroundings(model, s))

    @classmethod
    def title(cls, target: str) -> str:
        """Return state and surroundings in words."""
        return "store between {} and {}".format(*parts(target))

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Put the state of the wall in the place of the surroundings."""
        state, around = parts(self.target)
        x, a, wall, r = symbol(state), symbol(around), symbol(f"{state}_wall"), p["ratio"]
        rates = dict(model.equations)
        rates[state] += rates[state].diff(a) * ((1 + r) * wall - a - r * x)
        rates[str(wall)] = ((a + r * x) / (1 + r) - wall) / p["time_constant"]
        return {
            "equations": rates,
            "states": {**model.states, str(wall): model.states[state]},
            "initial_state": {**model.initial_state, str(wall): model.initial_state[state]},
            "settled": {**model.settled, str(wall): state},
        }

    def units(self, model: PhysicsModel) -> dict[str, str]:
        """Return none: the time and the ratio have units of their own."""
        return {}

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from a fast to a slow wall, nearer to the state and to the surroundings."""
        return tuple(cls(target, T, ratio) for T in memories(scales) for ratio in RATIOS)

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the wall within what the records show."""
        return {"time_constant": memory_limits(scales), "ratio": (0.0, 100.0)}


@dataclass(frozen=True)
class MaxwellBranch(PositionEffect):
    r"""A spring that creeps, beside what there is: a Maxwell branch.

    .. math:: F = k\,(x - z), \qquad T\,\dot z = x - z

    With a spring of the model it makes a standard linear solid (Zener). It is a damper of
    :math:`k T` for slow, and a spring for fast motion.

    Parameters
    ----------
    target : str
        The velocity whose position the branch acts on.
    stiffness : float, default=0
        Stiffness :math:`k` [force per position].
    time_constant : float, default=1
        Time :math:`T` [s] in which it creeps.

    References
    ----------
    .. [1] R. S. Lakes, "Viscoelastic Materials", Cambridge University Press, 2009, chapter 2,
       :doi:`10.1017/CBO9780511626722`.

    Examples
    --------
    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> print((cart_on_spring() + MaxwellBranch("v", 20.0, time_constant=0.1)).to_text())
    x' = v
    v' = (-d*v + force - k*x - kM_v*(-crept_v + x))/m
    crept_v' = (-crept_v + x)/TM_v
    """

    stiffness: float = quantity("kM", "{force}/({position})", low=0.0)
    time_constant: float = quantity("TM", "s", default=1.0, low=1e-9, role="shape")
    id = "maxwell_branch"
    phrase = "creeping spring (Maxwell branch) at {target}"
    summary = "A spring that gives way in time: rubber, polymers, felt, an oil-filled mount."
    check = "Deflect it by a step and hold: the force falls to a lower value."
    generalises = (LinearStiffness.id,)
    excludes = (LinearStiffness.id,)

    @property
    def crept(self) -> sympy.Symbol:
        """The displacement of the point that creeps."""
        return symbol(f"crept_{self.target}")

    def force(self, v: sympy.Expr, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return k*(x - z)."""
        return p["stiffness"] * (position - self.crept)

    def potential(self, position: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the energy of the spring."""
        return p["stiffness"] * (position - self.crept) ** 2 / 2

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Subtract the force, and add the point that creeps."""
        changes, port, crept = super().rewrite(model, p), model.port(self.target), str(self.crept)
        position = cast("sympy.Expr", port.displacement)
        creep = (position - self.crept) / p["time_constant"]
        changes["equations"][crept] = creep
        changes["states"] = {**model.states, crept: model.unit_of(position)}
        begun = position.subs({symbol(s): value for s, value in model.initial_state.items()})
        start = float(begun) if begun.is_number else 0.0
        changes["initial_state"] = {**model.initial_state, crept: start}
        if port.position in model.states:
            changes["settled"] = {**model.settled, crept: port.position}
        if model.energy and port.is_power(model):
            lost = (
                model.energy.get("dissipated", 0) + creep**2 * p["stiffness"] * p["time_constant"]
            )
            changes["energy"] = {**changes["energy"], "dissipated": lost}
        return changes

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from fast to slow creep of a spring that takes part of the force."""
        travel = scales.typical[model.port(target).position] or 1.0
        stiffness = 0.2 * force_scale(target, model, scales) / travel
        return tuple(cls(target, stiffness, T) for T in memories(scales)[:2])

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Stay between one sample and what two windows can show: beyond it is a spring."""
        return {"time_constant": (scales.sample_time, 2.0 * scales.window)}


@dataclass(frozen=True)
class Relaxation(Effect):
    """Branches in series between two terminals, each a resistor with a capacitor beside it."""

    def branches(self, p: Symbols) -> tuple:
        """Return the resistance and the time constant of every branch, the fast one first."""
        raise NotImplementedError

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the outputs with each input that they contain in proportion."""
        return tuple(
            pair(output, name)
            for output, shown in model.outputs.items()
            for name in model.inputs
            if shown.has(symbol(name)) and not shown.diff(symbol(name)).has(symbol(name))
        )

    @classmethod
    def title(cls, target: str) -> str:
        """Return output and input in words."""
        output, name = parts(target)
        return f"{cls.id.replace('_', ' ')} from {name} to {output}"

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Add the states of the branches, and their parts of the output."""
        output, name = parts(self.target)
        u, shown = symbol(name), model.outputs[output]
        numbers = {symbol(n): value.value for n, value in model.parameters.items()}
        sign = -1 if shown.diff(u).subs(numbers).is_negative else 1
        rates, states, settled = dict(model.equations), dict(model.states), dict(model.settled)
        relaxed = free_name(model, f"{name}_relaxed")
        for order, (resistance, time_constant) in enumerate(self.branches(p)):
            state = relaxed + order * "_slowly"
            rates[state] = (u - symbol(state)) / time_constant
            states[state], settled[state] = model.inputs[name], name
            shown += sign * resistance * symbol(state)
        outputs = {**model.outputs, output: shown}
        return {"outputs": outputs, "equations": rates, "states": states, "settled": settled}

    def units(self, model: PhysicsModel) -> dict[str, str]:
        """Return the unit of the model's own resistance, where it is one."""
        output, name = parts(self.target)
        slope = model.outputs[output].diff(symbol(name))
        return {"resistance": model.unit_of(slope) if slope.free_symbols else ""}

    @classmethod
    def typical(cls, target: str, model: PhysicsModel, scales: Scales) -> dict[str, float]:
        """Return the typical size of the output per that of the input."""
        output, name = parts(target)
        usual = scales.typical[name] or scales.peak[name] or 1.0
        return {"s": scales.window, "resistance": scales.typical[output] / usual}

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the excess of the output over the time."""
        return Characteristic("output", parts(self.target)[0], TIME)


@dataclass(frozen=True)
class RelaxationBranch(Relaxation):
    r"""A branch between two terminals that relaxes: a resistor with a capacitor beside it.

    .. math:: y = g(x, u) \pm R\,u_r, \qquad T\,\dot u_r = u - u_r

    The sign is that of the model's own resistance to the input, :math:`\partial g/\partial u`.

    Parameters
    ----------
    target : str
        Output and input, as ``"V(I)"``.
    resistance : float, default=0
        Resistance :math:`R` of the branch [output/input].
    time_constant : float, default=1
        Time constant :math:`T = R C` [s].

    References
    ----------
    .. [1] G. L. Plett, "Battery Management Systems, Volume I", Artech House, 2015, chapter 2.

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> numbers = {"Q": 100.0, "c": 3.0, "R0": 0.1}
    >>> cell = PhysicsModel({"z": ""}, {"z": "I/Q"}, numbers, {"I": "A"}, {"V": "c*z + R0*I"})
    >>> RelaxationBranch.targets(cell)
    ('V(I)',)
    >>> (cell + RelaxationBranch("V(I)", resistance=0.05, time_constant=30.0)).outputs["V"]
    I*R0 + I_relaxed*Rr_V_I + c*z
    """

    resistance: float = quantity("Rr", "{resistance}", low=0.0)
    time_constant: float = quantity("Tr", "s", default=1.0, low=1e-9, role="shape")
    id = "relaxation_branch"
    summary = "A voltage that builds up behind a current: diffusion in a cell, an RC branch."
    check = "Step the input and back to zero: the output jumps, and then creeps to its end."

    def branches(self, p: Symbols) -> tuple:
        """Return the only branch."""
        return ((p["resistance"], p["time_constant"]),)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from a fast to a slow branch that makes a small part of the output."""
        resistance = 0.05 * cls.typical(target, model, scales)["resistance"]
        return tuple(cls(target, resistance, T) for T in memories(scales))

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the relaxation within what the records show."""
        return {"time_constant": memory_limits(scales)}


@dataclass(frozen=True)
class TwoRelaxationBranches(Relaxation):
    r"""Two branches between two terminals that relax, a fast and a slow one.

    .. math:: y = g(x, u) \pm (R_1 u_1 + R_2 u_2), \qquad
              T\,\dot u_1 = u - u_1, \qquad n\,T\,\dot u_2 = u - u_2

    Parameters
    ----------
    target : str
        Output and input, as ``"V(I)"``.
    fast, slow : float, default=0
        Resistances :math:`R_1, R_2` of the branches [output/input].
    time_constant : float, default=1
        Time constant :math:`T` of the fast branch [s].
    ratio : float, default=10
        By how many times the slow branch is slower, :math:`n` [-].

    References
    ----------
    .. [1] G. L. Plett, "Battery Management Systems, Volume I", Artech House, 2015, chapter 2.

    Examples
    --------
    >>> TwoRelaxationBranches("V(I)", fast=0.02, slow=0.05).names()
    {'fast': 'Rf_V_I', 'slow': 'Rs_V_I', 'time_constant': 'Tf_V_I', 'ratio': 'nr_V_I'}
    """

    fast: float = quantity("Rf", "{resistance}", low=0.0)
    slow: float = quantity("Rs", "{resistance}", low=0.0)
    time_constant: float = quantity("Tf", "s", default=1.0, low=1e-9, role="shape")
    ratio: float = quantity("nr", "", default=10.0, low=1.0, role="shape")
    id = "two_relaxation_branches"
    generalises = (RelaxationBranch.id,)
    excludes = (RelaxationBranch.id,)
    summary = "A voltage that builds up behind a current, first fast, then slowly: a cell."
    check = "Step the input and back to zero: the output creeps in two paces to its end."

    def branches(self, p: Symbols) -> tuple:
        """Return the fast and the slow branch."""
        time = p["time_constant"]
        return (p["fast"], time), (p["slow"], p["ratio"] * time)

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start from two small branches, from a fast to a slow pair."""
        resistance = 0.03 * cls.typical(target, model, scales)["resistance"]
        return tuple(cls(target, resistance, resistance, T, 8.0) for T in memories(scales)[:2])

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep both within what the records show, and apart."""
        return {"time_constant": memory_limits(scales), "ratio": (2.0, 1000.0)}
