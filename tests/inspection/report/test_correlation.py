"""Parameters that can be traded for each other are named as such."""

import re

import pytest
from situations import situation

from sklearn_pgnn.inspection.report import render_report
from sklearn_pgnn.inspection.report.parameters import correlation

pytestmark = [pytest.mark.core, pytest.mark.filterwarnings("ignore:.*the term:UserWarning")]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["adequate", "named", "unexplained"])
def test_the_matrix_has_every_parameter_and_the_report_shows_it(name):
    diagnosis = situation(name)
    text = render_report(diagnosis)
    shown = text[text.index("Correlation of the parameters") :]
    for parameter in diagnosis.parameters_:
        assert f"<code>{parameter}</code>" in shown
    assert "Beyond ±0.9" in shown or "None is beyond ±0.9" in shown


@pytest.mark.slow
def test_the_correlations_are_within_bounds_and_pairs_beyond_the_bound_are_named():
    found = correlation(situation("named"))
    values = [float(cell["text"].replace("−", "-")) for _, cells in found["rows"] for cell in cells]
    assert len(values) == len(found["names"]) * (len(found["names"]) + 1) // 2
    assert all(abs(value) <= 1 for value in values)
    assert len(found["tight"]) == sum(abs(value) > 0.9 for value in values)


def test_a_script_makes_parts_large_and_the_policy_allows_that_one_only():
    text = render_report(situation("named"))
    (policy,) = re.findall(r'Security-Policy" content="([^"]*)"', text)
    assert re.search(r"script-src 'sha256-[\w+/=]+';", policy)
    assert "unsafe" not in policy
    assert 'data-x="' in text
