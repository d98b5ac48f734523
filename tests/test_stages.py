"""Stages in words, for the screen and the page."""

import re
from pathlib import Path

import sklearn_pgnn
from sklearn_pgnn.stages import BEST, WORDS, in_words


def test_every_stage_in_the_table_is_one_of_the_package():
    files = Path(sklearn_pgnn.__file__).parent.rglob("*.py")
    sources = "\n".join(path.read_text(encoding="utf-8") for path in files)
    assert [stage for stage in WORDS if len(re.findall(f'"{stage}"', sources)) < 2] == []


def test_what_is_best_so_far_is_left_as_the_search_says_it():
    assert in_words(f"{BEST}drag on v") == f"{BEST}drag on v"


def test_the_number_of_a_cause_stays_and_words_are_left_as_they_are():
    assert in_words("cause 12") == "cause 12, fitting the candidates"
    assert in_words("writing the report") == "writing the report"
