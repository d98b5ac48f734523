"""What the screen says of a diagnosis: how sure a cause is, and what is left."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from sklearn_pgnn import Parameter, PhysicsModel, effects
from sklearn_pgnn.cli.screen import print_diagnosis
from sklearn_pgnn.diagnosis import (
    FreeRunError,
    Gain,
    MissingPart,
    NamedCause,
    Remaining,
    RetunedParameter,
    Rival,
    Structure,
)
from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.simulation.window_fit import ParameterPrior

pytestmark = pytest.mark.core

ENDS = {"m": (0.0, np.inf), "d": (0.45, 0.55), "k": (0.9, 1.1)}
CART = PhysicsModel(
    {"v": "m/s"}, {"v": "(F - d*v)/m"}, {"m": 2.0, "d": 0.5}, {"F": "N"}, name="cart"
)


def diagnosis(probability=1.0, rivals=(), remaining=None):
    """Return what a diagnosis with one cause holds."""
    remaining = remaining or Remaining("noise", {"v": 1.0})
    cause = NamedCause("input_bias", "F", {}, 90.0, tuple(rivals), probability=probability)
    return SimpleNamespace(
        model=CART,
        smallest_share=0.05,
        verdict_="ambiguous" if rivals else "cause_named",
        complete_=True,
        stopped_=None,
        tested_=True,
        causes_=(cause,),
        discrepancy_=None,
        remaining_=remaining,
        records_=SimpleNamespace(causes=()),
        **dict.fromkeys(("data_quality_", "separations_", "unusable_"), ()),
        parameters_={},
        window_=1.0,
        gain_={"v": Gain(3.0, 2.0, remaining.times_noise["v"], 1.0, 0.99, 0.98, 1.0, "m/s")},
        free_run_={"v": FreeRunError(3.0, 2.0, 1.0)},
    )


def shown(capsys, what, *, quiet=False):
    print_diagnosis(what, Path("out"), quiet=quiet)
    return " ".join(capsys.readouterr().out.split())


def test_a_cause_that_is_sure_has_no_probability(capsys):
    text = shown(capsys, diagnosis(0.999))
    assert "probability" not in text
    assert "confused with nothing" in text


def test_sizes_beside_a_cause_that_may_be_another_are_said_to_hold_beside_it(capsys):
    found = diagnosis(0.79, [Rival("constant_load", "v", 0.2099)])
    found.causes_ += (NamedCause("viscous_friction", "v", {}, 50.0, (), probability=1.0),)
    assert shown(capsys, found).count("holds beside input bias of F: with another") == 1


def test_a_cause_of_an_unfinished_search_was_compared_with_none(capsys):
    early = diagnosis(0.999)
    early.complete_ = False
    assert "confused with not known: the diagnosis ended before" in shown(capsys, early)


def test_parameters_that_were_unknown_or_lie_at_a_limit_are_shown(capsys):
    told = {n: Parameter(n, 1.0, spread=np.inf, bounds=(0.1, 9.0)) for n in ("a", "m")}
    told = CART.replace(parameters={**told, "d": 0.5, "k": 1.0})
    found = diagnosis()
    found.model = told
    found.parameters_ = {
        name: RetunedParameter(prior, value, value - 0.1, value + 0.1, "", False)
        for name, prior, value in (("m", 2.0, 1.95), ("d", 0.5, 0.55), ("k", 1.0, 1.02))
    }
    found.parameters_["a"] = RetunedParameter(1.0, 2.0, 0.1, 9.0, "", False)
    ends_of = {**ENDS, "a": (0.1, 9.0)}
    freedoms = tuple(ParameterPrior(n, *ends, 0, 1, 1) for n, ends in ends_of.items())
    found.records_.best = "extended"
    found.records_.fits = {"extended": SimpleNamespace(freedoms=freedoms, model=told)}
    text = shown(capsys, found)
    assert "Parameters changed, unknown or at a limit (95 % interval)" in text
    assert "m 2 1.95 (1.85 to 2.05) -2.5 % d 0.5 0.55 (0.45 to 0.65) +10.0 % at a limit" in text
    assert "k 1 1.02" not in text
    assert "a 1 2 (0.10 to 9) not determined" in text


def test_a_cause_that_is_not_sure_has_one_and_so_have_its_rivals(capsys):
    text = shown(capsys, diagnosis(0.79, [Rival("constant_load", "v", 0.2099)]))
    assert "probability 79 %" in text
    assert "confused with constant load on v (21 %)" in text


@pytest.mark.parametrize("quiet", [False, True])
@pytest.mark.parametrize(
    ("remaining", "said"),
    [
        (Remaining("noise", {"v": 1.0}), "What is left is white noise."),
        (
            Remaining("disturbance", {"v": 1.34}),
            "disturbance (1.34 × the white noise of v): nothing that was recorded predicts it",
        ),
        (
            Remaining("disturbance", {"v": 2.34}),
            "more than noise (2.34 × the white noise of v), and no law that was tried predicts it",
        ),
        (
            Remaining("structure", {"v": 4.0}, Structure("v", 0.83, 0.25, ("F", "v"))),
            "structure (4.00 × the white noise of v): it depends on F and v, and on what was some "
            "0.25 s before. A law that acts on the rate of v explains 83 % of it",
        ),
    ],
)
def test_what_is_left_is_said(capsys, remaining, said, quiet):
    assert said in shown(capsys, diagnosis(remaining=remaining), quiet=quiet)


@pytest.mark.parametrize(
    ("told", "colour"), [({}, "\x1b[1;36mCause named"), ({"NO_COLOR": "1"}, "")]
)
def test_the_verdict_has_a_colour_where_the_terminal_has(capsys, monkeypatch, told, colour):
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("FORCE_COLOR", "1")
    for name, value in told.items():
        monkeypatch.setenv(name, value)
    print_diagnosis(diagnosis(), Path("out"), quiet=True)
    text = capsys.readouterr().out
    assert ("\x1b[1;36m" in text) == bool(colour)
    assert colour in text


def test_a_formula_has_a_column_of_its_own_in_every_table(capsys):
    with_formula = diagnosis(remaining=Remaining("structure", {"v": 2.0}, Structure("v", 0.9)))
    with_formula.causes_, with_formula.verdict_ = (), "unexplained"
    assert "as given re-tuned noise" in shown(capsys, with_formula)
    with_formula.gain_ = {"v": replace(with_formula.gain_["v"], formula=1.02)}
    with_formula.free_run_ = {"v": FreeRunError(9.0, 8.0, 8.0, formula=1.34)}
    terms = effects.Formula("v", ("1", "v**3"), (-0.5, 2.0))
    with_formula.discrepancy_ = MissingPart("v", ("v",), 0.4, terms, 1.1, CART + terms, np.zeros(3))
    text = shown(capsys, with_formula)
    assert "as given re-tuned with formula noise explained v 3 2 1.02 1 m/s" in text
    assert "as given re-tuned with formula v 9 8 1.34 m/s" in text
    assert "depends on v, which explains 40 %" in text
    said = "is 1.02 × the noise over held-out windows, and in free run 1.34 ×."
    assert f"With −0.5 + 2·v³ added there the error {said}" in text
    assert "with a formula, the error of v in free run falls from 9 to 1.34 m/s." in text
    assert "What is left without the formula is structure (2.00 ×" in text
    with_formula.causes_ = diagnosis().causes_
    assert "v 3 2 2 1.02 1 m/s" in shown(capsys, with_formula)  # the causes alone, then with it


@pytest.mark.parametrize("verdict", ["nothing_found", "cause_named", "unexplained"])
def test_a_free_run_that_says_nothing_or_became_worse_is_told_with_any_verdict(capsys, verdict):
    lost = diagnosis(remaining=Remaining("disturbance", {"v": 8.0}))
    lost.verdict_, lost.causes_ = verdict, lost.causes_ if verdict == "cause_named" else ()
    silence = "The free run is not informative: without restarts, no model predicts"
    worse = "its error is larger than as given, in units of the noise: 2.00"
    assert silence not in shown(capsys, lost)
    lost.free_run_ = {"v": FreeRunError(3.0, 2.0, 1.0, tells=False)}
    assert shown(capsys, lost).count(silence) == 1
    noise = lost.gain_["v"].noise
    lost.free_run_ = {"v": FreeRunError(2.0 * noise, 2.0 * noise, 2.04 * noise)}
    assert "its error is larger" not in shown(capsys, lost)  # by less than is worth a word
    lost.free_run_ = {"v": FreeRunError(2.0 * noise, 4.0 * noise, 8.0 * noise)}
    text = shown(capsys, lost)
    assert worse in text
    assert "make window_length longer, or fix known parameters." in text
    lost.data_quality_ = (Finding("short records", "t", "few windows", 3.0, "record longer"),)
    assert "record longer, or fix known parameters." in shown(capsys, lost)


def test_faults_of_the_records_are_told_before_the_verdict(capsys):
    bad = diagnosis()
    fault = Finding("outliers", "'F'", "three samples lie far off", 3.0, "look at the cable")
    bad.data_quality_ = (fault,)
    print_diagnosis(bad, Path("out"), quiet=False)
    text = capsys.readouterr().out
    assert text.startswith("Quality of the records: read this first\n  outliers: three samples")
    assert "look at the cable.\nsklearn-pgnn explain CODE says more.\n\n" in text
    assert text.index("look at the cable") < text.index("The model of the cart")


def test_nothing_is_said_of_what_was_not_asked(capsys):
    cut_short = diagnosis(remaining=Remaining("disturbance", {"v": 2.0}))
    cut_short.complete_, cut_short.stopped_ = False, "time limit of 1 s"
    text = shown(capsys, cut_short)
    assert "what it depends on was not tested" in text
    assert "predicts it" not in text
