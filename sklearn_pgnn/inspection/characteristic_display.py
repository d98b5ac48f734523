"""The characteristic of a cause: the machine's behaviour against the quantity it depends on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

from sklearn.utils.validation import check_is_fitted

from sklearn_pgnn.inspection.display import draw_evidence
from sklearn_pgnn.inspection.evidence import find_evidence, missing_evidence
from sklearn_pgnn.inspection.panels import panels

if TYPE_CHECKING:
    from sklearn_pgnn.diagnosis.model_diagnosis import ModelDiagnosis


class CharacteristicDisplay:
    """Points of the records, and the law that was found: for example a force over a speed.

    Parameters
    ----------
    evidence : Evidence
        The points and curves to draw.

    Attributes
    ----------
    ax_ : matplotlib.axes.Axes
        The axes, once drawn.
    figure_ : matplotlib.figure.Figure
        Their figure.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_pgnn.inspection.curves import Evidence, Line
    >>> v = np.linspace(-1, 1, 51)
    >>> law = Line(v, np.sign(v), "extended", "Coulomb friction")
    >>> evidence = Evidence("missing force", "v [m/s]", "force [N]", (v, np.sign(v)), (law,), "")
    >>> CharacteristicDisplay(evidence).plot().ax_.get_xlabel()
    'v [m/s]'
    """

    def __init__(self, evidence: Any):
        self.evidence = evidence

    @classmethod
    def from_estimator(cls, diagnosis: ModelDiagnosis, cause: Any = 0, *, ax: Any = None) -> Self:
        """Plot the characteristic of a cause of a diagnosis.

        Parameters
        ----------
        diagnosis : ModelDiagnosis
            The fitted diagnosis.
        cause : int, default=0
            Number of the cause; where none was named, the missing part is drawn.
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default on a new figure of pyplot.

        Returns
        -------
        CharacteristicDisplay
            The plotted display.

        Raises
        ------
        ValueError
            If there is no such cause, and no missing part was found.
        """
        check_is_fitted(diagnosis)
        causes = diagnosis.causes_
        if 0 <= cause < len(causes):
            return cls(find_evidence(diagnosis, causes[cause])).plot(ax=ax)
        if causes or diagnosis.discrepancy_ is None:
            raise ValueError(
                f"cause: expected a number below {len(causes)}, the number of causes, got "
                f"{cause!r}."
            )
        return cls(missing_evidence(diagnosis)).plot(ax=ax)

    def plot(self, *, ax: Any = None) -> Self:
        """Draw the plot.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default on a new figure of pyplot.

        Returns
        -------
        CharacteristicDisplay
            This display, with `ax_` and `figure_`.
        """
        (self.ax_,) = panels(ax, 1, 8.0, 3.6)
        self.figure_ = self.ax_.figure
        draw_evidence(self.ax_, self.evidence)
        return self
