"""A trained network as one C99 file."""

from itertools import pairwise
from typing import Any

import numpy as np

from sklearn_pgnn.estimators.network.sample_interval import (
    holds_at_one_interval,
    is_other_interval,
)
from sklearn_pgnn.estimators.network.step_network import is_compiled, step_with, weights_of
from sklearn_pgnn.exceptions import ModelError, OptionError
from sklearn_pgnn.export.assignments import outputs_of
from sklearn_pgnn.export.c_machine import Machine, machine_of
from sklearn_pgnn.simulation.network_run import NetworkStep, terms_model
from sklearn_pgnn.trajectories.clock import check_sample_interval

#: activations of hidden neurons, as the compiled loop computes them
_ACTIVATIONS = {
    "tanh": "1 - 2/({exp}(2*v) + 1)",
    "relu": "v > 0 ? v : 0",
    "silu": "v/(1 + {exp}(-v))",
    "sigmoid": "1/(1 + {exp}(-v))",
    "identity": "v",
}


def network_content(network, interval, *, precision: str, name: str | None) -> dict[str, Any]:
    """Return the variables of the template, by default for the training's interval [s]."""
    step = exportable_step(network, "to_c")
    refuse_other_interval(network, interval)
    machine = machine_of(
        step.model,
        network.interval_ if interval is None else interval,
        precision=precision,
        parameters="constants",
        name=name,
        method="rk4",
        substeps=step.substeps,
        hold=step.hold,
    )
    needs = step.needs_prior or step.guide == "simulation"
    content = machine.content(with_rates=needs) | _numbers(machine, network, step)
    terms = _terms(machine, step)
    uses_time = content["uses_time"] or bool(terms and "t" not in terms["unused"])
    further = {
        "title": f"{content['title']}, a network in feedback",
        "steps_model": needs,
        "keeps_side": False,
        "terms": terms,
        "guide": step.guide,
        "base": step.base,
        "middle": step.middle,
        "uses_time": uses_time,
        "time": machine.time() if uses_time else "0",
        "features": len(network.further_columns_),
    }
    return content | further


def refuse_other_interval(network, interval) -> None:
    """Refuse a sample interval at which a network does not hold.

    A map from one sample to the next holds at that of its training only; None stands for that.
    """
    if interval is None:
        return
    check_sample_interval(interval)
    own = network.interval_
    is_map = holds_at_one_interval(network.structure_, network.module_.core)
    if is_map and is_other_interval(interval, own):
        raise OptionError(
            f"interval: expected {own:g} s, the sample interval of the training, for the network "
            f"(structure={network.structure_!r}) is a map from one such sample to the next, got "
            f"{interval:g} s. Remedy: leave it out, and step every {own:g} s; or train on records "
            f"resampled to {interval:g} s, or with structure='correction' and a FeedForward core."
        )


def exportable_step(network, what: str) -> NetworkStep:
    """Return the elements of a trained network's step, or refuse one that a task cannot do with."""
    if getattr(network, "model_", None) is None or not hasattr(network, "step_"):
        raise ModelError(
            f"{what}: expected a network that is trained on trajectories, got one without. "
            f"Remedy: fit it to X with a time, then export."
        )
    core = network.module_.core
    if not is_compiled(core):
        raise ModelError(
            f"{what}: the core {type(core).__name__} has no form there. Remedy: train with "
            f"module=FeedForward or module=Recurrent."
        )
    if network.step_.loss:
        raise ModelError(
            f"{what}: the step of structure='dissipative' has no form there. Remedy: train with "
            f"structure='correction', or take the network itself as a step, network.stepper()."
        )
    return step_with(core, network.step_)


def _terms(machine: Machine, step: NetworkStep) -> dict | None:
    """Return the function of the terms that the network receives."""
    model = terms_model(step)
    if model is step.model:
        return None
    own = step.model.parameters
    values = {name: p.value for name, p in model.parameters.items() if name not in own}
    return machine.written(outputs_of(model), values)


def _numbers(machine: Machine, network, step: NetworkStep) -> dict[str, Any]:
    """Return all numbers that are fixed by the training."""

    def written(values):
        values = np.asarray(values, dtype=float)
        if values.ndim == 1:
            return [machine.printer.number(value) for value in values]
        return [written(row) for row in values]

    dt = machine.interval
    suffix = "f" if machine.precision == "single" else ""
    gain = step.gain[0] + dt * (step.gain[1] + dt * step.gain[2])
    recurrent = step.core == "recurrent"
    parts = unit_of(step, network.module_.core) if recurrent else {}
    layers = [] if recurrent else layers_of(step, network.module_.core)
    return {
        "n_seen": len(step.mean),
        "n_out": step.n_network_outputs,
        "mean": written(step.mean),
        "scale": written(step.scale),
        "gain": written(gain),
        "offset": written(step.offset),
        "lowest": written(step.reach[0]),
        "highest": written(step.reach[1]),
        "guide_line": list(zip(*map(written, network.guide_line_), strict=True)),
        "identity": (machine.printer.number(1.0), machine.printer.number(0.0)),
        "interval_number": machine.printer.number(dt),
        "hidden": step.sizes[1] if recurrent else 0,
        "unit": {name: written(values) for name, values in parts.items()},
        "layers": [{name: written(values) for name, values in each.items()} for each in layers],
        "activation": _ACTIVATIONS[step.activation].format(exp=f"exp{suffix}"),
        "exp": f"exp{suffix}",
        "tanh": f"tanh{suffix}",
    }


def layers_of(step: NetworkStep, core) -> list[dict[str, np.ndarray]]:
    """Return the ``weights`` and ``bias`` of a feed-forward network, layer by layer."""
    found, place, theta = [], 0, weights_of(core)
    for n_in, n_out in pairwise(step.sizes):
        bias = place + n_in * n_out
        weights = theta[place:bias].reshape(n_out, n_in)
        found.append({"weights": weights, "bias": theta[bias : bias + n_out]})
        place = bias + n_out
    return found


def unit_of(step: NetworkStep, core) -> dict[str, np.ndarray]:
    """Return the weights of a recurrent network by name, as the template has them."""
    n_in, n, n_out = step.sizes
    shapes = {
        "by_input": (3 * n, n_in),
        "by_hidden": (3 * n, n),
        "bias_input": (3 * n,),
        "bias_hidden": (3 * n,),
        "read": (n_out, n),
        "bias": (n_out,),
    }
    ends = np.cumsum([np.prod(shape) for shape in shapes.values()])
    pieces = np.split(weights_of(core), ends[:-1])
    return {name: part.reshape(shapes[name]) for name, part in zip(shapes, pieces, strict=True)}
