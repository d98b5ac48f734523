"""A physical model as a value: names, units, parameters and equations kept symbolic.

Conventions, for the whole package: ``t`` is time [s], ``x`` the states, ``u`` the inputs, ``y``
the outputs and ``p`` the parameters; the last axis of an array is the quantity, the axes before it
are samples.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import sympy

from sklearn_pgnn.annotations import ArrayLike, FilePath
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.channel_kinds import check_channels
from sklearn_pgnn.physics.declared_ports import Ports, declared_in, read_let, read_ports
from sklearn_pgnn.physics.expressions import (
    RATE,
    TIME,
    symbol,
    to_text,
)
from sklearn_pgnn.physics.external import ExternalFunction, external_functions, require_equations
from sklearn_pgnn.physics.lagrangian import lagrangian_parts
from sklearn_pgnn.physics.mass_matrix import (
    BALANCES,
    balanced_changes,
    check_balance,
    check_matrix,
    solved_rates,
)
from sklearn_pgnn.physics.model_parts import (
    ENERGY_PARTS,
    EXPRESSIONS,
    as_expressions,
    as_mapping,
    as_parameters,
    as_simulation,
    as_state,
    as_text,
    as_units,
    check_columns,
    check_delays,
    check_inertia,
    check_keys,
    check_names,
    check_settled,
    check_size,
    entries_changed,
    parameter_dict,
    texts,
)
from sklearn_pgnn.physics.model_units import unit_of
from sklearn_pgnn.physics.parameter import Parameter, check_name
from sklearn_pgnn.physics.port import Port, with_coefficients
from sklearn_pgnn.readings import reading


@dataclass(frozen=True, eq=False, repr=False)
class PhysicsModel:
    r"""A machine as a set of ordinary differential equations.

    .. math:: \dot x = f(t, x, u, p), \qquad y = g(t, x, u, p)

    A model is a value: it is never changed in place, two models with the same content are equal,
    and ``model + effect`` is a new model.

    Parameters
    ----------
    states : mapping of str to str
        State names and their units, in order.
    equations : mapping of str to str or sympy.Expr
        Right-hand side of every state, over states, inputs, parameters and the time ``t``; of
        states with `forces` or `flows` it follows from these.
    parameters : mapping of str to Parameter, dict or float, or iterable of Parameter, default={}
        The constants of the equations.
    inputs : mapping of str to str, default={}
        Input names and their units.
    outputs : mapping of str to str or sympy.Expr, default: every state under its own name
        What the sensors measure, as expressions of states and inputs; ``der(v)`` stands for the
        rate of a state.
    name : str, default="model"
        Name of the model.
    inertia : mapping of str to str, sympy.Expr or list of them, default={}
        For a state that is a velocity, the mass or inertia that multiplies its rate; effects on
        this rate are then forces or torques. For velocities that act on each other, the rows of
        the mass matrix :math:`M`, with an entry for every velocity that has a row, in their order.
    forces : mapping of str to str or sympy.Expr, default={}
        For velocities with an inertia, the sum of forces or torques :math:`F`, in place of an
        equation: :math:`M \dot v = F`.
    capacity : mapping of str to str, sympy.Expr or list of them, default={}
        For a state that tells the content of a store (a temperature, a level, a pressure, a
        voltage, a current), the capacity :math:`C` that multiplies its rate, or the rows of a
        matrix.
    flows : mapping of str to str or sympy.Expr, default={}
        For states with a capacity, the sum of what flows in, in place of an equation:
        :math:`C \dot T = Q`.
    energy : mapping, default={}
        ``stored`` [J], ``supplied`` [W] and ``dissipated`` [W] as expressions.
    delays : mapping of str to str, default={}
        For a delayed input, the name of the parameter that holds its delay [s].
    initial_state : mapping of str to float, default: zeros
        State at the start of a trajectory that does not give its own.
    settled : mapping of str to str, default={}
        For a state that follows an input, such as that of an actuator, or another state, as a wall
        follows the air, the name of that one: a trajectory that does not give such a state starts
        it at the first value of the other.
    columns : mapping of str to str, default={}
        Column name of a quantity (also of ``t`` and ``trajectory``) in a table, where it is not the
        quantity's own name.
    channels : mapping of str to str, default={}
        What is known of an input (``"commanded"`` or ``"measured"``) or of the sensor of an output
        (``"encoder"``, ``"thermocouple"`` and others, see :ref:`channels`): a diagnosis looks only
        for faults that it can have. By default for all.
    simulation : mapping, default={}
        How the model is to be simulated: ``hold`` (``"zoh"`` or ``"foh"``, whether inputs are
        held or linearly interpolated between samples), ``substeps``, the number of integration
        steps per sample interval, and their ``method`` (``"rk4"``, or ``"rosenbrock"`` for stiff
        models).
    let : mapping of str to str or sympy.Expr, default={}
        Shared subexpressions: their names may stand in all equations and in those below them, and
        are written out when the model is made.
    ports : mapping of str to mapping or Port, default={}
        Where something can act, by name: the ``effort`` (an input, a name of `let`, or a name that
        only the equations have: nobody applies it, and it is 0) and its conjugate ``flow``, a state
        or a difference of two; optionally the ``displacement`` and the effort's ``unit``. In place
        of the effort, ``rates`` and ``outputs`` may give its coefficients. The model has those that
        it finds as well, see `port`.

    Raises
    ------
    ModelError
        If a name is used twice or unknown, an equation is missing or cannot be parsed, a mass
        matrix is not symmetric, or singular, or a port's effort is in no equation or enters one not
        linearly.

    Examples
    --------
    >>> model = PhysicsModel(
    ...     states={"x": "m", "v": "m/s"}, inputs={"F": "N"}, parameters={"m": 2.0, "k": 50.0},
    ...     equations={"x": "v", "v": "(F - k*x)/m"})
    >>> print(model.to_text())
    x' = v
    v' = (F - k*x)/m

    A trolley with a hanging load, by its mass matrix:

    >>> crane = PhysicsModel(
    ...     states={"x": "m", "q": "rad", "v": "m/s", "w": "rad/s"}, inputs={"F": "N"},
    ...     parameters={"M": 5.0, "m": 2.0, "l": 1.5, "g": 9.81},
    ...     equations={"x": "v", "q": "w"},
    ...     inertia={"v": ["M + m", "m*l*cos(q)"], "w": ["m*l*cos(q)", "m*l**2"]},
    ...     forces={"v": "F + m*l*w**2*sin(q)", "w": "-m*g*l*sin(q)"})
    >>> print(crane.equations["w"])
    (-g*(M + m)*sin(q) - (F + l*m*w**2*sin(q))*cos(q))/(l*(M - m*cos(q)**2 + m))
    """

    states: Mapping[str, str]
    equations: Mapping[str, sympy.Expr] = field(default_factory=dict)
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    inputs: Mapping[str, str] = field(default_factory=dict)
    outputs: Mapping[str, Any] = field(default_factory=dict)
    name: str = "model"
    inertia: Mapping[str, Any] = field(default_factory=dict)
    forces: Mapping[str, sympy.Expr] = field(default_factory=dict)
    capacity: Mapping[str, Any] = field(default_factory=dict)
    flows: Mapping[str, sympy.Expr] = field(default_factory=dict)
    energy: Mapping[str, sympy.Expr] = field(default_factory=dict)
    delays: Mapping[str, str] = field(default_factory=dict)
    initial_state: Mapping[str, float] = field(default_factory=dict)
    settled: Mapping[str, str] = field(default_factory=dict)
    columns: Mapping[str, str] = field(default_factory=dict)
    channels: Mapping[str, str] = field(default_factory=dict)
    simulation: Mapping[str, Any] = field(default_factory=dict)
    let: Mapping[str, Any] = field(default_factory=dict)
    ports: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        states = as_units("states", self.states)
        inputs = as_units("inputs", self.inputs or {})
        parameters = as_parameters(self.parameters or {})
        if not states:
            raise ModelError("expected at least one state, got none.", ("states",))
        check_names(states, inputs, parameters)
        check_size(states, parameters)
        for part in ("equations", *BALANCES, *BALANCES.values(), "initial_state"):
            check_keys(part, getattr(self, part), states)
        check_keys("energy", self.energy, ENERGY_PARTS)
        check_keys("delays", self.delays, inputs)
        check_keys("simulation", self.simulation, ("hold", "substeps", "method"))
        check_settled(self.settled, states, inputs)
        outputs = as_mapping("outputs", self.outputs or {name: name for name in states})
        for output in outputs:
            check_name(output, "output")
        check_delays(self.delays, parameters)
        check_columns(self.columns, states, inputs, outputs)
        names = (*states, *inputs, *parameters)
        declared = declared_in(self.ports)
        efforts = read_let(self.let, declared, names, inputs)
        check_channels(self.channels, inputs, outputs)
        known = efforts.names(names)
        given = {part: getattr(self, part) or {} for part in EXPRESSIONS if part != "outputs"}
        read = {part: as_expressions(part, e, known, efforts.let) for part, e in given.items()}
        check_inertia(read)
        for part in BALANCES:
            check_matrix(part, read[part], parameters)
        read["equations"] = _all_rates(read, states)
        rates = {f"{RATE}({state})": rate for state, rate in read["equations"].items()}
        read["outputs"] = as_expressions("outputs", outputs, known, {**efforts.let, **rates})
        values: dict[str, Any] = {
            "name": as_text(str(self.name), ("name",)),
            "states": MappingProxyType(states),
            "inputs": MappingProxyType(inputs),
            "parameters": MappingProxyType(parameters),
            **{part: MappingProxyType(items) for part, items in read.items()},
            "delays": MappingProxyType(dict(self.delays or {})),
            "initial_state": MappingProxyType(
                {s: as_state(s, dict(self.initial_state or {}).get(s, 0.0)) for s in states}
            ),
            "settled": MappingProxyType(dict(self.settled or {})),
            "columns": MappingProxyType(dict(self.columns or {})),
            "channels": MappingProxyType(dict(self.channels or {})),
            "simulation": MappingProxyType(as_simulation(self.simulation or {})),
        }
        ports = read_ports(declared, values, names, efforts)
        values |= {part: efforts.settled(values[part], names) for part in EXPRESSIONS}
        values |= {"let": MappingProxyType({}), "ports": Ports(ports, self)}
        for key, value in values.items():
            object.__setattr__(self, key, value)

    # -- names ---------------------------------------------------------------------------------

    @property
    def kinematic_pairs(self) -> dict[str, str]:
        """Map of velocity to position, where a state's rate is another state, bounded or not."""
        return dict(_kinematic_pairs(tuple(self.equations.items()), tuple(self.inputs)))

    @property
    def slope_pairs(self) -> dict[str, str]:
        """Map of velocity to position, where the rate of the position is the unbounded velocity.

        Examples
        --------
        >>> rod = PhysicsModel({"x": "m", "v": "m/s"}, {"x": "min(v, 0.1)", "v": "-x"})
        >>> rod.kinematic_pairs, rod.slope_pairs
        ({'v': 'x'}, {})
        """
        pairs = self.kinematic_pairs.items()
        return {v: position for v, position in pairs if self.equations[position] == symbol(v)}

    def port(self, name: str) -> Port:
        """Return a port of the model: a declared one, or one that it has without saying so.

        Every velocity is a port, with its `inertia`, and so is every other state that is no
        position. A declared port takes the place of one with the same flow.

        Parameters
        ----------
        name : str
            Its name; that of a state for a port that is not declared.

        Returns
        -------
        Port
            The port.

        Raises
        ------
        ModelError
            If the model has no such port.

        Examples
        --------
        >>> elbow = {"effort": "tau", "flow": "w"}
        >>> arm = PhysicsModel({"q": "rad", "w": "rad/s"}, {"q": "w", "w": "(tau - d*w)/J"},
        ...                    {"J": 2.0, "d": 0.1}, {"tau": "N m"}, ports={"elbow": elbow})
        >>> arm.port("elbow").rates, arm.port("elbow").displacement
        ({'w': 1/J}, q)
        """
        if name not in self.ports:
            raise ModelError(
                f"expected a port among {', '.join(self.ports) or 'none'}, got {name!r}. Remedy: "
                f"declare it in 'ports'.",
                ("ports",),
            )
        return self.ports[name]

    @property
    def declared_ports(self) -> dict[str, Port]:
        """Ports that the model declares."""
        return declared_in(self.ports)

    @property
    def kept_ports(self) -> dict[str, Port]:
        """Ports that a model made from this one keeps, since it could not find them again."""
        return self.ports.kept  # type: ignore[attr-defined]

    @property
    def is_autonomous(self) -> bool:
        """Whether equations and outputs do not contain the time ``t``.

        Examples
        --------
        >>> PhysicsModel({"y": "V"}, {"y": "-y + sin(t)"}).is_autonomous
        False
        """
        expressions = (*self.equations.values(), *self.outputs.values())
        return not any(expression.has(TIME) for expression in expressions)

    @property
    def opaque_functions(self) -> tuple[str, ...]:
        """Names of the functions without an equation that the model calls.

        Examples
        --------
        >>> PhysicsModel({"y": "V"}, {"y": "-y"}).opaque_functions
        ()
        """
        return tuple(dict.fromkeys(function.name for function in self._external))

    @property
    def _external(self) -> tuple[ExternalFunction, ...]:
        return external_functions(self._expressions)

    @property
    def _expressions(self) -> tuple[sympy.Basic, ...]:
        """Every expression of the model."""
        parts = (expression for part in EXPRESSIONS for expression in getattr(self, part).values())
        ports = self.declared_ports.values()
        return (*parts, *(expression for port in ports for expression in port.expressions()))

    def _given(self) -> dict[str, dict[str, Any]]:
        """Return the parts that are expressions, without the rates that follow from others."""
        parts = {part: dict(getattr(self, part)) for part in EXPRESSIONS}
        for other in BALANCES.values():
            for name in parts[other]:
                del parts["equations"][name]
        return parts

    @property
    def free_parameters(self) -> tuple[str, ...]:
        """Names of the parameters that may be re-tuned."""
        return tuple(name for name, p in self.parameters.items() if not p.fixed)

    @property
    def unused_parameters(self) -> tuple[str, ...]:
        """Names of the parameters on which nothing depends.

        Examples
        --------
        >>> PhysicsModel({"y": "V"}, {"y": "-y/T"}, {"T": 2.0, "K": 1.0}).unused_parameters
        ('K',)
        """
        used = {symbol.name for each in self._expressions for symbol in each.free_symbols}
        return tuple(name for name in self.parameters if name not in {*used, *self.delays.values()})

    def unit(self, name: str) -> str:
        """Return the unit of a state, an input, a parameter or an output.

        Parameters
        ----------
        name : str
            The quantity.

        Returns
        -------
        str
            Its unit; that of an output follows from its expression, and is empty where a number
            in it may be a conversion, or a quantity has no unit.

        Examples
        --------
        >>> cart = PhysicsModel({"v": "m/s"}, {"v": "F"}, inputs={"F": "N"},
        ...                     outputs={"speed": "abs(v)", "power": "F*v"})
        >>> cart.unit("speed"), cart.unit("power")
        ('m/s', 'W')
        """
        if name in self.parameters:
            return self.parameters[name].unit
        units = {**self.states, **self.inputs}
        return units[name] if name in units else self.unit_of(self.outputs.get(name))

    def unit_of(self, expression: sympy.Expr | None) -> str:
        """Return the unit of an expression of the model's quantities.

        A factor that is a sum with a number has no unit; a product with a number, which may be a
        conversion, and unknown units are reported as none.

        Parameters
        ----------
        expression : sympy.Expr or None
            An expression of states, inputs and parameters.

        Returns
        -------
        str
            Its unit.

        Examples
        --------
        >>> filling = PhysicsModel({"v": "m/s"}, {"v": "F/(m*(1 + w*t))"}, inputs={"F": "N"},
        ...     parameters={"m": {"value": 2.0, "unit": "kg"}, "w": 0.1},
        ...     inertia={"v": "m*(1 + w*t)"})
        >>> filling.unit_of(filling.inertia["v"])
        'kg'
        """
        return unit_of(expression, self.unit)

    # -- new models from this one ----------------------------------------------------------------

    def replace(self, **changes: Any) -> "PhysicsModel":
        """Return a copy of the model with some constructor parameters changed.

        Parameters
        ----------
        **changes
            Constructor parameters and their new values.

        Returns
        -------
        PhysicsModel
            A new model; this one is unchanged. Where rates are changed that follow from `forces` or
            `flows`, it has equations in place of these.
        """
        return replace(self, **balanced_changes(self, changes))

    def changed(self, change: Callable[[sympy.Expr], sympy.Expr]) -> dict[str, Any]:
        """Return the parts of the model that hold expressions, every one of them changed.

        Parameters
        ----------
        change : callable
            Takes an expression and returns another.

        Returns
        -------
        dict
            Constructor parameters of `PhysicsModel` and their new values.
        """
        parts: dict[str, Any] = {
            part: entries_changed(change, getattr(self, part)) for part in EXPRESSIONS
        }
        ports = self.kept_ports.items()
        return {**parts, "ports": {name: with_coefficients(port, change) for name, port in ports}}

    def with_parameters(self, **values: Any) -> "PhysicsModel":
        """Return the model with other parameter values.

        Parameters
        ----------
        **values : float or Parameter
            New value by parameter name.

        Returns
        -------
        PhysicsModel
            A new model; this one is unchanged.

        Raises
        ------
        ModelError
            If a name is unknown or a value lies outside its bounds.

        Examples
        --------
        >>> lag = PhysicsModel({"y": "V"}, {"y": "-y/T"}, {"T": 2.0})
        >>> lag.with_parameters(T=3.0).parameters["T"].value
        3.0
        """
        parameters = dict(self.parameters)
        for name, value in values.items():
            if name not in parameters:
                raise ModelError(
                    f"unknown parameter {name!r}; the model has {', '.join(parameters) or 'none'}."
                )
            new = value if isinstance(value, Parameter) else parameters[name].with_value(value)
            parameters[name] = new
        if any(isinstance(value, Parameter) for value in values.values()):
            return self.replace(parameters=parameters)
        return self._with_numbers(MappingProxyType(parameters))

    def _with_numbers(self, parameters: Mapping[str, Parameter]) -> "PhysicsModel":
        """Return the model with the same parameters at other values, without further checks."""
        model = object.__new__(type(self))
        kept = {f.name: getattr(self, f.name) for f in fields(self)}
        model.__dict__.update(kept, parameters=parameters)
        return model

    def __add__(self, effect: Any) -> "PhysicsModel":
        apply = getattr(effect, "apply", None)
        return NotImplemented if apply is None else apply(self)

    # -- text --------------------------------------------------------------------------------------

    def to_text(self) -> str:
        """Write the equations as plain text, one line per state."""
        return "\n".join(f"{state}' = {to_text(rate)}" for state, rate in self.equations.items())

    def to_latex(self) -> str:
        r"""Write the equations as LaTeX.

        Returns
        -------
        str
            An ``aligned`` block, to be put between ``\[`` and ``\]``.
        """
        lines = [
            rf"\dot{{{sympy.latex(symbol(state))}}} &= {sympy.latex(rate)}"
            for state, rate in self.equations.items()
        ]
        return "\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}"

    def to_dict(self) -> dict:
        """Write the whole model as plain data, as a model file holds it.

        Returns
        -------
        dict
            Data that `from_dict` reads.

        Raises
        ------
        ModelError
            If the model calls a function without an equation.
        """
        require_equations(self, "to_dict")
        return self._parts()

    def _parts(self) -> dict:
        """Return everything the model states, its expressions as text."""
        said = {part: texts(items) for part, items in self._given().items()}
        parts = {
            "name": self.name,
            "states": dict(self.states),
            "inputs": dict(self.inputs),
            "outputs": said.pop("outputs"),
            "parameters": {name: parameter_dict(p) for name, p in self.parameters.items()},
            **said,
            "delays": dict(self.delays),
            "initial_state": {s: v for s, v in self.initial_state.items() if v},
            "settled": dict(self.settled),
            "columns": dict(self.columns),
            "channels": dict(self.channels),
            "simulation": dict(self.simulation),
            "ports": self.ports.parts(),  # type: ignore[attr-defined]
        }
        return {key: part for key, part in parts.items() if part}

    @classmethod
    def from_dict(cls, data: Mapping) -> "PhysicsModel":
        """Build a model from plain data.

        Parameters
        ----------
        data : mapping
            Data as returned by `to_dict`; equations are parsed by a whitelist, never evaluated.

        Returns
        -------
        PhysicsModel
            The model.

        Raises
        ------
        ModelError
            If a key is unknown or missing, or an entry is not valid in a model.
        """
        known = [f.name for f in fields(cls)]
        unknown = [key for key in data if key not in (*known, "lagrangian")]
        if unknown:
            raise ModelError(
                f"unknown key {unknown[0]!r}; expected one of {', '.join(known)}.", (unknown[0],)
            )
        if "states" not in data:
            raise ModelError(f"expected the key 'states', got {', '.join(data) or 'none'}.")
        if "lagrangian" not in data:
            return cls(**data)
        others = {key: part for key, part in data.items() if key != "lagrangian"}
        return cls(**lagrangian_parts(data["lagrangian"], others))

    @classmethod
    def from_lagrangian(
        cls,
        coordinates: Mapping[str, str],
        kinetic: str | sympy.Expr,
        potential: str | sympy.Expr = 0,
        dissipation: str | sympy.Expr = 0,
        forces: Mapping[str, str | sympy.Expr] | None = None,
        *,
        states: Mapping[str, str],
        **model: Any,
    ) -> "PhysicsModel":
        r"""Build a model from its energies.

        .. math:: \frac{d}{dt} \frac{\partial T}{\partial v} - \frac{\partial T}{\partial q}
                  + \frac{\partial V}{\partial q} + \frac{\partial D}{\partial v} = Q,
                  \qquad v = \dot q

        Inertia, forces and energy of the model follow: the mass matrix is the Hessian of the
        kinetic energy, and :math:`T + V` is stored. Without supplied power the model is passive
        where the dissipated power is nowhere negative.

        Parameters
        ----------
        coordinates : mapping of str to str
            For every coordinate :math:`q` its velocity :math:`v`; both are states.
        kinetic : str or sympy.Expr
            Kinetic energy :math:`T` [J] over coordinates, velocities and parameters. In text,
            ``der(z)`` is the velocity of a place ``z`` of `let`.
        potential : str or sympy.Expr, default=0
            Potential energy :math:`V` [J] over coordinates, inputs and parameters.
        dissipation : str or sympy.Expr, default=0
            Dissipation function :math:`D` [W]; Rayleigh's for viscous friction, such as
            ``d*v**2/2``, and ``F*abs(v)`` for Coulomb friction.
        forces : mapping of str to str or sympy.Expr, default={}
            By coordinate, the generalised force :math:`Q` [N] or torque [N m], over all quantities.
        states : mapping of str to str
            State names and their units, in order.
        **model
            Further constructor parameters; `equations` for states that are no coordinates.

        Returns
        -------
        PhysicsModel
            The model.

        Raises
        ------
        ModelError
            If an energy contains what it cannot, or the kinetic energy leaves a coordinate without
            inertia.

        Examples
        --------
        >>> pendulum = PhysicsModel.from_lagrangian(
        ...     {"q": "w"}, "m*l**2*w**2/2", "-m*g*l*cos(q)", "d*w**2/2", {"q": "M"},
        ...     states={"q": "rad", "w": "rad/s"}, inputs={"M": "N m"},
        ...     parameters={"m": 2.0, "l": 1.5, "g": 9.81, "d": 0.1})
        >>> print(pendulum.to_text())
        q' = w
        w' = (M - d*w - g*l*m*sin(q))/(l**2*m)
        >>> print(*pendulum.energy.values(), sep="; ")
        -g*l*m*cos(q) + l**2*m*w**2/2; M*w; d*w**2
        """
        section = {
            "coordinates": coordinates,
            "kinetic": kinetic,
            "potential": potential,
            "dissipation": dissipation,
            "forces": forces,
        }
        return cls(**lagrangian_parts(section, {"states": states, **model}))

    @classmethod
    def from_yaml(cls, path: FilePath) -> "PhysicsModel":
        """Read a model file.

        Parameters
        ----------
        path : str or path-like
            The YAML file.

        Returns
        -------
        PhysicsModel
            The model.

        Raises
        ------
        ModelError
            If the file is not a valid model; the message gives file, line and column.
        """
        return reading("read_model")(path)

    def to_yaml(self, path: FilePath | None = None) -> str:
        """Write the model as a model file.

        Parameters
        ----------
        path : str or path-like, optional
            File to write; by default none is written.

        Returns
        -------
        str
            The YAML text.
        """
        return reading("write_model")(self, path)

    # -- readings --------------------------------------------------------------------------------

    def simulate(
        self, t: ArrayLike, u: ArrayLike | None = None, x0: ArrayLike | None = None, **options: Any
    ) -> Any:
        """Simulate the model at given sample times.

        Parameters
        ----------
        t : array-like of shape (n_samples,)
            Time [s], increasing.
        u : array-like of shape (n_samples, n_inputs) or (n_samples,), optional
            Inputs; not needed for a model without inputs.
        x0 : array-like of shape (n_states,), optional
            Initial state; by default the model's `initial_state`, and for `settled` states the
            first value of their inputs.
        **options
            See `sklearn_pgnn.simulation.simulate`.

        Returns
        -------
        Simulation
            States and outputs at the samples of `t`.
        """
        return reading("simulate")(self, t, u, x0, **options)

    # -- a value ---------------------------------------------------------------------------------

    def __getstate__(self) -> dict[str, Any]:
        if not self._external:
            return self._parts()
        return self._parts() | self._given() | {"ports": self.declared_ports}

    def __setstate__(self, state: dict[str, Any]) -> None:
        type(self).__init__(self, **state)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PhysicsModel):
            return NotImplemented
        return self.content() == other.content()

    def __hash__(self) -> int:
        return hash(self.content())

    def content(self) -> str:
        """Return everything the model states, in its order, which is that of arrays; cached.

        Returns
        -------
        str
            Models are equal if their contents are; a function without an equation is represented
            by its code and the data that it holds.

        Examples
        --------
        >>> PhysicsModel({"y": "V"}, {"y": "-y"}).content()
        "{'name': 'model', 'states': {'y': 'V'}, 'outputs': {'y': 'y'}, 'equations': {'y': '-y'}}"
        """
        if "_written" not in self.__dict__:
            tokens = "".join(function.token for function in self._external)
            object.__setattr__(self, "_written", repr(self._parts()) + tokens)
        return self.__dict__["_written"]

    def __repr__(self) -> str:
        return f"<PhysicsModel {self.name!r}: {', '.join(self.states)}>"

    def _repr_html_(self) -> str:
        return reading("model_html")(self)

    def _repr_latex_(self) -> str:
        return reading("model_latex")(self)


def _all_rates(read: Mapping[str, Any], states: Iterable[str]) -> dict[str, sympy.Expr]:
    """Return the rates of all states: those given, and those that follow from a balance."""
    rates = dict(read["equations"])
    for part, other in BALANCES.items():
        check_balance(part, read[part], read[other], rates)
        rates |= solved_rates(read[part], read[other])
    check_keys("equations", rates, states, complete=True)
    return {state: rates[state] for state in states}


@lru_cache(maxsize=1024)
def _kinematic_pairs(
    equations: tuple[tuple[str, sympy.Expr], ...], inputs: tuple[str, ...]
) -> dict[str, str]:
    states = dict(equations)
    moving, found = {symbol(name) for name in (*states, *inputs)}, {}
    for position, rate in equations:
        rates = [part for part in _compared(rate) if part.free_symbols & moving]
        if len(rates) == 1 and rates[0].is_Symbol and rates[0].name in states:
            found[rates[0].name] = position
    return found


def _compared(rate: sympy.Expr) -> list[sympy.Expr]:
    """Return the arguments of nested maxima and minima, else the rate itself."""
    if isinstance(rate, sympy.Max | sympy.Min):
        return [leaf for part in rate.args for leaf in _compared(part)]
    return [rate]
