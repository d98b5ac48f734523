"""Energy that a network takes out of a model's states, as a differentiable torch step."""

import torch


def dissipated(output, parts, root, dt) -> torch.Tensor:
    r"""Return the change of some states, see `sklearn_pgnn.simulation.dissipation`.

    .. math:: \delta = -\Delta t\,L\,(1 + \Delta t\,L^T H L)^{-1} L^T e

    `output` has shape (n, n_lossy * (n_lossy + 1) / 2); `parts`, slopes and Hessian of the stored
    energy, (n, n_lossy + n_lossy**2); `root`, the unit of every row of L, (n_lossy,); and the steps
    `dt` [s] (n, 1).
    """
    m = len(root)
    rows, columns = torch.tril_indices(m, m, device=output.device)
    lower = torch.zeros(len(output), m, m, dtype=output.dtype, device=output.device)
    lower[:, rows, columns] = output
    lower = root[:, None] * (lower + torch.eye(m, dtype=output.dtype, device=output.device))
    hessian, step = parts[:, m:].reshape(-1, m, m), dt[:, :, None]
    turned = lower.transpose(1, 2)
    matrix = torch.eye(m, dtype=output.dtype, device=output.device)
    matrix = matrix + step * (turned @ hessian @ lower)
    slopes = turned @ parts[:, :m, None]
    return (-step * (lower @ torch.linalg.solve(matrix, slopes)))[:, :, 0]
