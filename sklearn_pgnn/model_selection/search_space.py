"""Default search spaces of the estimators, as dimensions for `BayesSearchCV`."""

from functools import singledispatch
from inspect import signature

from sklearn.base import clone

from sklearn_pgnn.exceptions import ModelWarning, OptionError
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.user_line import warn_user

#: weights of the physical loss that a search chooses from, fewer than for a Pareto front;
#: a logarithmic range would lack 0, which often is the best
SEARCHED_LAMBDAS = (0.0, 0.001, 0.01, 0.1, 0.3, 0.9)


def search_space(estimator, **changes) -> dict:
    r"""Return the dimensions of a search with scikit-optimize's `BayesSearchCV`.

    They follow from the parameters that an estimator has, whether it is alone, in a `Pipeline`,
    or inside another estimator such as `ResidualRegressor`. The network of a `GreyBoxRegressor`
    has the prior as its model, and is the default network if ``network`` is None; it is not
    searched if none of the depths is a network.

    =================  =====================================================  ====================
    short name         dimension                                              estimator
    =================  =====================================================  ====================
    ``neurons``        3 to 20                                                `PGNNLRegressor`
    ``layers``         1 or 2, where the core has layers
    ``lr``             0.001 to 0.03, logarithmic
    ``lambda_phy``     0 (no physical loss), 0.001, 0.01, 0.1, 0.3 or 0.9,
                       where there is an energy or another physical loss
    ``structure``      ``"output"``, ``"increment"`` or ``"correction"``,
                       where there is a model and no other parameter asks
                       for a structure
    ``horizon``        1, 20 or 50
    ``threshold``      0.0005 to 0.1, logarithmic                             `SINDYcRegressor`
    ``library``        polynomials, sines and cosines or, where there is a
                       model, its own terms
    =================  =====================================================  ====================

    A category of `BayesSearchCV` is a single name or number; a combination of several libraries
    cannot be one.

    Parameters
    ----------
    estimator : estimator
        Estimator to tune.
    **changes
        Other dimensions by short name or by an estimator's full parameter name, in any form that
        `BayesSearchCV` takes; None leaves a dimension out.

    Returns
    -------
    dict of str to Dimension
        Dimensions by full parameter name.

    Raises
    ------
    ImportError
        If scikit-optimize is not installed.
    ValueError
        If a change names no parameter, of the estimators inside and of a network's core either, or
        nothing is left to search.

    Warns
    -----
    ModelWarning
        If a network's ``lambda_phy`` is left out because it has no physical loss;
        ``lambda_phy=None`` says so without a warning.

    Examples
    --------
    >>> from sklearn.linear_model import Ridge
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn_pgnn import PhysicsModelTransformer, systems
    >>> pipeline = make_pipeline(PhysicsModelTransformer(systems.golf_robot()), Ridge())
    >>> search_space(pipeline, ridge__alpha=(1e-6, 1e3, "log-uniform"))
    {'ridge__alpha': (1e-06, 1000.0, 'log-uniform')}
    """
    known = _dimensions_of(estimator)
    if "lambda_phy" not in changes:
        _warn_of_no_energy(estimator)
    parameters = estimator.get_params()
    for name, dimension in changes.items():
        places = [full for short, full in known if short == name]
        parts = _parts(estimator).values()
        is_there = any(name in part.get_params(deep=False) for part in parts)
        if dimension is None and not places and is_there:
            continue  # it is left out already
        if not places and name not in parameters and name.partition("__")[0] not in parameters:
            shorts = ", ".join(dict.fromkeys(short for short, _ in known)) or "none"
            raise ValueError(
                f"{name}: expected a dimension's short name ({shorts}) or a parameter of "
                f"{type(estimator).__name__} such as 'step__name'."
            )
        refuse_unknown_names(estimator, places or [name])
        known |= {(name, full): dimension for full in places or [name]}
    space = {full: dimension for (_, full), dimension in known.items() if dimension is not None}
    if not space:
        raise ValueError(
            f"{type(estimator).__name__} has no parameter that is searched by default. Remedy: "
            f"name what to search, as in search_space(pipeline, ridge__alpha=(1e-6, 1e3))."
        )
    return space


def refuse_unknown_names(estimator, names) -> None:
    """Refuse full names that are no parameters of an estimator, as far as nothing is replaced."""
    names, parts = list(names), _parts(estimator)
    for name in names:
        if any(name.startswith(f"{other}__") for other in names):
            continue
        try:
            clone(estimator).set_params(**{name: None})
        except (AttributeError, TypeError, ValueError) as error:
            raise OptionError(
                f"{name}: expected a parameter of {type(estimator).__name__}, got one that it does "
                f"not take: {error} Remedy: its get_params() lists them."
            ) from None
        prefix, inside, own = name.rpartition("module__")
        module = getattr(parts.get(prefix), "module", None) if inside else None
        if isinstance(module, type):
            _refuse_unknown_of_core(module, name, own)


def _refuse_unknown_of_core(module: type, name: str, own: str) -> None:
    """Refuse a name that is no parameter of the core of a network inside."""
    known = signature(module).parameters
    if own not in known and not any(each.kind is each.VAR_KEYWORD for each in known.values()):
        raise OptionError(
            f"{name}: expected a parameter of the core {module.__name__}, one of "
            f"{', '.join(each for each in known if each not in ('n_inputs', 'n_outputs'))}, "
            f"got {own!r}."
        )


def _dimensions_of(estimator) -> dict:
    """Return the dimensions of an estimator and of all inside it, by short and full name."""
    found = {}
    for prefix, part in _parts(estimator).items():
        parameters = part.get_params(deep=False)
        for own, dimension in {**_network(parameters), **_sparse(parameters)}.items():
            found[own.removeprefix("module__"), prefix + own] = dimension
    return found


def _parts(estimator) -> dict:
    """Return the estimator and every one inside it, by the prefix of its parameters."""
    parts = {"": estimator}
    for name, part in estimator.get_params().items():
        if hasattr(part, "get_params") and not isinstance(part, type):
            parts[f"{name}__"] = part
    for prefix, part in list(parts.items()):
        parts |= {f"{prefix}{name}__": own for name, own in searched_parts(part).items()}
    unused = tuple(prefix for prefix, part in parts.items() if part is None)
    return {prefix: part for prefix, part in parts.items() if not prefix.startswith(unused)}


@singledispatch
def searched_parts(estimator) -> dict:
    """Return the estimators inside another one as it fits them, None for one that it never does."""
    return {}


def _network(parameters) -> dict:
    """Return the dimensions of a network with a physical loss."""
    if "lambda_phy" not in parameters:
        return {}
    space, model = _import_space(), parameters.get("model")
    core = signature(parameters["module"]).parameters
    wanted = {
        "module__neurons": ("neurons" in core, space.Integer(3, 20)),
        "module__layers": ("layers" in core, space.Integer(1, 2)),
        "lr": (True, space.Real(1e-3, 3e-2, prior="log-uniform")),
        "lambda_phy": (_has_physical_loss(parameters), space.Categorical(list(SEARCHED_LAMBDAS))),
        "structure": (model is not None, _structures(parameters, space)),
        "horizon": (True, space.Categorical([1, 20, 50])),
    }
    return {name: dimension for name, (there, dimension) in wanted.items() if there}


def _has_physical_loss(parameters) -> bool:
    """Return whether a network has an energy balance or another physical loss."""
    energy = getattr(parameters.get("model"), "energy", None)
    return bool(energy) or parameters.get("physics_loss") is not None


def _warn_of_no_energy(estimator) -> None:
    """Warn where the weight of a physical loss is not searched, for there is none."""
    for prefix, part in _parts(estimator).items():
        parameters = part.get_params(deep=False)
        if "lambda_phy" in parameters and not _has_physical_loss(parameters):
            model = parameters.get("model")
            lacks = "there is no model" if model is None else f"{model.name!r} has no energy"
            warn_user(
                f"{prefix}lambda_phy: left out of the search, for {lacks} and no other physical "
                f"loss is given. Remedy: 'energy' in the model, physics_loss=..., or lambda_phy="
                f"None to leave it out.",
                ModelWarning,
            )


def _structures(parameters, space):
    """Return the structures to choose from; None if another parameter requires one.

    Only certain structures are passive, tune the model or correct some of its states.
    """
    passive = parameters["structure"] == "dissipative"
    if passive or parameters["free"] or parameters["corrects"] is not None:
        return None
    return space.Categorical(["output", "increment", "correction"])


def _sparse(parameters) -> dict:
    """Return the dimensions of a sparse regression over a library."""
    if not {"threshold", "library"} <= set(parameters):
        return {}
    space = _import_space()
    libraries = ["polynomial", "fourier"]
    own = [] if parameters.get("model") is None else ["model"]
    found = {"library": space.Categorical(libraries + own)}
    if parameters.get("optimizer") is None:  # one's own has a threshold of its own
        found["threshold"] = space.Real(5e-4, 0.1, prior="log-uniform")
    return found


def _import_space():
    """Import scikit-optimize's dimensions."""
    with needed_by("search_space"):
        from skopt import space
    return space
