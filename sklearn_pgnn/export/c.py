"""Models and networks as C99, for a microcontroller or another tool."""

import sys
from typing import Any

from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.export.c_machine import machine_of, render
from sklearn_pgnn.physics.model import PhysicsModel


def to_c(
    model: Any,
    interval: float | None = None,
    *,
    precision: str = "double",
    parameters: str = "constants",
    name: str | None = None,
    method: str = "rk4",
    substeps: int | None = None,
    hold: str | None = None,
) -> str:
    r"""Write a model or a trained network as one C99 file that reproduces Python's numbers.

    The file holds the state as a struct and three functions: ``NAME_start`` sets the initial state,
    ``NAME_output`` gives the outputs :math:`y_k = g(t_k, x_k, u_k)` and ``NAME_step`` advances
    :math:`x_k` to :math:`x_{k+1}`. It needs no heap and no library but ``math.h``. All features of
    the compiled simulation are included: dry friction that sticks, delayed inputs, substeps, and
    inputs that are held or interpolated linearly. A network runs in free-run simulation, as in
    ``predict``; ``NAME_step`` returns whether the states are in reach of the training data, and
    keeps the last ones that were.

    Parameters
    ----------
    model : PhysicsModel or PGNNLRegressor
        The model, or a trained network with one of the package's own cores.
    interval : float, optional
        Sample interval [s]; for a network by default that of its training data.
    precision : {"double", "single"}, default="double"
        ``double`` or ``float`` for every number.
    parameters : {"constants", "struct"}, default="constants"
        Whether the parameters are constants in the equations, or a struct that is passed to every
        call and may be changed at run time; delays are constants in either case, and so are all
        numbers of a network.
    name : str, optional
        Prefix of all names in the file; by default the model's name.
    method : {"rk4", "euler"}, default="rk4"
        Runge-Kutta scheme of order four, or explicit Euler.
    substeps : int, optional
        Integration steps per sample interval; by default as given by the model's `simulation`,
        else enough for explicit steps to be stable at its initial state.
    hold : {"zoh", "foh"}, optional
        Whether inputs are held or linearly interpolated between samples; by default as given by
        the model's `simulation`, else held. For a network, method, substeps and hold are those of
        its training.

    Returns
    -------
    str
        The file's text.

    Raises
    ------
    OptionError
        If `model` is neither, or an option has an invalid value.
    ModelError
        If a number does not fit into single precision, or a network has a user-defined core.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"}, name="lag")
    >>> text = to_c(lag, interval=0.01)
    >>> print(*(line for line in text.splitlines() if line.startswith("void")), sep=chr(10))
    void lag_start(lag_machine *machine, const double u[1]);
    void lag_output(const lag_machine *machine, const double u[1], double y[1]);
    void lag_step(lag_machine *machine, const double u[1]);
    void lag_start(lag_machine *machine, const double u[1])
    void lag_output(const lag_machine *machine, const double u[1], double y[1])
    void lag_step(lag_machine *machine, const double u[1])
    """
    settled = {"parameters": parameters, "method": method, "substeps": substeps, "hold": hold}
    if is_network(model):
        _refuse_other_than({"parameters": "constants", "method": "rk4"}, settled)
        check_is_fitted(model)
        from sklearn_pgnn.export.c_network import network_content

        content = network_content(model, interval, precision=precision, name=name)
        return render("network.c.j2", content)
    if not isinstance(model, PhysicsModel):
        raise OptionError(
            f"to_c: expected a PhysicsModel or a PGNNLRegressor, got {type(model).__name__}. "
            f"Remedy: of what was fitted give the model, as diagnosis.extended_model_ or "
            f"regressor.model_, and of a pipeline the network, pipeline[-1]."
        )
    machine = machine_of(model, interval, precision=precision, name=name, **settled)
    return render("machine.c.j2", machine.content())


def is_network(model) -> bool:
    """Return whether something is a network of the package, without importing torch."""
    room = sys.modules.get("sklearn_pgnn.estimators.pgnnl")
    return room is not None and isinstance(model, room.PGNNLRegressor)


def _refuse_other_than(usual: dict, settled: dict) -> None:
    """Refuse options that are fixed by a network's training."""
    for option, value in settled.items():
        if value != usual.get(option):
            raise OptionError(
                f"{option}: expected no value, since it is fixed by the training of the network, "
                f"got {value!r}."
            )
