"""Construction of an ONNX graph from formulas."""

from collections.abc import Callable

import numpy as np

#: ONNX operation by a function's name in C
_FUNCTIONS = {
    "acos": "Acos", "asin": "Asin", "atan": "Atan", "ceil": "Ceil", "cos": "Cos", "cosh": "Cosh",
    "exp": "Exp", "fabs": "Abs", "floor": "Floor", "fmax": "Max", "fmin": "Min", "if_else": "Where",
    "log": "Log", "sigmoid": "Sigmoid", "sin": "Sin", "sinh": "Sinh", "sqrt": "Sqrt", "tan": "Tan",
    "tanh": "Tanh", "relu": "Relu",
}  # fmt: skip


class Graph:
    """An ONNX graph in double or single precision: nodes, constants and their names."""

    def __init__(self, single: bool):
        self.kind = np.float32 if single else np.float64
        self.nodes: list = []
        self.constants: list = []

    def add(self, operation: str, *parts, **attributes) -> "Value":
        """Add a node with an ONNX operation and its settings."""
        return self.add_several(operation, parts, 1, **attributes)[0]

    def add_several(self, operation: str, parts, count: int, **attributes) -> list["Value"]:
        """Add a node with several results."""
        from onnx import helper

        names = [self._name(part) for part in parts]
        given = [f"v{len(self.nodes)}_{i}" for i in range(count)]
        self.nodes.append(helper.make_node(operation, names, given, **attributes))
        return [Value(self, name) for name in given]

    def columns(self, value: "Value", count: int) -> list["Value"]:
        """Return the columns of a matrix, each of width one."""
        if count < 2:
            return [value][:count]
        sizes = self.constant(np.ones(count, dtype=np.int64))
        return self.add_several("Split", [value, sizes], count, axis=1)

    def constant(self, values) -> "Value":
        """Add an array of constants: integers, or numbers in the graph's precision."""
        from onnx import numpy_helper

        values = np.asarray(values)
        values = values if values.dtype == np.int64 else values.astype(self.kind)
        name = f"c{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(values, name))
        return Value(self, name)

    def function(self, name: str) -> Callable:
        """Return a function by its name in C."""
        return lambda *parts: self.add(_FUNCTIONS[name], *parts)

    def _name(self, part) -> str:
        return part.name if isinstance(part, Value) else self.constant(part).name


def _operator(operation: str, swapped: bool = False) -> Callable[..., "Value"]:
    """Return an operator of values that adds a node to their graph."""

    def added(self, *other) -> "Value":
        return self.graph.add(operation, *((*other, self) if swapped else (self, *other)))

    return added


class Value:
    """A value of a graph, for use in formulas."""

    __array_ufunc__ = None  # NumPy leaves formulas with arrays to this class

    def __init__(self, graph: Graph, name: str):
        self.graph, self.name = graph, name

    __add__, __radd__ = _operator("Add"), _operator("Add", swapped=True)
    __sub__, __rsub__ = _operator("Sub"), _operator("Sub", swapped=True)
    __mul__, __rmul__ = _operator("Mul"), _operator("Mul", swapped=True)
    __truediv__, __rtruediv__ = _operator("Div"), _operator("Div", swapped=True)
    __pow__, __rpow__ = _operator("Pow"), _operator("Pow", swapped=True)
    __matmul__, __neg__ = _operator("MatMul"), _operator("Neg")
    __lt__, __le__ = _operator("Less"), _operator("LessOrEqual")
    __gt__, __ge__ = _operator("Greater"), _operator("GreaterOrEqual")
