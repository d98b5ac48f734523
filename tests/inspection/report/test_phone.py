"""On a phone the report is as wide as the screen, and no table has to be moved."""

import pytest
from situations import HIDDEN, situation

from sklearn_pgnn.inspection.report import write_report

MOVED = """[...document.querySelectorAll(".wide, html")]
.filter((e) => e.scrollWidth > e.clientWidth + 1).map((e) => e.ariaLabel || e.className)"""


@pytest.mark.slow
@pytest.mark.parametrize("name", HIDDEN)
def test_no_table_is_wider_than_a_phone(browser, tmp_path, name):
    write_report(situation(name), tmp_path / "report.html")
    page = browser.new_page(viewport={"width": 390, "height": 800})
    page.goto((tmp_path / "report.html").as_uri())
    assert page.evaluate(MOVED) == []
    page.close()
