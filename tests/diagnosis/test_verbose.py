"""A diagnosis shows its stage and the best so far, where it is asked to."""

import pickle

import numpy as np
import pytest
from sledge import SLEDGE as CART

from sklearn_pgnn import ModelDiagnosis, effects

T = np.arange(0, 30, 0.02)
X = np.column_stack([T, 2 * np.sin(0.7 * T) + np.sin(1.9 * T)])
RIG = CART + effects.CoulombFriction("v", level=0.4)
Y = RIG.simulate(T, X[:, 1], substeps=5).y
Y = Y + 1e-3 * np.random.default_rng(0).normal(size=Y.shape)


def diagnosis(**options):
    return ModelDiagnosis(CART, catalogue=["coulomb_friction"], max_causes=1, **options)


def test_silent_unless_asked(capsys):
    diagnosis().fit(X, Y)
    assert "".join(capsys.readouterr()) == ""


def test_lines_tell_the_stage_and_the_best_so_far(capsys):
    told = []
    found = diagnosis(verbose=1, progress=lambda *step: told.append(step)).fit(X, Y)
    lines = capsys.readouterr().out.splitlines()
    assert all(line.startswith("[ModelDiagnosis] ") for line in lines)
    assert any("simulating the candidates" in line for line in lines)
    best = [line for line in lines if "best candidate so far: error" in line]
    assert "with Coulomb friction on v" in best[-1]
    assert {stage for stage, *_ in told} > {"candidates", "held-out error"}  # as without verbose
    assert not [name for name in vars(found) if name == "_show"]
    found.progress = None
    assert pickle.loads(pickle.dumps(found)).causes_[0].effect == "coulomb_friction"


def test_a_terminal_gets_a_bar(capsys, monkeypatch):
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    diagnosis(verbose=1).fit(X, Y)
    shown = capsys.readouterr().out
    assert "\x1b[" in shown  # the line is written over again
    assert "s  simulating the candidates" in shown  # with how long it took


def test_detectable_sizes_show_it_too(capsys):
    found = diagnosis().fit(X, Y).set_params(verbose=1)
    found.detectability(["quadratic_drag"], sizes=(1,), n_repeats=10)
    assert "[ModelDiagnosis] effects ..." in capsys.readouterr().out


@pytest.mark.parametrize("method", ["fit", "detectability"])
def test_a_display_ends_with_an_error(method, capsys):
    found = diagnosis(verbose=1)
    with pytest.raises(ValueError, match=r"None|fitted"):
        found.fit(X, None) if method == "fit" else found.detectability()
    assert found._show is None
