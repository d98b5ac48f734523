"""One step of a trained network as an ONNX graph."""

from typing import Any

import numpy as np
from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.exceptions import ModelError, OptionError
from sklearn_pgnn.export.c import is_network
from sklearn_pgnn.export.onnx_graph import Graph, Value
from sklearn_pgnn.export.symbolic_machine import SymbolicMachine
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.physics.dry_friction import dry_friction
from sklearn_pgnn.simulation.network_run import NetworkStep, terms_model

#: ONNX operator set that runtimes of some years support
OPSET, IR_VERSION = 18, 8


def to_onnx(
    network: Any,
    interval: float | None = None,
    *,
    precision: str = "double",
    prior_as_input: bool = False,
) -> Any:
    r"""Return one step of a trained network as an ONNX model.

    The graph maps the state ``x`` and the inputs ``u``, as they act until the next sample, to
    ``x_next``; every row is a separate step. Further inputs, as far as the step needs them, are
    ``u_next`` if inputs are linearly interpolated, ``t`` if the model depends on the time,
    ``simulated`` (the model's open-loop simulation at the next sample) if it guides the network,
    ``features`` at the next sample, and ``hidden`` of a recurrent core, which returns
    ``hidden_next``.

    Parameters
    ----------
    network : PGNNLRegressor
        The trained network, with one of the package's built-in cores.
    interval : float, optional
        Sample interval [s]; by default that of the training data.
    precision : {"double", "single"}, default="double"
        Precision of all numbers; some runtimes support some operations in single precision only.
    prior_as_input : bool, default=False
        Whether the model's own step from ``x``, if the network needs it, is the input ``prior``
        instead of being computed in the graph.

    Returns
    -------
    onnx.ModelProto
        The model, checked; ``onnx.save(model, "step.onnx")`` writes it.

    Raises
    ------
    ModelError
        If the step needs that of the model, which has dry friction, whose events a graph cannot
        express; or if the core is user-defined.
    OptionError
        If `network` is not a network or an option has an invalid value.

    Examples
    --------
    >>> from sklearn_pgnn import PGNNLRegressor, PhysicsModel
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> t = np.linspace(0, 60, 601)
    >>> X = np.column_stack([t, np.sin(t)])
    >>> network = PGNNLRegressor(lag, max_epochs=1, refine=None).fit(X, lag.simulate(t, X[:, 1]).y)
    >>> [part.name for part in to_onnx(network).graph.input]
    ['x', 'u']
    """
    if not is_network(network):
        raise OptionError(
            f"to_onnx: expected a PGNNLRegressor, got {type(network).__name__}. Remedy: of a "
            f"pipeline give the network, pipeline[-1]; models go out by to_c or to_fmu."
        )
    if precision not in ("double", "single"):
        raise OptionError(f"precision: expected one of double, single, got {precision!r}.")
    check_is_fitted(network)
    with needed_by("to_onnx"):
        import onnx
    from sklearn_pgnn.export.c_network import exportable_step, refuse_other_interval

    step = exportable_step(network, "to_onnx")
    refuse_other_interval(network, interval)
    _refuse_events(step, prior_as_input)
    graph = _Step(network, step, interval or network.interval_, precision, prior_as_input)
    results = graph.write()
    model = onnx.helper.make_model(
        onnx.helper.make_graph(
            graph.nodes, "step", graph.inputs(onnx), graph.told(onnx, results), graph.constants
        ),
        opset_imports=[onnx.helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="sklearn_pgnn",
    )
    onnx.checker.check_model(model, full_check=True)
    return model


def _refuse_events(step: NetworkStep, prior_as_input: bool) -> None:
    if not step.needs_prior or prior_as_input:
        return
    dry = dry_friction(step.model).flows
    if dry:
        raise ModelError(
            f"to_onnx: the step of the model has events, for {str(dry[0])!r} has dry friction, "
            f"which a graph cannot express. Remedy: prior_as_input=True takes the model's step as "
            f"an input; to_c exports all of it."
        )


class _Step(Graph):
    """The graph of one step, with the width of each input by name."""

    def __init__(self, network, step: NetworkStep, interval, precision, prior_as_input):
        super().__init__(precision == "single")
        self.network, self.step, self.interval = network, step, float(interval)
        self.prior_as_input = prior_as_input
        self.sizes: dict[str, int] = {}

    def write(self) -> dict[str, Value]:
        """Write the whole step, and return its results by name."""
        step, nx = self.step, len(self.step.model.states)
        x, results = self.take("x", nx), {}
        u, u_next = self._inputs()
        prior = self._prior(x, u, u_next) if step.needs_prior else None
        z = (self._seen(x, u, u_next, prior) - step.mean[None]) / step.scale[None]
        if step.core == "recurrent":
            hidden = self.take("hidden", step.sizes[1])
            output, results["hidden_next"] = self._recur(z, hidden)
        else:
            output = self._forward(z)
        base = {"state": x, "prior": prior, "constant": step.offset[None]}[step.base]
        dt = self.interval
        gain = step.gain[0] + dt * (step.gain[1] + dt * step.gain[2])
        return {"x_next": base + output @ gain.T, **results}

    def take(self, name: str, size: int) -> Value:
        """Return an input of the graph."""
        self.sizes[name] = size
        return Value(self, name)

    def inputs(self, onnx) -> list:
        """Return the descriptions of the inputs."""
        return [self._described(onnx, name, size) for name, size in self.sizes.items()]

    def told(self, onnx, results: dict[str, Value]) -> list:
        """Name the results and return their descriptions."""
        sizes = {"x_next": len(self.step.model.states), "hidden_next": self.sizes.get("hidden", 0)}
        for name, value in results.items():
            self.nodes.append(onnx.helper.make_node("Identity", [value.name], [name]))
        return [self._described(onnx, name, sizes[name]) for name in results]

    def _described(self, onnx, name, size):
        kind = onnx.TensorProto.FLOAT if self.kind == np.float32 else onnx.TensorProto.DOUBLE
        return onnx.helper.make_tensor_value_info(name, kind, ["steps", size])

    def _inputs(self):
        """Return the inputs at both ends of the step, None if there are none."""
        count = len(self.step.model.inputs)
        if not count:
            return None, None
        u = self.take("u", count)
        return u, self.take("u_next", count) if self.step.hold == "foh" else u

    def _seen(self, x, u, u_next, prior) -> Value:
        """Return the features, before they are standardised."""
        step = self.step
        at = (x + prior) / 2.0 if step.middle else x
        seen = [at]
        if u is not None:
            seen.append(u if u is u_next else (u + u_next) / 2.0)
        if step.guide == "simulation":
            slope, offset = self.network.guide_line_
            simulated = self.take("simulated", len(step.model.states))
            seen.append(simulated * slope[None] + offset[None])
        elif step.guide == "step":
            seen.append((prior - x) / self.interval)
        elif step.guide == "terms":
            seen += self._terms(at, u)
        if self.network.further_columns_:
            seen.append(self.take("features", len(self.network.further_columns_)))
        return self.add("Concat", *seen, axis=1)

    def _terms(self, x, u) -> list[Value]:
        model = terms_model(self.step)
        if model is self.step.model:
            return []
        machine = SymbolicMachine(model, self.function)
        terms = machine.outputs(self._time(model), *self._parts(x, u))
        return [self._as_column(term, x) for term in terms]

    def _prior(self, x, u, u_next) -> Value:
        """Return the model's own step."""
        model, step = self.step.model, self.step
        if self.prior_as_input:
            return self.take("prior", len(model.states))
        machine = SymbolicMachine(model, self.function)
        columns, acting = self._parts(x, u)
        then = acting if u is u_next else self._parts(x, u_next)[1]
        moved = machine.next_sample(
            self._time(model), self.interval, step.substeps, columns, acting, then
        )
        return self.add("Concat", *(self._as_column(each, x) for each in moved), axis=1)

    def _parts(self, x, u) -> tuple[list[Value], list[Value]]:
        model = self.step.model
        acting = [] if u is None else self.columns(u, len(model.inputs))
        return self.columns(x, len(model.states)), acting

    def _time(self, model):
        return 0.0 if model.is_autonomous else self.take("t", 1)

    def _as_column(self, value, x: Value) -> Value:
        """Return a value as a column; a plain number is repeated in every row."""
        if isinstance(value, Value):
            return value
        return self.columns(x, len(self.step.model.states))[0] * 0.0 + value

    def _forward(self, z) -> Value:
        from sklearn_pgnn.export.c_network import layers_of

        layers = layers_of(self.step, self.network.module_.core)
        for layer in layers[:-1]:
            z = self._activated(z @ layer["weights"].T + layer["bias"])
        return z @ layers[-1]["weights"].T + layers[-1]["bias"]

    def _activated(self, v) -> Value:
        kind = self.step.activation
        if kind == "identity":
            return v
        if kind == "silu":
            return v * self.function("sigmoid")(v)
        return self.function(kind)(v)

    def _recur(self, z, hidden) -> tuple[Value, Value]:
        """Advance a gated recurrent unit, as in torch's GRUCell."""
        from sklearn_pgnn.export.c_network import unit_of

        unit = unit_of(self.step, self.network.module_.core)
        n = self.step.sizes[1]
        given = z @ unit["by_input"].T + unit["bias_input"]
        kept = hidden @ unit["by_hidden"].T + unit["bias_hidden"]
        sizes = self.constant(np.full(3, n, dtype=np.int64))
        reset_z, update_z, new_z = self.add_several("Split", [given, sizes], 3, axis=1)
        reset_h, update_h, new_h = self.add_several("Split", [kept, sizes], 3, axis=1)
        reset = self.function("sigmoid")(reset_z + reset_h)
        update = self.function("sigmoid")(update_z + update_h)
        new = self.function("tanh")(new_z + reset * new_h)
        following = (1.0 - update) * new + update * hidden
        return following @ unit["read"].T + unit["bias"], following
