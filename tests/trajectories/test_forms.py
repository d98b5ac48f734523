"""One known record in many forms is read as it is, or refused with a remedy; never misread."""

import bz2
import datetime
import gzip
import io
import lzma
import warnings
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sklearn_pgnn.exceptions import RecordError, RecordWarning
from sklearn_pgnn.physics import PhysicsModel
from sklearn_pgnn.trajectories import read_file

CART = PhysicsModel(
    name="cart",
    states={"x": "m", "v": "m/s"},
    inputs={"force": "N"},
    outputs={"position": "x", "speed": "v"},
    parameters={"m": 2.0},
    equations={"x": "v", "v": "force/m"},
)
#: by quantity a unit of the file, and its size in the unit of the model
UNITS = {
    "t": {"s": 1.0, "ms": 1e-3, "min": 60.0},
    "force": {"N": 1.0, "kN": 1e3},
    "position": {"m": 1.0, "mm": 1e-3, "µm": 1e-6},
    "speed": {"m/s": 1.0, "mm/s": 1e-3, "km/h": 1 / 3.6},
}
SIZES = {"force": 40.0, "position": 2.0, "speed": 3.0}
BEGIN = datetime.datetime(2026, 3, 1, 23, 59, 58, 700_000)


def truth(step, rows=31):
    k = np.arange(rows)
    shapes = (np.sign(np.sin(0.7 * k + 0.1)), np.sin(0.31 * k), np.cos(0.31 * k))
    return {"t": step * k} | dict(
        zip(SIZES, (SIZES[n] * s for n, s in zip(SIZES, shapes, strict=True)), strict=True)
    )


def written(value, mark, group, exponent):
    """Write a number to six decimals."""
    if exponent:
        return f"{value:.9e}".replace("e", exponent).replace(".", mark)
    sign, (whole, decimals) = "-" * bool(value < 0), f"{abs(value):.6f}".split(".")
    if group:
        whole = f"{int(whole):,}".replace(",", group)
    return f"{sign}{whole}{mark}{decimals}"


CLOCKS = {
    "iso": lambda at: at.isoformat(sep=" ", timespec="milliseconds"),
    "iso Z": lambda at: at.isoformat(timespec="milliseconds") + "Z",
    "german": lambda at: at.strftime("%d.%m.%Y %H:%M:%S.") + f"{at.microsecond // 1000:03d}",
    "us": lambda at: at.strftime("%m/%d/%Y %I:%M:%S.") + f"{at.microsecond // 1000:03d}"
    + at.strftime(" %p"),
    "month": lambda at: at.strftime("%d-%b-%Y %H:%M:%S.") + f"{at.microsecond // 1000:03d}",
    "day": lambda at: at.strftime("%H:%M:%S.") + f"{at.microsecond // 1000:03d}",
    "minutes": lambda at: at.strftime("%M:%S.") + f"{at.microsecond // 1000:03d}",
}  # fmt: skip
HEADERS = {
    "brackets": "{} [{}]",
    "round": "{} ({})",
    "slash": "{} / {}",
    "in": "{} in {}",
    "row": "{}",
}
PREAMBLES = [
    "",
    "Test rig 7\n",
    "Anlage: 3; Datum: 1.2.2026\nBediener, N. N.\n\n",
    "# rig\n",
    "%\n",
]
ENCODINGS = ["utf-8", "utf-8-sig", "utf-16", "latin-1"]


def zipped(raw):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("run.csv", raw)
    return file.getvalue()


PACKED = {".csv": bytes, ".txt": bytes, ".csv.gz": gzip.compress, ".csv.bz2": bz2.compress,
          ".csv.xz": lzma.compress, ".zip": zipped}  # fmt: skip


@st.composite
def forms(draw):
    separator = draw(st.sampled_from([",", ";", "\t", "|", "  ", " "]))
    blank = separator.isspace() and separator != "\t"
    mark = draw(st.sampled_from(".,"))
    exponent = draw(st.sampled_from(["", "", "e", "E", "D"]))
    groups = ["", "", ".", "'", "\u202f"] if mark == "," else ["", "", ",", "'", "\u202f"]
    return {
        "separator": separator,
        "mark": mark,
        "exponent": exponent,
        "group": "" if exponent else draw(st.sampled_from(groups)),
        "clock": draw(st.sampled_from(["", "", *CLOCKS])),
        "header": draw(st.sampled_from(["brackets", "round", "row"] if blank else [*HEADERS])),
        "units": {name: draw(st.sampled_from([*units])) for name, units in UNITS.items()},
        "order": draw(st.permutations([*UNITS, "note"])),
        "preamble": draw(st.sampled_from(PREAMBLES)),
        "encoding": draw(st.sampled_from(ENCODINGS)),
        "packed": draw(st.sampled_from([*PACKED])),
        "newline": draw(st.sampled_from(["\n", "\r\n", "\r"])),
        "trailing": draw(st.booleans()) and not blank,
        "step": draw(st.sampled_from([0.05, 0.1, 0.25])),
    }


def cells(form, table):
    """Return the rows of the file as texts."""
    number = {key: form[key] for key in ("mark", "group", "exponent")}
    columns = {}
    for name in UNITS:
        size = UNITS[name][form["units"][name]]
        columns[name] = [written(value / size, **number) for value in table[name]]
    if form["clock"]:
        stamps = [BEGIN + datetime.timedelta(seconds=round(s, 3)) for s in table["t"]]
        columns["t"] = [CLOCKS[form["clock"]](stamp) for stamp in stamps]
    columns["note"] = ["run"] * len(table["t"])
    titles, below = [], []
    for name in form["order"]:
        unit = form["units"].get(name, "")
        if name == "note" or (name == "t" and form["clock"]):
            titles.append(name)
            below.append("-")
        else:
            titles.append(HEADERS[form["header"]].format(name, unit))
            below.append(unit)
    rows = [titles] + [below] * (form["header"] == "row")
    return rows + [list(row) for row in zip(*(columns[n] for n in form["order"]), strict=True)]


def in_quotes(cell, separator):
    needs = separator in cell or (separator.isspace() and " " in cell)
    return f'"{cell}"' if needs else cell


def write(folder, form, table):
    end = form["separator"] * form["trailing"] + form["newline"]
    text = form["preamble"].replace("\n", form["newline"])
    for row in cells(form, table):
        text += form["separator"].join(in_quotes(cell, form["separator"]) for cell in row) + end
    raw = text.replace("\u202f", "\u00a0" if form["encoding"] == "latin-1" else "\u202f")
    path = folder / f"run{form['packed']}"
    path.write_bytes(PACKED[form["packed"]](raw.encode(form["encoding"])))
    return path


def assert_true(X, y, table):
    """Compare a record with the truth, as far as six decimals in any unit of the file tell it."""
    assert X["trajectory"].unique().tolist() == ["run"]
    np.testing.assert_allclose(X["t"], table["t"], atol=1e-4, rtol=0)
    np.testing.assert_allclose(X["force"], table["force"], atol=1e-3, rtol=0)
    np.testing.assert_allclose(y["position"], table["position"], atol=1e-5, rtol=0)
    np.testing.assert_allclose(y["speed"], table["speed"], atol=1e-5, rtol=0)


@pytest.mark.slow
@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(forms())
def test_a_record_in_any_form_is_read_as_it_is(tmp_path_factory, form):
    table = truth(form["step"])
    path = write(tmp_path_factory.mktemp("forms"), form, table)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RecordWarning)
        X, y = read_file(path, CART)
    assert_true(X, y, table)


# -- what is left out or refused -------------------------------------------------------------------

RUN = "t,force,position,speed\n0,1,0.5,0\n0.1,2,0.6,1\n0.2,3,0.7,1\n0.3,4,0.8,1\n0.4,4,0.9,1\n"


def refusal(folder, text, model=CART, name="run.csv", **options):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(RecordError) as caught:
        read_file(path, model, **options)
    return str(caught.value).removeprefix(str(path))


@pytest.mark.core
@pytest.mark.parametrize(
    ("text", "said"),
    [
        (RUN.replace("0.2,3", "t,force,position,speed\n0.2,3"), ":4: column 't': expected a number"
         ", got the header again. Remedy: split the file there"),
        (RUN.replace("0.6", "60%"), "Remedy: write the unit into the header, 'position [%]'"),
        (RUN.replace("0.6", "0.6 m"), "Remedy: write the unit into the header, 'position [m]'"),
        (RUN.replace("0.6", '"0,6"'), "Remedy: write all numbers of a column with one mark"),
        (RUN.replace("0.1,2,0.6,1", "0,1,2,0,6,1"), ":3: expected 4 fields as in the header, got 6"
         ". Remedy: put texts with separators into quotes; with decimal commas"),
        ("t\tforce\tposition\tspeed\n" + "".join(f"{k}\t1,234\t2\t3\n" for k in range(5)),
         ":2: column 'force': expected a number with one meaning, got '1,234'"),
        (RUN.replace(",", " ").replace("0.6 1", "0.6"), ":3: expected 4 fields as in the header, "
         "got 3. Remedy: write nan where a value is missing"),
        (RUN.replace("t,force", "t,force [N]").replace("speed\n", "speed\ns,kN,m,m/s\n"),
         "expected one unit, got 'N' in the header and 'kN' below. Remedy: correct one"),
        (RUN.replace("speed\n", "speed\ns,V,m,m/s\n"), "expected the unit 'N' of the model or one"),
    ],
    ids=range(9),
)  # fmt: skip
def test_the_remedy_fits(tmp_path, text, said):
    assert said in refusal(tmp_path, text)


@pytest.mark.core
@pytest.mark.parametrize(
    ("first", "second", "said"),
    [
        ("02/03/2026 12:00:00", "03/03/2026 12:00:00", "02/03 may be in February or March"),
        ("10:05", "10:06", "Remedy: write times as hh:mm:ss, for 10:05 may be hours or minutes"),
    ],
)
def test_times_with_two_meanings_are_refused(tmp_path, first, second, said):
    stamps = iter([first, *[second] * 4])
    lines = RUN.splitlines()
    text = "\n".join([lines[0], *(next(stamps) + line[line.index(",") :] for line in lines[1:])])
    assert said in refusal(tmp_path, text)


@pytest.mark.core
def test_a_row_of_texts_and_a_line_that_was_cut_are_left_out_and_told(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(RUN.replace("speed\n", "speed\nclock,drive,laser,,\n") + "0.5,4,0.")
    with pytest.warns(RecordWarning) as told:
        X, _ = read_file(path, CART)
    assert X["t"].tolist() == [0, 0.1, 0.2, 0.3, 0.4]
    assert ":2: this row has no number and is left out" in str(told[0].message)
    assert ":8: the file ends within this line, which is left out" in str(told[1].message)


@pytest.mark.core
def test_what_numpy_and_windows_write_is_read(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(RUN.replace("t,", "# t,").replace("0.6", "1.#QNAN").replace("0.7", "-1.#IND"))
    X, y = read_file(path, CART)
    assert X["t"].tolist() == [0, 0.1, 0.2, 0.3, 0.4]
    assert y["position"].isna().tolist() == [False, True, True, False, False]


def test_sheets_are_chosen_by_their_headers(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    path, book = tmp_path / "run.xlsx", openpyxl.Workbook()
    book.active.append(["a record of the cart"])
    sheet = book.create_sheet("Data")
    for row in (
        ["rig 7"],
        [],
        ["t", "force in kN", "position", "speed"],
        ["s", None, "[mm]", "m/s"],
    ):
        sheet.append(row)
    for k in range(5):
        sheet.append([f"{k / 10:.1f}".replace(".", ","), k, f"{1000 + k},5", 0.5])
    book.save(path)
    X, y = read_file(path, CART)
    assert X["t"].tolist() == [0, 0.1, 0.2, 0.3, 0.4]
    assert X["force"].tolist() == [0, 1000, 2000, 3000, 4000]
    assert y["position"].to_numpy() == pytest.approx(np.arange(1.0005, 1.005, 0.001))
    sheet["B7"] = "off"
    book.save(path)
    with pytest.raises(
        RecordError, match=r"run.xlsx, sheet 'Data', row 7: column 'force in kN': exp"
    ):
        read_file(path, CART)
    missing = CART.replace(columns={"force": "Kraft"})
    with pytest.raises(RecordError, match=r"The sheets are Sheet, Data; one is read whose header"):
        read_file(path, missing)
    for row in sheet.iter_rows(values_only=True):
        book.active.append(row)
    book.save(path)
    with pytest.raises(RecordError, match=r"got 2 that hold it: Sheet, Data. Remedy: save each"):
        read_file(path, CART)


def test_times_of_a_workbook_are_read(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    begin = datetime.datetime(2026, 1, 31, 23, 59, 59, 800_000)
    for kind in ("date", "time"):
        path, book = tmp_path / f"{kind}.xlsx", openpyxl.Workbook()
        book.active.append(["t", "force", "position", "speed"])
        for k in range(5):
            stamp = begin + datetime.timedelta(seconds=k / 10)
            book.active.append([stamp if kind == "date" else stamp.time(), 1, k, 2])
        book.save(path)
        X, _ = read_file(path, CART)
        assert X["t"].to_numpy() == pytest.approx(np.arange(5) / 10, abs=1e-5)


@pytest.mark.core
@pytest.mark.parametrize("above", ["", "Rig 7\nRate,50,Hz,x\nStart,12:00,h,y\n", "rig,7\n\n\n"])
@pytest.mark.parametrize("below", ["", "s,kN,mm,m/s\n", "time,drive,laser,\n[s],[kN],[mm],[m/s]\n"])
def test_the_header_of_a_file_with_other_names_is_found(tmp_path, above, below):
    text = above + RUN.replace("t,force,position,speed\n", f"Zeit,Kraft,Weg,Tempo\n{below}")
    assert "missing; the file has Zeit, Kraft, Weg, Tempo. Remedy: " in refusal(tmp_path, text)
