r"""The weight of the physical loss: a constant, or balanced by the gradients."""

import numpy as np
import torch

ADAPTIVE = "adaptive"
#: share of a new weight in the moving average
FORGETTING = 0.1


def check_lambda(lambda_phy) -> None:
    """Raise `ValueError` unless the weight is valid.

    It is a number from 0 to below 1, or ``"adaptive"``.

    Examples
    --------
    >>> check_lambda(0.5)
    """
    if isinstance(lambda_phy, str) and lambda_phy == ADAPTIVE:
        return
    if isinstance(lambda_phy, int | float | np.number) and 0 <= lambda_phy < 1:
        return
    raise ValueError(
        f"lambda_phy: expected a number from 0 to below 1, or {ADAPTIVE!r}, got {lambda_phy!r}."
    )


def balanced_lambda(error, physics, weights, before: float | None) -> float:
    r"""Weight both losses so that neither gradient dominates.

    With the data's weight :math:`w = \max|\nabla L_{phy}|\,/\,\mathrm{mean}|\nabla L_{error}|` of
    [1]_ in :math:`L_{phy} + w L_{error}`, :math:`\lambda = 1/(1 + w)`; a moving average of it.

    `before` is the average so far, if any; the losses have their graphs.

    References
    ----------
    .. [1] S. Wang, Y. Teng, P. Perdikaris, "Understanding and mitigating gradient flow pathologies
       in physics-informed neural networks", SIAM Journal on Scientific Computing 43(5), 2021,
       :doi:`10.1137/20M1318043`.
    """
    by_error = _gradient(error, weights).abs().mean()
    by_physics = _gradient(physics, weights).abs().max()
    if by_physics <= 0:  # nothing to balance: all inequalities hold
        return 0.0 if before is None else before
    now = float(by_error / (by_error + by_physics))
    return now if before is None else (1 - FORGETTING) * before + FORGETTING * now


def _gradient(loss, weights):
    if not loss.requires_grad:
        return torch.zeros(1)
    parts = torch.autograd.grad(loss, weights, retain_graph=True, allow_unused=True)
    return torch.cat([part.reshape(-1) for part in parts if part is not None])
