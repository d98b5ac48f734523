"""A CasADi function as a model: its instructions are traced, or else the model calls it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.priors.python_function import from_function
from sklearn_pgnn.priors.traced import Traced

#: names of the arguments of the function
ARGUMENTS = ("x", "u", "p", "t")
#: NumPy functions by name of CasADi instruction
INSTRUCTIONS: dict[str, Callable] = {
    "ACOS": np.arccos,
    "ADD": np.add,
    "AND": np.logical_and,
    "ASIN": np.arcsin,
    "ASSIGN": np.positive,
    "ATAN": np.arctan,
    "ATAN2": np.arctan2,
    "CEIL": np.ceil,
    "CONSTPOW": np.power,
    "COS": np.cos,
    "COSH": np.cosh,
    "DIV": np.divide,
    "EXP": np.exp,
    "EXPM1": np.expm1,
    "FABS": np.absolute,
    "FLOOR": np.floor,
    "FMAX": np.maximum,
    "FMIN": np.minimum,
    "HYPOT": np.hypot,
    "IF_ELSE_ZERO": np.multiply,
    "INV": np.reciprocal,
    "LE": np.less_equal,
    "LOG": np.log,
    "LOG1P": np.log1p,
    "LT": np.less,
    "MUL": np.multiply,
    "NEG": np.negative,
    "NOT": np.logical_not,
    "OR": np.logical_or,
    "POW": np.power,
    "SIGN": np.sign,
    "SIN": np.sin,
    "SINH": np.sinh,
    "SQ": np.square,
    "SQRT": np.sqrt,
    "SUB": np.subtract,
    "TAN": np.tan,
    "TANH": np.tanh,
    "TWICE": lambda x: x + x,
}


def from_casadi(
    function: Any,
    states: Mapping[str, str],
    *,
    inputs: Mapping[str, str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    outputs: Mapping | None = None,
    **more: Any,
) -> PhysicsModel:
    """Return a model whose rates a CasADi function computes.

    Its instructions are traced with symbols, as in `from_function`. A function without an equation,
    such as an interpolation or an integrator, is called; ``trace`` is as in `from_function`.

    Parameters
    ----------
    function : casadi.Function
        Function of arguments named ``x``, ``u``, ``p`` and ``t``, as far as they exist. Its first
        result is the rates, an optional second one the outputs, named by `outputs`.
    states : mapping of str to str
        State names and their units, in the order of ``x``.
    inputs : mapping of str to str, optional
        Input names and their units, in the order of ``u``.
    parameters : mapping, optional
        The constants as `PhysicsModel` takes them, in the order of ``p``.
    outputs : mapping or sequence of str, optional
        Names of the function's outputs; or expressions as `PhysicsModel` takes them.
    **more
        ``trace``, and further parameters of `PhysicsModel`.

    Returns
    -------
    PhysicsModel
        The model.

    Raises
    ------
    ModelError
        If the function has other arguments or, with ``trace=True``, a part without an equation.

    Warns
    -----
    ModelWarning
        If the model calls the function.

    Examples
    --------
    >>> import casadi
    >>> x, F = casadi.SX.sym("x", 2), casadi.SX.sym("F")
    >>> cart = casadi.Function("cart", [x, F], [casadi.vertcat(x[1], F - 0.5*x[1])], ["x", "u"],
    ...     ["rates"])
    >>> print(from_casadi(cart, {"x": "m", "v": "m/s"}, inputs={"F": "N"}).to_text())
    x' = v
    v' = F - 0.5*v
    """
    with needed_by("from_casadi"):
        import casadi
    if not isinstance(function, casadi.Function):
        raise ModelError(f"from_casadi: expected a casadi.Function, got {type(function).__name__}.")
    _check_arguments(function, (states, inputs or {}, parameters or {}))
    text, seen = function.serialize(), outputs
    if outputs is not None and not isinstance(outputs, Mapping):
        names = tuple(outputs)
        if function.n_out() < 2 or function.numel_out(1) != len(names):
            raise ModelError(
                f"from_casadi: expected a second result of {len(names)} outputs, "
                f"{', '.join(names)}, got {function}."
            )
        seen = _Result(text, 1, names)
    return from_function(
        _Result(text, 0, tuple(states)),
        states,
        inputs=inputs,
        parameters=parameters,
        outputs=seen,
        **{"name": function.name(), **more},
    )


@dataclass(frozen=True)
class _Result:
    """A picklable result of a CasADi function, of symbols or of numbers."""

    text: str
    number: int
    names: tuple[str, ...]

    def __call__(self, t, x, u, p) -> dict:
        run = self._followed if isinstance(t, Traced) else self._called
        given = dict(zip(ARGUMENTS, (x, u, p, [t]), strict=True))
        found = run([given[name] for name in self.function.name_in()])
        return dict(zip(self.names, found, strict=True))

    @cached_property
    def function(self):
        import casadi

        return casadi.Function.deserialize(self.text)

    @property
    def __name__(self) -> str:
        return self.function.name()

    def _followed(self, given) -> list:
        return _run(_expanded(self.function), given)[self.number]

    def _called(self, given) -> list[float]:
        return self.function.call([list(part) for part in given])[self.number].full().ravel("F")

    def __reduce__(self):
        return _Result, (self.text, self.number, self.names)


def _expanded(function):
    """Return a function of scalar instructions."""
    try:
        return function if function.is_a("SXFunction") else function.expand()
    except RuntimeError as error:
        raise ModelError(
            f"from_casadi: expected a function of elementary operations, got {function}, which "
            f"CasADi cannot expand to such: {str(error).splitlines()[-1]}"
        ) from error


def _check_arguments(function, parts) -> None:
    counts = dict(zip(ARGUMENTS, (*map(len, parts), 1), strict=True))
    for k, name in enumerate(function.name_in()):
        if counts.get(name) != function.numel_in(k):
            raise ModelError(
                f"from_casadi: expected arguments among x of {counts['x']} states, u of "
                f"{counts['u']} inputs, p of {counts['p']} parameters and t, got {function}. "
                f"Remedy: casadi.Function(name, [x, u], [rates], ['x', 'u'], ['rates'])."
            )


def _run(function, arguments) -> list[list]:
    """Run a function's instructions on quantities of any kind."""
    import casadi

    named = {getattr(casadi, f"OP_{name}"): does for name, does in INSTRUCTIONS.items()}
    work: dict[int, object] = {}
    results = [[0.0] * function.numel_out(k) for k in range(function.n_out())]
    rows = [function.sparsity_out(k).row() for k in range(function.n_out())]
    for k in range(function.n_instructions()):
        code = function.instruction_id(k)
        read, write = function.instruction_input(k), function.instruction_output(k)
        if code == casadi.OP_INPUT:
            work[write[0]] = arguments[read[0]][read[1]]
        elif code == casadi.OP_OUTPUT:
            results[write[0]][rows[write[0]][write[1]]] = work[read[0]]
        elif code == casadi.OP_CONST:
            work[write[0]] = function.instruction_constant(k)
        elif code in named:
            work[write[0]] = named[code](*(work[place] for place in read))
        else:
            called = next(n for n in dir(casadi) if n[:3] == "OP_" and getattr(casadi, n) == code)
            raise ModelError(f"expected elementary operations, got {called[3:].lower()}.")
    return results
