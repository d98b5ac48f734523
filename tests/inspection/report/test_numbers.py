"""The numbers of a report agree: banner, tiles, bar, tables and the file for programs."""

import math
import re
from html import unescape

import pytest
from situations import HIDDEN, situation

from sklearn_pgnn.inspection.numbers import measured, sized, times
from sklearn_pgnn.inspection.report import Provenance, render_report

pytestmark = pytest.mark.core


def test_an_interval_with_one_end_says_it():
    assert measured(0.5, 0.4, math.inf, "V") == "0.50 (at least 0.40) V"
    assert measured(-0.26, -math.inf, -0.22) == "-0.26 (at most -0.22)"
    assert measured(0.5, -math.inf, math.inf, "V") == measured(0.5, 0.5, math.inf, "V") == "0.5 V"
    assert sized(-0.26, -math.inf, -0.22, "1/(m s)") == "-0.26 1/(m s)"


def plain(html):
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", html)).split())


def part(html, begin, end):
    """Return the text between two marks of the HTML."""
    return plain(html[html.index(begin) : html.index(end, html.index(begin))])


@pytest.fixture(params=HIDDEN)
def both(request):
    diagnosis = situation(request.param)
    return diagnosis, render_report(diagnosis, Provenance(date="2026-11-22"))


def in_noise(diagnosis):
    """Return the errors as the file for programs has them, in units of its noise."""
    gain = diagnosis.to_dict()["gain"]["v"]
    known = {w: gain[w] for w in ("prior", "refitted", "extended", "formula") if gain[w]}
    return {which: times(error / gain["noise"]) for which, error in known.items()}


def best(diagnosis):
    """Return the model that holds all that was found."""
    return "extended" if diagnosis.discrepancy_ is None else "formula"


@pytest.mark.slow
def test_banner_tile_and_bar_say_what_the_file_says(both):
    diagnosis, html = both
    left = in_noise(diagnosis)
    banner = part(html, '<div class="verdict', "</div>")
    tile = part(html, "What is left</h3>", "</li>")
    bar = part(html, '<ul class="key">', "</ul>")
    assert tile.startswith(f"What is left {left[best(diagnosis)]} noise")
    assert f"{left[best(diagnosis)]} the noise" in banner or diagnosis.causes_
    assert f"as given {left['prior']}" in tile
    assert f"re-tuning: {left['prior']} → {left['refitted']}" in bar or "nothing" in bar
    if diagnosis.causes_:
        said = f"{left['prior']} as given, {left['refitted']} re-tuned, {left['extended']} extended"
        assert said.replace(" ×", "") in banner
        assert f"→ {left['extended']}" in bar


def test_free_run_of_the_tile_is_that_of_the_file(both):
    diagnosis, html = both
    data = diagnosis.to_dict()
    run = data["free_run"]["v"][best(diagnosis)] / data["gain"]["v"]["noise"]
    assert f"in free run {times(run)}" in part(html, "What is left</h3>", "</li>")


def test_sizes_in_title_and_next_step_are_those_of_the_file(both):
    diagnosis, html = both
    title = part(html, "<h1>", "</h1>")
    for cause in diagnosis.to_dict()["causes"]:
        size = next(iter(cause["parameters"].values()))["value"]
        shown = float(re.search(r"\([a-z ]+ (−?[\d.]+)", title)[1].replace("−", "-"))
        assert shown == pytest.approx(size, rel=0.02)


def test_the_table_of_errors_says_the_same_as_the_tile(both):
    diagnosis, html = both
    left, table = in_noise(diagnosis), part(html, 'id="errors"', "</table>")
    for which in ("prior", "refitted", best(diagnosis)):
        assert f"({left[which]})" in table
    run = diagnosis.to_dict()["free_run"]["v"]
    assert f"({times(run[best(diagnosis)] / diagnosis.gain_['v'].noise)})" in table
    assert ("With formula" in table) == (diagnosis.discrepancy_ is not None)


def test_a_single_cause_leaves_in_the_dot_plot_what_the_tile_says(both):
    diagnosis, html = both
    if len(diagnosis.causes_) == 1 and 'id="candidates"' in html:
        row = part(html[html.index('id="candidates"') :], '<tr class="named">', "</tr>")
        assert f" {in_noise(diagnosis)['extended']} " in row


def test_intervals_of_causes_and_parameters_are_those_of_the_file(both):
    diagnosis, html = both
    data, table = diagnosis.to_dict(), part(html, 'id="parameters"', "</section>")
    for parameter in data["parameters"].values():
        p = (parameter[key] for key in ("value", "low", "high"))
        assert measured(*p) in table
    for cause in data["causes"]:
        for e in cause["parameters"].values():
            said = measured(e["value"], e["low"], e["high"], e["unit"]).replace("-", "−")
            assert said.replace("^2", "²") in plain(html)
