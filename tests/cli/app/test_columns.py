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


def test_conditions_and_marks_need_no_column_where_they_are_told(tmp_path):
    rows = "time [ms],F,v\n" + "".join(f"{100 * k},1,0.{k}\n" for k in range(4))
    texts = {
        "a.csv": rows,
        "b.csv": rows,
        "Conditions.csv": "file,load [g]\na,500\nb,0\n",
    }
    for place, text in enumerate(texts.values()):
        (tmp_path / f"{place}.csv").write_text(text)
    files = [{"file": str(tmp_path / f"{k}.csv"), "label": name} for k, name in enumerate(texts)]
    seen = seen_columns(CART, files)
    assert [name for name, _, _ in seen["quantities"]] == ["t", "F", "v"]
    assert seen["columns"] == ["time [ms]", "F", "v"]
    with pytest.warns(RecordWarning, match="'in_b': by their names it is 1 in b, and 0 in a"):
        X, y = read_mapped(CART, files, seen["guess"])
    assert X["trajectory"].tolist() == ["a"] * 4 + ["b"] * 4
    assert X["load"].tolist() == [0.5] * 4 + [0.0] * 4
    assert X["in_b"].tolist() == [0.0] * 4 + [1.0] * 4
    assert y["v"].tolist() == [0.0, 0.1, 0.2, 0.3] * 2
    with pytest.raises(RecordError, match=r"expected a column for the input 'load', got none\."):
        read_mapped(CART, files[:2], seen["guess"])
