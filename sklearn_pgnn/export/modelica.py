"""Models as Modelica text."""

from functools import reduce

import sympy
from sympy.printing.str import StrPrinter

from sklearn_pgnn.exceptions import ModelError, OptionError
from sklearn_pgnn.export.c_expression import c_name, c_names
from sklearn_pgnn.physics.dry_friction import dry_friction
from sklearn_pgnn.physics.expressions import TIME, symbol
from sklearn_pgnn.physics.external import require_equations
from sklearn_pgnn.physics.model import PhysicsModel

_KEYWORDS = (
    "abs acos algorithm and annotation asin assert atan atan2 block break ceil class connect "
    "connector constant constrainedby cos cosh delay der discrete div each else elseif elsewhen "
    "encapsulated end enumeration equation exp expandable extends external false final floor flow "
    "for function if import impure in initial inner input integer log log10 loop max min mod model "
    "noEvent not operator or outer output package parameter partial pre protected public pure "
    "record redeclare reinit rem replaceable return sample sign sin sinh smooth sqrt stream tan "
    "tanh then time true type when while within"
)
RESERVED = frozenset(_KEYWORDS.split())


def to_modelica(
    model: PhysicsModel, *, name: str | None = None, friction_width: float | None = None
) -> str:
    r"""Write a model as Modelica text, in continuous time.

    Inputs and outputs become ``input`` and ``output`` connectors, parameters can be changed, units
    and initial states are kept, and a delayed input becomes a ``delay``.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    name : str, optional
        Name of the Modelica model; by default that of the model, with underscores.
    friction_width : float, optional
        Speed over which the jump of dry friction is smoothed, :math:`\tanh(v/w)` instead of
        :math:`\mathrm{sign}(v)`, in the unit of the state; required for a state with dry friction.

    Returns
    -------
    str
        The text.

    Raises
    ------
    ModelError
        If a state has dry friction and `friction_width` is not given.
    OptionError
        If `model` is not a model or the width is not a valid speed.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"},
    ...                    outputs={"seen": "y**2"}, name="lag")
    >>> print(to_modelica(lag))
    model lag "lag"
      parameter Real T = 2.0;
      input Real u(unit="V");
      output Real seen(unit="V^2");
      Real y(unit="V", start=0.0, fixed=true);
    equation
      der(y) = (u - y)/T;
      seen = y^2;
    end lag;
    <BLANKLINE>
    """
    if not isinstance(model, PhysicsModel):
        raise OptionError(f"to_modelica: expected a PhysicsModel, got {type(model).__name__}.")
    require_equations(model, "to_modelica")
    _check_dry(model, friction_width)
    names = _names(model)
    write = _Writer(model, names, friction_width)
    title = c_name(model.name if name is None else name)
    title = f"{title}_" if title in RESERVED else title
    begun = [f"  {names[state]} = {names[u]};" for state, u in model.settled.items()]
    lines = [
        f"model {title} {_quoted(model.name)}",
        *_declarations(model, names),
        *(["initial equation", *begun] if begun else []),
        "equation",
        *(f"  der({names[s]}) = {write(rate)};" for s, rate in model.equations.items()),
        *(f"  {names[_output(model, y)]} = {write(seen)};" for y, seen in model.outputs.items()),
        f"end {title};",
    ]
    return "\n".join(lines) + "\n"


def _check_dry(model, width) -> None:
    dry = [*map(str, dry_friction(model).flows)]
    if dry and width is None:
        raise ModelError(
            f"to_modelica: {dry[0]!r} sticks in dry friction, which the text has no events for. "
            f"Remedy: to_fmu (--to fmu), a unit that every tool of Modelica runs as it is, or "
            f"friction_width=0.01 (--friction-width), the speed over which the jump is rounded off."
        )
    if width is not None and not width > 0:
        raise OptionError(f"friction_width: expected a speed above 0, got {width!r}.")


def _names(model) -> dict[str, str]:
    """Return the names of all quantities; an output with a state's name gets another one."""
    quantities = (*model.states, *model.inputs, *model.parameters)
    return c_names((*quantities, *(_output(model, name) for name in model.outputs)), RESERVED)


def _output(model, name: str) -> str:
    """Return the key of an output, whose name may be that of a state."""
    taken = {*model.states, *model.inputs, *model.parameters}
    return f"{name} seen" if name in taken else name


def _declarations(model, names) -> list[str]:
    lines = [
        f"  parameter Real {names[n]}{_settings(unit=p.unit)} = {p.value!r};"
        for n, p in model.parameters.items()
    ]
    lines += [f"  input Real {names[n]}{_settings(unit=unit)};" for n, unit in model.inputs.items()]
    lines += [
        f"  output Real {names[_output(model, n)]}{_settings(unit=model.unit(n))};"
        for n in model.outputs
    ]
    for state, unit in model.states.items():
        told = {} if state in model.settled else {"start": model.initial_state[state]}
        lines.append(f"  Real {names[state]}{_settings(unit=unit, **told)};")
    return lines


def _settings(*, unit: str = "", start: float | None = None) -> str:
    parts = [f"unit={_quoted(unit)}"] if unit else []
    parts += [] if start is None else [f"start={start!r}", "fixed=true"]
    return f"({', '.join(parts)})" if parts else ""


def _quoted(text: str) -> str:
    """Return a text as a Modelica string."""
    plain = " ".join(text.split()).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{plain}"'


class _Writer(StrPrinter):
    """Printer of expressions in Modelica."""

    def __init__(self, model, names, width):
        super().__init__()
        self._names = {**names, TIME.name: "time"}
        self._put = {}
        for name, delay in model.delays.items():
            late = f"delay({names[name]}, {names[delay]})"
            self._put[symbol(name)] = sympy.Symbol(late)
        dry = dry_friction(model)
        self._signs = dry.smoothed(width) if dry.rows else {}

    def __call__(self, expression: sympy.Expr) -> str:
        return self.doprint(expression.xreplace(self._signs).xreplace(self._put))

    def _print_Symbol(self, expr):
        return self._names.get(expr.name, expr.name)

    def _print_Float(self, expr):
        return repr(float(expr))

    def _print_Pi(self, expr):
        return "3.141592653589793"

    def _print_Exp1(self, expr):
        return "exp(1)"

    def _print_Pow(self, expr, rational=False):
        return super()._print_Pow(expr, rational=rational).replace("**", "^")

    def _print_Function(self, expr):
        name = {"ceiling": "ceil", "Abs": "abs"}.get(expr.func.__name__, expr.func.__name__)
        return f"{name}({', '.join(map(self._print, expr.args))})"

    def _print_ExpBase(self, expr):
        return f"exp({self._print(expr.exp)})"

    def _print_LatticeOp(self, expr):
        """Write maxima and minima of several as pairs."""
        name, parts = type(expr).__name__.lower(), sorted(expr.args, key=sympy.default_sort_key)
        return reduce(lambda one, other: f"{name}({one}, {other})", map(self._print, parts))
