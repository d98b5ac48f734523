"""Models and networks as C99, for a microcontroller or another tool."""

from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.export.c_machine import machine_of, render
from sklearn_pgnn.physics.model import PhysicsModel


def to_c(
    model,
    interval: float,
    *,
    precision: str = "double",
    parameters: str = "constants",
    name: str | None = None,
    method: str = "rk4",
    substeps: int | None = None,
    hold: str | None = None,
) -> str:
    r"""Write a model as one file of C99 that gives the numbers of `simulate`.

    The file holds the state as a struct and three functions: ``NAME_start`` sets the initial state,
    ``NAME_output`` gives the outputs :math:`y_k = g(t_k, x_k, u_k)` and ``NAME_step`` advances
    :math:`x_k` to :math:`x_{k+1}`. It needs no heap and no library but ``math.h``. Whatever the
    compiled simulation does is there: dry friction that sticks, late inputs, substeps, and inputs
    that are held or run straight.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    interval : float
        Time from sample to sample [s].
    precision : {"double", "single"}, default="double"
        ``double`` or ``float`` for every number.
    parameters : {"constants", "struct"}, default="constants"
        Whether the parameters are constants in the equations, or a struct that is given to every
        call and may be changed while the program runs; delays are constants in either case.
    name : str, optional
        What all names in the file begin with; by default the model's name.
    method : {"rk4", "euler"}, default="rk4"
        Runge-Kutta scheme of order four, or explicit Euler.
    substeps : int, optional
        Integration steps from one sample to the next; by default as the model's `simulation` says,
        else 1.
    hold : {"zoh", "foh"}, optional
        Whether an input is held between two samples or runs straight from one to the next; by
        default as the model's `simulation` says, else held.

    Returns
    -------
    str
        The file's text.

    Raises
    ------
    OptionError
        If `model` is no model or an option is none of what it can be.
    ModelError
        If a number of the model does not fit into single precision.

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
    options = {
        "precision": precision,
        "parameters": parameters,
        "name": name,
        "method": method,
        "substeps": substeps,
        "hold": hold,
    }
    if not isinstance(model, PhysicsModel):
        raise OptionError(
            f"to_c: expected a PhysicsModel, got {type(model).__name__}. Remedy: of what was "
            f"fitted give the model, as diagnosis.extended_model_ or regressor.model_."
        )
    return render("machine.c.j2", machine_of(model, interval, **options).content())
