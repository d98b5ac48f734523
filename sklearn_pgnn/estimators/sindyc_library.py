r"""Libraries, the candidate terms :math:`\Psi(x, u)`, and the sparse regression on them.

Whatever a library is given as (a name, text, the terms of a model, an object of pysindy), it
becomes a list of symbolic terms, so that the identified model can be simulated, printed and saved.

The regression is scaled so that a threshold has a meaning. With the terms :math:`\Psi` divided by
their root mean squares and the target by its standard deviation :math:`\sigma`, a coefficient is
the share of the target's motion that its term makes up:

.. math:: \theta_{ij} = \Xi_{ij}\, \mathrm{rms}(\Psi_j) / \sigma_i
"""

import copy
import re
import warnings
from collections.abc import Sequence
from itertools import combinations_with_replacement

import numpy as np
import sympy
from sklearn import config_context
from sklearn.base import clone

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.physics.expressions import parse_expression, standard_form, symbol, to_text
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.network_run import model_terms
from sklearn_pgnn.simulation.pointwise import numpy_function
from sklearn_pgnn.trajectories.triangle import blocks, triangle

#: a blank between two factors, as pysindy writes a product
_PRODUCT = re.compile(r"(?<=[\w)]) +(?=[\w(])")
#: points at which a term read from its name is compared with pysindy's own value
POINTS = 16
#: a target whose variation is below this share of its root mean square counts as constant
STILL = 1e-9


def read_library(
    library, names: Sequence[str], degree: int = 2, model: PhysicsModel | None = None
) -> tuple[sympy.Expr, ...]:
    """Return the terms of a library, or of several: names, expressions, objects of pysindy."""
    entries = library if isinstance(library, list | tuple) else [library]
    terms = [term for entry in entries for term in _read_entry(entry, names, degree, model)]
    if not terms:
        raise ValueError(f"library: expected at least one term, got {library!r}.")
    return tuple(dict.fromkeys(standard_form(term, tuple(names)) for term in terms))


def _read_entry(entry, names, degree, model) -> list[sympy.Expr]:
    if hasattr(entry, "get_feature_names"):
        return _terms_of_pysindy(entry, names)
    if not isinstance(entry, str):
        raise ValueError(
            f"library: expected a name, an expression or a library of pysindy, got {entry!r}."
        )
    if entry == "polynomial":
        return polynomial(names, degree)
    if entry in ("fourier", "trigonometric"):
        return [function(symbol(name)) for name in names for function in (sympy.sin, sympy.cos)]
    if entry == "model":
        if model is None:
            raise ValueError("library: 'model' needs a model, got none. Remedy: give model=...")
        return model_terms(model)
    try:
        return [parse_expression(entry, names, "library")]
    except ModelError as error:
        raise ValueError(
            f"{error} Remedy: use 'polynomial', 'fourier', 'model' or an expression of "
            f"{', '.join(names)}."
        ) from None


def polynomial(names: Sequence[str], degree: int) -> list[sympy.Expr]:
    """Return the monomials of the quantities up to a degree, beginning with the constant."""
    quantities = [symbol(name) for name in names]
    return [
        sympy.Mul(*factors)
        for order in range(degree + 1)
        for factors in combinations_with_replacement(quantities, order)
    ]


def _terms_of_pysindy(library, names) -> list[sympy.Expr]:
    """Read the terms of a library of pysindy from their names, and compare their values."""
    points = np.random.default_rng(0).uniform(0.5, 1.5, (POINTS, len(names)))
    library = copy.deepcopy(library).fit(points)
    values = np.asarray(library.transform(points))
    terms = []
    for text, value in zip(library.get_feature_names(list(names)), values.T, strict=True):
        try:
            term = parse_expression(_PRODUCT.sub("*", text).replace("^", "**"), names, "library")
        except ModelError:
            term = None
        if term is None or not np.allclose(term_function([term], names)(points)[:, 0], value):
            raise ValueError(
                f"library: the term {text!r} of {type(library).__name__} is not named by what it "
                f"computes. Remedy: give function_names that are expressions, or the expressions "
                f"themselves as text."
            )
        terms.append(term)
    return terms


def term_function(terms, names: Sequence[str]):
    """Return the function of values (n_samples, n_names) and time [s] that evaluates terms."""
    quantities = ["t", *names]
    factors = [_factors(term, quantities) for term in terms]
    others = [term for term, of in zip(terms, factors, strict=True) if of is None]
    function = numpy_function(quantities, others) if others else lambda *_: ()

    def values(columns, t=0.0) -> np.ndarray:
        found, products = np.empty((len(terms), len(columns))), _Products((t, *columns.T))
        with np.errstate(all="ignore"):
            rest = iter(function(t, *columns.T))
            for row, of in zip(found, factors, strict=True):
                row[:] = next(rest) if of is None else products[of]
        return found.T

    return values


class _Products(dict):
    """Products of quantities by their indices, each made from the one with one factor fewer."""

    def __init__(self, quantities):
        super().__init__({(): 1.0})
        self._quantities = quantities

    def __missing__(self, places):
        self[places] = self[places[:-1]] * self._quantities[places[-1]]
        return self[places]


def _factors(term: sympy.Expr, quantities: Sequence[str]) -> tuple[int, ...] | None:
    """Return the indices of a monomial's factors among the quantities; None for no monomial."""
    powers = {} if term == 1 else term.as_powers_dict()
    places: list[int] = []
    for base, power in powers.items():
        if not (base.is_Symbol and power.is_Integer and power > 0):
            return None
        places += [quantities.index(str(base))] * int(power)
    return tuple(sorted(places))


def term_texts(terms) -> list[str]:
    """Write terms as text that `parse_expression` reads."""
    return [to_text(term) for term in terms]


def sparse_coefficients(terms, targets, optimizer, *, squares_only=False) -> np.ndarray:
    r"""Find the few terms that explain the targets.

    Terms and targets have shapes (n_rows, n_terms) and (n_rows, n_targets), the coefficients, in
    their units, (n_targets, n_terms); zero for terms that are left out. The optimizer sees scaled
    terms and targets; it is cloned, not fitted itself. `squares_only` is whether it depends on sums
    of squares alone. It then sees the triangle of a QR decomposition, :math:`|R_\Psi \theta - R_y|
    = |\Psi\theta - y|` up to what no :math:`\theta` changes, instead of as many rows as there are
    samples.
    """
    size = _rms(terms)
    spread = np.std(targets, axis=0)
    spread = np.where(spread > STILL * _rms(targets), spread, _rms(targets))
    size, spread = np.where(size > 0, size, 1.0), np.where(spread > 0, spread, 1.0)
    if squares_only:
        rows = triangle(np.vstack([terms[of].T, targets[of].T]).T for of in blocks(len(terms)))
        terms, targets = np.split(rows, [terms.shape[1]], axis=1)
    optimizer = clone(optimizer)
    # the numbers of the default are checked; sklearn would check them for every term dropped
    unchecked = config_context(skip_parameter_validation=squares_only)
    with unchecked, warnings.catch_warnings():
        # the caller raises it with the state's name
        warnings.filterwarnings("ignore", message="Sparsity parameter is too big")
        optimizer.fit(terms / size, targets / spread)
    if np.any(getattr(optimizer, "intercept_", 0.0)):
        raise ValueError(
            f"optimizer: {type(optimizer).__name__} fits an intercept, which no term represents. "
            f"Remedy: fit_intercept=False; 'polynomial' and '1' hold the constant."
        )
    shares = np.reshape(optimizer.coef_, (targets.shape[1], terms.shape[1]))
    return shares * spread[:, None] / size


def stepwise_least_squares(threshold: float, alpha: float, n_rows: int, n_terms: int):
    r"""Return the sequentially thresholded ridge regression of the SINDy paper.

    It minimises :math:`\frac1n |y - \Psi\theta|^2 + \alpha |\theta|^2`, drops every coefficient
    below the threshold, repeats until none is left below it, and ends without the ridge.

    The ridge penalty `alpha` is per row.

    .. [1] S. L. Brunton, J. L. Proctor, J. N. Kutz, "Discovering governing equations from data by
       sparse identification of nonlinear dynamical systems", PNAS 113(15), 2016,
       :doi:`10.1073/pnas.1517384113`.
    """
    with needed_by("SINDYcRegressor"):
        from pysindy import STLSQ
    # every round but the last drops a term
    return STLSQ(threshold=threshold, alpha=alpha * n_rows, max_iter=n_terms + 1)


def _rms(values) -> np.ndarray:
    return np.sqrt(np.mean(values**2, axis=0))
