"""Whether what is left is white, goes with an input, and is spread as noise is."""

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from scipy.stats import norm

from sklearn_pgnn.inspection.absorbed_noise import expected_autocorrelation
from sklearn_pgnn.inspection.residual_display import ResidualDisplay
from sklearn_pgnn.inspection.svg import Plot, Scale

#: bins of the histogram, and how far it reaches in standard deviations
BINS, REACH = 41, 4.0


@dataclass(frozen=True)
class ResidualTest:
    """A picture of the residuals of an output."""

    title: str
    x_label: str
    plot: Markup


def residual_tests(diagnosis) -> dict[str, list[ResidualTest]]:
    """Return by output the autocorrelation, the correlation with every input, and the histogram.

    They are those of what the model with all that was found leaves over windows.
    """
    records = diagnosis.records_
    windows = records.windows
    fit = records.fits[records.best]
    rows = [slice(a, a + n) for a, n in zip(windows.starts, windows.lengths, strict=True)]
    lags = int(min(25, np.median(windows.lengths) // 3))
    inputs = {n: [windows.u[r, i] for r in rows] for i, n in enumerate(diagnosis.model.inputs)}
    expected, found = expected_autocorrelation(records, fit, lags), {}
    for column, output in enumerate(diagnosis.model.outputs):
        residuals, about = [fit.residual[r, column] for r in rows], expected[:, column]
        display = ResidualDisplay(residuals, inputs, output=output, n_lags=lags, expected=about)
        found[output] = _tests(display, np.concatenate(residuals), output)
    return found


def _tests(display: ResidualDisplay, residual, output: str) -> list[ResidualTest]:
    title = f"autocorrelation of what is left of {output}"
    later = display.lags_ > 0
    auto = _stems(
        display,
        display.autocorrelation_[later],
        title,
        display.lags_[later],
        display.expected_[later],
    )
    lag = "lag [samples]"
    tests = [ResidualTest("Autocorrelation", lag, auto)]
    for name, values in display.cross_correlation_.items():
        title = f"correlation of what is left of {output} with {name}"
        plot = _stems(display, values, title, display.lags_, np.zeros(values.size))
        tests.append(ResidualTest(f"Cross-correlation with {name}", lag, plot))
    return [
        *tests,
        ResidualTest("Histogram", "in standard deviations", _histogram(residual, output)),
    ]


def _stems(display: ResidualDisplay, values, label: str, lags, expected) -> Markup:
    low, high = expected - display.band_, expected + display.band_
    reach = 1.1 * float(max(np.abs([values, low, high]).max(initial=0.0), 2.0 * display.band_))
    plot = Plot(Scale.over(lags, room=0.02), Scale(-reach, reach), label, "low small")
    plot.between(lags, low, high, "noise-band", "white noise stays within")
    plot.stems(lags, values, "extended")
    return plot.html()


def _histogram(residual, output: str) -> Markup:
    known = residual[np.isfinite(residual)]
    scaled = (known - np.mean(known)) / (np.std(known) or 1.0)
    edges = np.linspace(-REACH, REACH, BINS + 1)
    density, _ = np.histogram(np.clip(scaled, -REACH, REACH), edges, density=True)
    x = np.linspace(-REACH, REACH, 201)
    plot = Plot(
        Scale(-REACH, REACH),
        Scale(0.0, 1.05 * max(density.max(), 0.4)),
        f"histogram of what is left of {output}, and the normal distribution",
        "low small",
    )
    plot.line(np.repeat(edges, 2)[1:-1], np.repeat(density, 2), "extended", "what is left")
    plot.line(x, norm.pdf(x), "measured", "normal distribution")
    return plot.html()
