r"""What the equations of a robot say of each joint: what drives it, resists it and ends its travel.

A rate is :math:`\dot w_i = \sum_j (M^{-1})_{ij} e_j` with the effort
:math:`e_j = \tau_j - F_j - h_j`; the factors of the entries of :math:`M^{-1}` are read off.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import symbol, to_text
from sklearn_pgnn.physics.external import External
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.priors.robot_joint import RESISTS, Joint

#: an end of the travel beyond which there is none
NOWHERE = 1e9
_ENDS = {sympy.Max: "upper", sympy.Min: "lower"}


def stop_in(factor: sympy.Expr, q: sympy.Symbol) -> tuple[str, float] | None:
    r"""Return which end :math:`\max(q - q_+, 0)` or :math:`\min(q - q_-, 0)` is of, and where.

    >>> q = sympy.Symbol("q", real=True)
    >>> stop_in(sympy.Max(q - 0.5, 0), q), stop_in(sympy.Min(q + 2, 0), q), stop_in(q, q)
    (('upper', 0.5), ('lower', -2.0), None)
    """
    end = _ENDS.get(factor.func)
    others = [arg for arg in factor.args if arg != 0]
    if end is None or len(others) != 1 or len(factor.args) != 2:
        return None
    place = q - others[0]
    return (end, float(place)) if place.is_number else None


def ends_of(stops: Mapping[str, float], known: tuple[float, float] | None):
    """Return both ends of a travel, where the file gives one of them if need be; else None."""
    low, high = (None, None) if known is None else known
    ends = stops.get("lower", low), stops.get("upper", high)
    return None if None in ends else ends


#: relative size of a number that is nothing but rounding
ROUNDING = 1e-12


@dataclass(frozen=True)
class JointEffort:
    """What drives a joint, with which numbers it resists, in the words of `RESISTS`, and its stops.

    `stops` holds where the ends of the travel are, and `rigid` how stiff they are.
    """

    joint: Joint
    drive: sympy.Expr
    resists: Mapping[str, float]
    rest: float
    unsaid: tuple[str, ...]
    stops: Mapping[str, float]
    rigid: tuple[float, ...]


def joint_efforts(model: PhysicsModel, joints: list[Joint]) -> list[JointEffort]:
    """Return what drives and resists every joint, by the model's equations and parameters."""
    for joint in joints:
        if joint.name not in model.ports or str(joint.q) not in model.states:
            raise ModelError(
                f"expected a model of the robot in the file, got {model.name!r} without a joint "
                f"{joint.name!r}. Remedy: the file that from_urdf or from_mjcf has read."
            )
    values = {symbol(name): sympy.Float(p.value) for name, p in model.parameters.items()}
    return [_split(joint, each.xreplace(values)) for joint, each in _efforts(model, joints)]


def _efforts(model: PhysicsModel, joints: list[Joint]):
    """Yield every joint's effort; every rate must be made of the same ones."""
    entries = {
        (i, j): model.port(b.name).rates[str(a.w)]
        for i, a in enumerate(joints)
        for j, b in enumerate(joints)
    }
    marks = {entry: sympy.Dummy(real=True) for entry in dict.fromkeys(entries.values())}
    rates = [model.equations[str(joint.w)].xreplace(marks) for joint in joints]
    nowhere = dict.fromkeys(marks.values(), sympy.Integer(0))
    for i, joint in enumerate(joints):
        beside = rates[i].xreplace(nowhere)
        found = [sympy.expand(rates[k].diff(marks[entries[k, i]])) for k in range(len(joints))]
        if model.equations[str(joint.q)] != joint.w or beside or set(found) != {found[i]}:
            raise ModelError(
                f"expected what acts on joint {joint.name!r} to do so through its torque, in every "
                f"rate, got something else in some of them. Remedy: effects on the port "
                f"{joint.name!r}."
            )
        yield joint, found[i]


def _split(joint: Joint, effort: sympy.Expr) -> JointEffort:
    r"""Split an effort into the drive, and the terms :math:`-c\,\phi(q - q_0, w)` of a joint."""
    terms = [t for t in sympy.Add.make_args(effort) if not isinstance(-t, External)]
    own = {joint.q, joint.w}
    resists = [t for t in terms if t.free_symbols <= own]
    drive = sympy.Add(*(t for t in terms if not t.free_symbols <= own))
    found = dict.fromkeys(RESISTS, 0.0)
    constant, unsaid = 0.0, []
    stops: dict[str, float] = {}
    rigid: list[float] = []
    for term in resists:
        number, of = term.as_coeff_Mul()
        word = _WORDS.get(of.xreplace({joint.q: _Q, joint.w: _W}))
        stop = stop_in(of, joint.q) if number < 0 else None
        if of == 1:
            constant += float(number)
        elif stop is not None and stop[0] not in stops:
            if abs(stop[1]) < NOWHERE:
                stops[stop[0]] = stop[1]
                rigid.append(-float(number))
        elif word is None:
            unsaid.append(to_text(-term))
        else:
            found[word] -= float(number)
    rest, more = _rested(found, constant)
    return JointEffort(joint, drive, found, rest, (*unsaid, *more), stops, tuple(rigid))


_Q, _W = symbol("q"), symbol("w")
_WORDS: dict[sympy.Expr, str] = {of(_Q, _W): word for word, (_, of) in RESISTS.items()}
_WORDS[sympy.sign(_W) * _W**2] = "drag"


def _rested(found: dict[str, float], constant: float) -> tuple[float, list[str]]:
    r"""Write :math:`k q - c` as :math:`k (q - c/k)`, the only constant that a spring says."""
    if abs(constant) <= ROUNDING:
        return 0.0, []
    powers = found["quadratic_stiffness"] or found["cubic_stiffness"]
    if not found["stiffness"] or powers:
        return 0.0, [f"{-constant:.6g}"]
    return constant / found["stiffness"], []
