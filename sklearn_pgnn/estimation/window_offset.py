"""An offset of its own in every window: what initial values alone may explain."""

from dataclasses import dataclass

import sympy

from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects.inputs import substitute
from sklearn_pgnn.physics.expressions import symbol


@dataclass(frozen=True)
class WindowOffset(Effect):
    r"""An offset that is constant, :math:`\dot o = 0`, and starts anew in every window.

    It is no suspect. A disturbance from outside that lasts as long as a window looks like it, and
    like any effect with a memory whose content at the start of a window is free.

    Parameters
    ----------
    target : str
        The input or output it is added to, or the state to whose rate.

    Examples
    --------
    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> (cart_on_spring() + WindowOffset("v")).states
    mappingproxy({'x': 'm', 'v': 'm/s', 'offset_v': ''})
    """

    id = "window_offset"

    @classmethod
    def targets(cls, model):
        """Name the states, inputs and outputs."""
        return (*model.states, *model.inputs, *model.outputs)

    @property
    def state(self) -> str:
        """Name the offset."""
        return f"offset_{self.target}"

    def rewrite(self, model, p):
        """Add the offset, a state that stays."""
        offset = symbol(self.state)
        if self.target in model.inputs:
            changes = substitute(model, symbol(self.target), symbol(self.target) + offset)
        else:
            part = "outputs" if self.target in model.outputs else "equations"
            old = getattr(model, part)
            changes = {part: {**old, self.target: old[self.target] + offset}}
        rates = {**changes.get("equations", model.equations), self.state: sympy.Integer(0)}
        return {**changes, "equations": rates, "states": {**model.states, self.state: ""}}

    @classmethod
    def starts(cls, target, model, scales):
        """Give no start: it is no suspect."""
        return ()
