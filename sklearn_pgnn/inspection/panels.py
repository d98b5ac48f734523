"""Where a display draws: on axes that are given, or on a new figure that is shown."""

import numpy as np

from sklearn_pgnn.inspection.style import shown_figure


def panels(ax, count: int, width: float, height: float) -> np.ndarray:
    """Return the axes to draw on.

    By default they are those of a new figure of pyplot, one below the other; width and height
    [inch] are those of the figure, and of each of its panels.
    """
    if ax is None:
        return shown_figure(width, height * count).subplots(count, squeeze=False)[:, 0]
    given = np.atleast_1d(np.array(ax, dtype=object)).ravel()
    if given.size != count:
        raise ValueError(f"ax: expected {count} axes, got {given.size}.")
    return given
