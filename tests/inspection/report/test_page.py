"""A report in a browser: as wide as a phone, parts made large, all readable without scripts."""

import pytest
from situations import HIDDEN, situation

from sklearn_pgnn.inspection.report import write_report

MOVED = """[...document.querySelectorAll(".wide, html")]
.filter((e) => e.scrollWidth > e.clientWidth + 1).map((e) => e.ariaLabel || e.className)"""
#: where the parts for the boss end, then the first section, and the last one before the curves
ENDS = """[".sentence", ".telling", ".tiles", ".next", ".first", "section:has(+ section #curves)"]
.map((part) => document.querySelector(part).getBoundingClientRect().bottom)"""
FOLDED = """[...document.querySelectorAll("details > :not(summary)")]
.filter((e) => !e.checkVisibility()).length"""
#: pixels of a sheet of A4 within its margins
SHEET = {"width": 687, "height": 1016}


@pytest.mark.slow
@pytest.mark.parametrize("name", HIDDEN)
def test_it_fits_a_phone_and_what_is_for_the_boss_a_screen_and_two_sheets(browser, tmp_path, name):
    write_report(situation(name), tmp_path / "report.html")
    page = browser.new_page(viewport={"width": 390, "height": 800})
    page.goto((tmp_path / "report.html").as_uri())
    assert page.evaluate(MOVED) == []
    page.set_viewport_size({"width": 1280, "height": 800})
    assert max(page.evaluate(ENDS)[:4]) <= 800
    assert page.evaluate(FOLDED) > 0
    page.set_viewport_size(SHEET)
    page.emulate_media(media="print")
    first, second = page.evaluate(ENDS)[4:]
    assert max(first, second - first) <= SHEET["height"]
    assert page.evaluate(FOLDED) == 0
    page.close()


WHOLE = "0 0 1000 1000"


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(situation("named"), path)
    return path.as_uri()


@pytest.mark.slow
def test_a_drag_makes_a_part_of_all_plots_of_a_figure_large_and_a_double_click_ends_it(
    browser, report
):
    page, said = browser.new_page(viewport={"width": 1000, "height": 900}), []
    page.on("console", lambda message: said.append(message.text))
    page.goto(report)
    figure = page.locator("section[aria-labelledby=curves] figure").first
    areas = figure.locator("svg.area")
    areas.first.scroll_into_view_if_needed()
    box = areas.first.bounding_box()
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 0.25 * box["width"], middle)
    assert "measured:" in page.inner_text(".tip")
    assert "t [s]: 2.49" in page.inner_text(".tip")
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], middle, steps=4)
    page.mouse.up()
    for k in range(areas.count()):
        left, _, width, _ = map(float, _view(areas.nth(k)).split())
        assert (left, width) == (pytest.approx(250, abs=5), pytest.approx(250, abs=5))
    page.mouse.dblclick(box["x"] + 0.5 * box["width"], middle)
    assert {_view(areas.nth(k)) for k in range(areas.count())} == {WHOLE}
    areas.first.focus()
    page.keyboard.press("+")
    assert _view(areas.first) == "250 0 500 1000"
    page.keyboard.press("0")
    assert _view(areas.first) == WHOLE
    assert said == []
    page.close()


def _view(area):
    return area.locator("svg.inner").get_attribute("viewBox")


@pytest.mark.slow
def test_without_scripts_the_curves_are_there_and_nothing_is_promised(browser, report):
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(report)
    assert page.locator("path.line.measured").count() > 0
    assert not page.locator(".hint").is_visible()
    context.close()
