"""A joint of a robot: its names, its parameters, and what resists its motion."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.port import Port

#: letters of velocity and effort, and their units, at a hinge and at a slide
HINGE = {"w": "w", "e": "tau", "x": "rad", "effort": "N m"}
SLIDE = {"w": "v", "e": "F", "x": "m", "effort": "N"}
#: unit of what resists a joint, in the words of MJCF
RESISTS = {
    "damping": "{effort}/({x}/s)",
    "friction": "{effort}",
    "stiffness": "{effort}/{x}",
    "armature": "{effort}/({x}/s^2)",
}


@dataclass(frozen=True)
class Joint:
    """A joint with one coordinate; what it resists with is in SI units, zero where it does not."""

    name: str
    slides: bool
    damping: float
    friction: float
    stiffness: float
    armature: float
    rest: float

    @cached_property
    def kind(self) -> Mapping[str, str]:
        """Its letters and units."""
        return SLIDE if self.slides else HINGE

    @property
    def q(self) -> sympy.Symbol:
        """Its position."""
        return symbol(f"q_{self.name}")

    @property
    def w(self) -> sympy.Symbol:
        """Its velocity."""
        return symbol(f"{self.kind['w']}_{self.name}")

    @property
    def effort(self) -> sympy.Symbol:
        """Its torque or force."""
        return symbol(f"{self.kind['e']}_{self.name}")

    def unit(self, template: str) -> str:
        """Return a unit of angles or lengths."""
        return template.format(**self.kind)

    def symbol(self, word: str) -> sympy.Symbol:
        """Return one of its parameters."""
        return symbol(f"{word}_{self.name}")

    @property
    def parameters(self) -> dict[str, dict]:
        """What the file says of it, as parameters that may be fitted."""
        return {
            f"{word}_{self.name}": {
                "value": getattr(self, word),
                "unit": self.unit(unit),
                "bounds": (0.0, np.inf),
            }
            for word, unit in RESISTS.items()
            if getattr(self, word)
        }

    @property
    def resistance(self) -> sympy.Expr:
        r"""The torque :math:`d w + F_c\, \mathrm{sign}(w) + k (q - q_0)`, of what is not zero."""
        stretch = self.q - sympy.Float(self.rest) if self.rest else self.q
        terms = {"damping": self.w, "friction": sympy.sign(self.w), "stiffness": stretch}
        return sympy.Add(*(self.symbol(k) * of for k, of in terms.items() if getattr(self, k)))

    def port(self, rates: Mapping[str, sympy.Expr]) -> Port:
        """Return the port of its effort."""
        return Port(self.name, self.w, self.q, rates, {}, self.unit("{effort}"))


def joints_of(m: Any) -> list[Joint]:
    """Return the joints of MuJoCo's model of a robot."""
    names = [name_of(m, "joint", i) for i in range(m.nv)]
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise ModelError(f"expected joints of different names, got {min(twice)!r} twice.")
    return [
        Joint(
            name,
            bool(m.jnt_type[i] == 2),
            float(m.dof_damping[i]),
            float(m.dof_frictionloss[i]),
            float(m.jnt_stiffness[i]),
            armature_of(m, i),
            float(m.qpos_spring[i]),
        )
        for i, name in enumerate(names)
    ]


def armature_of(m: Any, joint: int) -> float:
    """Return the armature of a joint, and of its actuators through their gears."""
    own = float(m.dof_armature[joint])
    rotors = getattr(m, "actuator_armature", np.zeros(m.nu))
    at = (m.actuator_trntype <= 1) & (m.actuator_trnid[:, 0] == joint)
    return own + float(rotors[at] @ m.actuator_gear[at, 0] ** 2)


def name_of(m: Any, kind: str, number: int) -> str:
    """Return the name of a joint or an actuator as it may stand in equations."""
    name = re.sub(r"\W+", "_", getattr(m, kind)(number).name).strip("_")
    return name if name[:1].isalpha() else f"{kind}{name or number + 1}"
