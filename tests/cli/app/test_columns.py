"""What the page makes of the columns of several files."""

import pytest

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.cli.app.columns import read_mapped, seen_columns
from sklearn_pgnn.exceptions import RecordError, RecordWarning

CART = PhysicsModel(
    {"v": "m/s"},
    {"v": "(F - d*v)/(m + load)"},
    {"m": 2.0, "d": 1.0},
    {"F": "N", "load": "kg", "in_b": ""},
    inertia={"v": "m + load"},
)


@pytest.fixture
def files(tmp_path):
    """Two runs, and a table of what holds all through them."""
    texts = {
        "a.csv": "time [ms],F,v\n0,1,0\n100,1,0.1\n",
        "b.csv": "time [ms],F,v\n0,2,0\n100,2,0.1\n",
        "Conditions.csv": "file,load [g]\na,500\nb,0\n",
    }
    for place, text in enumerate(texts.values()):
        (tmp_path / f"{place}.csv").write_text(text)
    return [{"file": str(tmp_path / f"{k}.csv"), "label": name} for k, name in enumerate(texts)]


def test_conditions_and_marks_need_no_column(files):
    seen = seen_columns(CART, files)
    assert [name for name, _, _ in seen["quantities"]] == ["t", "F", "v"]
    assert seen["columns"] == ["time [ms]", "F", "v"]
    with pytest.warns(RecordWarning, match="'in_b': by their names it is 1 in b, and 0 in a"):
        X, y = read_mapped(CART, files, seen["guess"])
    assert X["trajectory"].tolist() == ["a", "a", "b", "b"]
    assert X["load"].tolist() == [0.5, 0.5, 0.0, 0.0]
    assert X["in_b"].tolist() == [0.0, 0.0, 1.0, 1.0]
    assert X["t"].tolist() == [0.0, 0.1, 0.0, 0.1]
    assert y["v"].tolist() == [0.0, 0.1, 0.0, 0.1]


def test_without_the_table_its_input_needs_a_column(files):
    mapping = seen_columns(CART, files)["guess"]
    with pytest.raises(RecordError, match=r"expected a column for the input 'load', got none\."):
        read_mapped(CART, files[:2], mapping)
