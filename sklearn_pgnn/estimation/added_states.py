r"""The price of added states: their values at the start of every window are integrated out.

Which states are the added ones is a matter of names: a sensor with a lag adds the reading, an
actuator with a lag the force behind the command, and the two may describe the same motion. Counted
are the states that inputs alone drive, and else the directions of the initial state that the
outputs tell least, :math:`n` in all, in units of its standard deviations:

.. math:: V = \min_{c \le 1} \frac{1}{2} \sum_w \sum_{i \le n} \left(\log(1 + c^2 \lambda)
          - \frac{h^2}{\lambda + c^{-2}} - \lambda s^2 + 2 s h\right)_{w, i},
          \quad h = (\lambda + \phi^{-1}) s

with the eigenvalues :math:`\lambda` of the information that residuals of the power :math:`\phi`, in
units of the noise and times their autocorrelation time, give of the initial state, and its fitted
deviations from the expected one along them, :math:`s`. Within which part :math:`c` of their
standard deviations they begin is estimated: states that begin every window where the free run
expects them cost little, states that begin anew in every window cost most.

Of what came before a record nothing is known. In the window that begins it, of :math:`m` values,
every added state costs :math:`\frac{1}{2} \log m` [1]_, whatever it is.

References
----------
.. [1] G. Schwarz, "Estimating the dimension of a model", The Annals of Statistics 6(2), 1978.
"""

import numpy as np

#: parts of their standard deviations within which states may begin
PARTS = np.geomspace(1e-3, 1.0, 31)


def price_of_states(
    told: np.ndarray,
    moved: np.ndarray,
    power: float,
    first: np.ndarray,
    driven: np.ndarray,
    n: int,
) -> float:
    """Return the penalty for so many added states.

    `told` are the information matrices of the windows' initial states, of shape (n_windows,
    n_states, n_states), and `moved` their deviations from the expected ones, (n_windows, n_states),
    both in units of the standard deviations. `first` are the numbers of values of the windows that
    begin a record, 0 of the others, and `driven` the states that inputs alone drive.
    """
    if not n:
        return 0.0
    told, moved = told[first == 0], moved[first == 0]
    led = int(driven.sum())
    parts = [_least_told(_beside_others(told, driven), moved[:, driven], led)]
    own = told[:, ~driven][:, :, ~driven]
    parts.append(_least_told(own, moved[:, ~driven], n - led))
    size, shift = (np.concatenate(part, axis=1) for part in zip(*parts, strict=True))
    pull = (size + 1.0 / power) * shift
    within = PARTS[:, None, None]
    free = np.log1p(within**2 * size) - pull**2 / (size + within**-2)
    fixed = np.sum(2.0 * shift * pull - size * shift**2) + n * np.log(first[first > 0]).sum()
    return float(0.5 * (fixed + free.sum(axis=(1, 2)).min()))


def _beside_others(told: np.ndarray, some: np.ndarray) -> np.ndarray:
    """Return what is told of some states while the others are free, by the Schur complement."""
    others = told[:, ~some][:, :, ~some] + np.eye(int((~some).sum()))
    across = told[:, ~some][:, :, some]
    return told[:, some][:, :, some] - np.swapaxes(across, 1, 2) @ np.linalg.solve(others, across)


def _least_told(told: np.ndarray, moved: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the least eigenvalues, and the deviations along their directions."""
    size, along = np.linalg.eigh(told)
    return np.maximum(size[:, :n], 0.0), np.einsum("wi,wij->wj", moved, along[..., :n])
