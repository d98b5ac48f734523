"""CSV files as X and y: what is read, and that every error has its line."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sklearn_pgnn.exceptions import RecordError, RecordWarning
from sklearn_pgnn.physics import PhysicsModel
from sklearn_pgnn.trajectories import read_file, read_files
from sklearn_pgnn.trajectories.reader import read_records

pytestmark = pytest.mark.core

CART = PhysicsModel(
    name="cart",
    states={"x": "m", "v": "m/s"},
    inputs={"F": "N"},
    outputs={"position": "x"},
    parameters={"m": 2.0},
    equations={"x": "v", "v": "F/m"},
)
RUN = "t,F,position\n0,1,0.5\n0.1,2,0.6\n0.2,3,0.7\n0.4,4,0.8\n"


@pytest.fixture
def file(tmp_path):
    return tmp_path / "run.csv"


def read(file, text, model=CART, **how):
    file.write_text(text, encoding=how.pop("encoding", "utf-8"), **how)
    return read_file(file, model)


def test_excel_may_tell_the_separator_and_that_a_value_is_missing(file):
    X, y = read(file, "sep=;\n" + RUN.replace(",", ";").replace("0.6", "#N/A"))
    expected, _ = read(file, RUN)
    pd.testing.assert_frame_equal(X, expected)
    assert np.isnan(y.iloc[1, 0])
    assert refusal(file, "sep=;\n" + RUN.replace(",", ";").replace("0.6", "off")).startswith("4:")


def refusal(file, text, model=CART):
    """Return the error's text after the file's name."""
    with pytest.raises(RecordError) as caught:
        read(file, text, model)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{file}:")
    return message.removeprefix(f"{file}:")


def is_the_run(X, y):
    return (
        list(X) == ["trajectory", "t", "F"]
        and list(y) == ["position"]
        and X["t"].tolist() == [0, 0.1, 0.2, 0.4]
        and X["F"].tolist() == [1, 2, 3, 4]
        and y["position"].tolist() == [0.5, 0.6, 0.7, 0.8]
    )


# -- what is read ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        RUN,
        RUN.replace(",", "\t"),
        RUN.replace(",", ";"),
        RUN.replace(",", ";").replace(".", ","),
        RUN.replace(",", "\t").replace(".", ","),
        RUN.replace(",", " , "),
        RUN.replace("\n", "\r\n"),
        RUN.replace("\n", "\r"),
        RUN.replace("\n", "\n\n"),
        RUN.rstrip("\n"),
        RUN.replace("0.2,3", "# a pause\n  # and another\n0.2,3"),
        "# rig 3\n" + RUN,
        "\ufeff" + RUN,
        RUN.replace("F,", "F [N],").replace("t,", "t (s),"),
        RUN.replace("F,", "F[N],").replace("position", "position [m]"),
        RUN.replace("t,F", '"t","F"').replace("0.1,2", '"0.1","2"'),
        RUN.replace("\n", ",\n"),
        RUN.replace("position\n", "position,note\n").replace("0.6\n", "0.6,hot\n"),
        RUN.replace("position\n", "position,F [kN]\n"),
        RUN.replace("0.1,2", "1e-1,2.0e0"),
    ],
    ids=range(20),
)
def test_one_run_written_in_many_ways(file, text):
    assert is_the_run(*read(file, text))


def test_text_that_is_not_utf8_may_stand_in_a_header(file):
    lines = RUN.replace("position", "position,\xb0C").split()
    text = "\n".join([lines[0], *(f"{line},20" for line in lines[1:])])
    assert is_the_run(*read(file, text, encoding="latin-1"))


def test_columns_are_named_by_the_model(file):
    model = CART.replace(columns={"F": "tau_cmd", "t": "Time [s]", "position": "pos"})
    text = RUN.replace("t,F,position", "Time [s],tau_cmd [N],pos")
    assert is_the_run(*read(file, text, model))


def test_the_order_of_the_columns_is_free_and_others_are_left_out(file):
    X, y = read(file, "position,note,F,t\n1,a,2,0\n1,b,2,1\n1,c,2,2\n1,,2,3\n")
    assert list(X) == ["trajectory", "t", "F"]
    assert y["position"].tolist() == [1, 1, 1, 1]


def test_states_are_read_where_the_file_has_them(file):
    X, _ = read(file, "t,F,position,v\n0,1,0,0.3\n1,1,0,\n2,1,0,\n3,1,0,\n")
    assert list(X) == ["trajectory", "t", "F", "v"]
    assert X["v"].iloc[0] == 0.3
    assert X["v"].iloc[1:].isna().all()


@pytest.mark.parametrize("nothing", ["", "nan", "NaN", "NA", "null", " "])
def test_an_output_may_have_gaps(file, nothing):
    _, y = read(file, RUN.replace("0.6", nothing))
    assert y["position"].isna().tolist() == [False, True, False, False]


def test_a_file_is_one_trajectory_by_its_own_name(file):
    X, _ = read(file, RUN)
    assert X["trajectory"].unique().tolist() == ["run"]


def test_a_file_may_hold_several_trajectories(file):
    text = "t,F,position,trajectory\n" + "".join(
        f"{k},1,{k},{name}\n" for name in ("up", "down") for k in range(4)
    )
    X, y = read(file, text)
    assert X["trajectory"].unique().tolist() == ["up", "down"]
    assert [record.name for record in read_records(CART, X, y)] == ["up", "down"]


def test_rows_of_trajectories_may_be_mixed(file):
    rows = "".join(f"{k},1,{k},a\n{k},2,{k},b\n" for k in range(4))
    X, y = read(file, "t,F,position,trajectory\n" + rows)
    records = read_records(CART, X, y)
    assert [record.u[0, 0] for record in records] == [1, 2]


def test_a_model_without_inputs_needs_no_input(file):
    lag = PhysicsModel({"y": "V"}, {"y": "-y"})
    X, y = read(file, "t,y\n0,1\n1,0\n2,0\n3,0\n", lag)
    assert list(X) == ["trajectory", "t", "y"]
    assert list(y) == ["y"]


numbers = st.floats(allow_nan=False, allow_infinity=False)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(numbers, numbers), min_size=4, max_size=20), st.sampled_from(",;\t"))
def test_pandas_files_come_back_to_the_last_digit(tmp_path_factory, rows, separator):
    table = pd.DataFrame(rows, columns=["F", "position"]).astype(float)
    table.insert(0, "t", np.arange(len(rows)) / 7)
    file = tmp_path_factory.getbasetemp() / "drawn.csv"
    table.to_csv(file, index=False, sep=separator)
    X, y = read_file(file, CART)
    pd.testing.assert_frame_equal(X[["t", "F"]], table[["t", "F"]], check_exact=True)
    pd.testing.assert_frame_equal(y, table[["position"]], check_exact=True)


# -- several files ---------------------------------------------------------------------------------


def test_several_files_are_trajectories_with_names_of_their_own(tmp_path):
    paths = []
    for folder in ("monday", "tuesday"):
        (tmp_path / folder).mkdir()
        paths.append(tmp_path / folder / "run.csv")
        paths[-1].write_text(RUN)
    paths.append(tmp_path / "run-2.csv")
    paths[-1].write_text(RUN)
    X, y = read_files(map(str, paths), CART)
    assert X["trajectory"].unique().tolist() == ["run", "run-2", "run-2-2"]
    assert X.index.tolist() == y.index.tolist() == list(range(12))
    assert [record.t.size for record in read_records(CART, X, y)] == [4, 4, 4]


def test_trajectories_of_several_files_are_told_apart(tmp_path):
    text = RUN.replace("position\n", "position,trajectory\n").replace("\n0", ",a\n0")
    text = text.replace("position,trajectory,a", "position,trajectory").rstrip() + ",a\n"
    for name in ("one.csv", "two.csv"):
        (tmp_path / name).write_text(text)
    X, _ = read_files([tmp_path / "one.csv", tmp_path / "two.csv"], CART)
    assert X["trajectory"].unique().tolist() == ["one/a", "two/a"]


def test_no_file_is_refused():
    with pytest.raises(RecordError, match=r"^expected at least one file of records,") as caught:
        read_files([], CART)
    assert str(caught.value).endswith("and at most one table of conditions, got none.")


# -- what is the same all through a file -----------------------------------------------------------

LOADED = CART.replace(inputs={"F": "N", "load": "kg", "in_b__since_0p2": ""})


def with_conditions(folder, table, model=LOADED):
    """Return X of three files and a table of conditions beside them."""
    folder.joinpath("old").mkdir()
    paths = [folder / "a.csv", folder / "b.csv", folder / "old" / "c.csv"]
    for path in paths:
        path.write_text(RUN)
    paths.insert(1, folder / "conditions.csv")
    paths[1].write_text(table)
    return read_files(paths, model)[0]


def test_a_table_of_conditions_gives_inputs_of_files_and_folders(tmp_path):
    told = r"no column 'in_b.*it is 1 in b, and 0 in a, c\. Remedy"
    with pytest.warns(RecordWarning, match=told):
        X = with_conditions(tmp_path, "file;load [g];by\nb.csv;500;Ann\na;2000;Bo\nold;1;Bo\n")
    loads = X.groupby("trajectory")["load"].first()
    assert loads.to_dict() == pytest.approx({"a": 2.0, "b": 0.5, "c": 0.001})
    assert X["in_b__since_0p2"].tolist() == [0.0] * 6 + [1.0] * 2 + [0.0] * 4


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("file,load\na,1\nold,2\n", "expected a row for .*b.csv, got a, old. Remedy: add a row"),
        ("file,weight\na,1\n", r"an input of the model \(F, load, in_b.*got file, weight\. Rem"),
        ("file,load\na,1\nb,\nold,2\n", "conditions.csv:3: column 'load': expected a number"),
    ],
)
def test_a_table_of_conditions_without_an_answer_is_refused(tmp_path, table, said):
    with pytest.raises(RecordError, match=said):
        with_conditions(tmp_path, table)


@pytest.mark.parametrize(
    ("column", "values"),
    [("in_sequence", "0 in the first record to 1 in the last"), ("in_group_4", "1 in group_4")],
)
def test_a_mark_that_names_no_records_is_asked_for(tmp_path, column, values):
    model = CART.replace(inputs={"F": "N", column: ""})
    with pytest.raises(RecordError, match=f"column '{column}': missing; .*add it.*, {values}"):
        with_conditions(tmp_path, "file,F\na,1\nb,1\nold,1\n", model)


# -- what is refused -------------------------------------------------------------------------------

GAP = "expected a number, got nothing. Remedy: fill the gap or cut the record there."
SORT = "Remedy: sort the rows by time."


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "1: expected a CSV file, got an empty file."),
        (" \n\n", "1: expected a CSV file, got an empty file."),
        ("# nothing\n", "1: expected a header and samples, got comments only."),
        ("a\nb\0c\n", "2: expected a CSV file (text), got a binary file. Remedy: save it as CSV"),
        (
            "0,1,0.5\n0.1,2,0.6\n",
            "1: expected a header with the names of the columns, got '0, 1, 0.5'.",
        ),
        ("t,F,position\n", "1: column 't': expected at least 4 samples, got 0."),
        (
            RUN.replace("F", "torque"),
            "1: column 'F': missing; the file has t, torque, position. Remedy: say in the model "
            "file what the CSV calls it, in columns: {F: ...}; not used so far: torque.",
        ),
        ("# rig\n\n" + RUN.replace("position", "pos"), "3: column 'position': missing; the file "),
        (RUN.replace("t,F", "time,F"), "1: column 't': missing; the file has time, F, position."),
        (RUN.replace("position", "F"), "1: column 'F': expected it once, got it 2 times."),
        (
            RUN.replace("F,position", "F [N],F [kN]"),
            "1: column 'F': expected it once, got it 2 times.",
        ),
        (RUN.replace("0.1,2", "0.1,two"), "3: column 'F': expected a number, got 'two'."),
        (RUN.replace("0.1,2", "# warm\n0.1,two"), "4: column 'F': expected a number, got 'two'."),
        (RUN.replace("F", "F [N]").replace(",2,", ",?,"), "3: column 'F [N]': expected a number"),
        (
            RUN.replace("0.6", "off"),
            "3: column 'position': expected a number, got 'off'. Remedy: leave the cell empty "
            "where nothing was measured.",
        ),
        (RUN.replace("0.6", "inf"), "3: column 'position': expected a number, got 'inf'."),
        (RUN.replace("0.1,2", "0.1,1_000"), "3: column 'F': expected a number, got '1_000'."),
        (
            RUN.replace("0.1,2", "12:30,2"),
            "3: column 't': expected a number, got '12:30'. Remedy: write dates as 2026-01-31 "
            "12:00:00.005, or the time in seconds.",
        ),
        (RUN.replace("0.1,2", "0.1,"), f"3: column 'F': {GAP}"),
        (RUN.replace("0.1,2", "0.1,nan"), f"3: column 'F': {GAP}".replace("nothing", "'nan'")),
        (RUN.replace("0.1,2", ",2"), f"3: column 't': {GAP}"),
        (RUN.replace("0.2,3,0.7", "0.2"), f"4: column 'F': {GAP}"),
        (
            RUN.replace("0.2,3", "0.05,3"),
            f"4: column 't': expected time to increase, got 0.05 after 0.1 in line 3: the rows are "
            f"out of order. {SORT}",
        ),
        (RUN.replace("0.2,3", "0.1,3"), "4: column 't': expected time to increase, got 0.1 after"),
        (
            RUN.replace("0.4,4,0.8\n", ""),
            "2: column 't': expected at least 4 samples in a record, got 3 in 'run'.",
        ),
        (RUN.replace("0.7", "0.7,9"), "4: expected 3 fields as in the header, got 4."),
        (
            "t,F,position\n0,1,\n1,1,\n2,1,nan\n3,1,\n",
            "2: column 'position': expected a measured value, got none at all. Remedy: take",
        ),
        (
            "t,F,position,trajectory\n0,1,1,a\n1,1,1,a\n2,1,1,a\n3,1,1,a\n0,1,1,b\n2,1,1,b\n1,1,1,b\n",
            "8: column 't': expected time to increase, got 1 after 2 in line 7",
        ),
        (
            "t,F,position,trajectory\n0,1,1,a\n1,1,1,a\n2,1,1,a\n3,1,1,a\n0,1,1,b\n2,1,1,b\n3,1,1,b\n",
            "6: column 't': expected at least 4 samples in a record, got 3 in 'b'.",
        ),
    ],
    ids=range(29),
)
def test_an_error_has_its_line(file, text, said):
    message = refusal(file, text)
    assert message.startswith(said), message


def test_a_field_without_end_has_its_line(file):
    text = RUN.replace("0.1,2", '0.1,"' + 200_000 * "2")
    assert refusal(file, text).startswith("3: expected CSV, got: field larger than field limit")


def test_a_missing_column_is_called_what_the_model_calls_it(file):
    model = CART.replace(columns={"F": "tau_cmd"})
    message = refusal(file, RUN, model)
    assert message == (
        "1: column 'tau_cmd': missing; the file has t, F, position. Remedy: say in the model "
        "file what the CSV calls it, as in columns: {F: F}."
    )


@pytest.mark.parametrize(
    ("header", "remedy"),
    [
        ("t,temperature,force [N],position", "as in columns: {F: force}."),
        (
            "t,position",
            "Remedy: add it to the file, or to a table conditions.csv if it is the same all "
            "through a file, or take it out of the model.",
        ),
        ("t,weg,position", "in columns: {F: ...}; not used so far: weg."),
        ("t,weg,kraft [N],position", "as in columns: {F: kraft}."),
        ("t,left [N],right [N],position", "{F: ...}; not used so far: left, right."),
    ],
)
def test_the_remedy_for_a_missing_column_is_one_that_nothing_else_needs(file, header, remedy):
    model = CART.replace(columns={"F": "force_N"})
    row = ",".join(str(k) for k in range(header.count(",") + 1))
    assert refusal(file, f"{header}\n{row}\n", model).endswith(remedy)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(RecordError, match=r"none\.csv:1: expected a CSV file, got: No such file"):
        read_file(tmp_path / "none.csv", CART)
    with pytest.raises(RecordError, match=r":1: expected a CSV file, got: Is a directory"):
        read_file(tmp_path, CART)


@settings(max_examples=100, deadline=None)
@given(st.one_of(st.binary(max_size=60), st.text("t,;F0.1\n\r\"'#\tposition", max_size=60)))
def test_any_file_is_read_or_refused_in_one_line(tmp_path_factory, content):
    file = tmp_path_factory.getbasetemp() / "any.csv"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(RecordError) as caught:
        read_file(file, CART)
    assert len(str(caught.value).splitlines()) == 1
