"""Hostile records: each is refused in one line that fits a screen, or read; nothing hangs."""

import bz2
import gzip
import io
import lzma
import os
import zipfile
from functools import cache

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics import PhysicsModel
from sklearn_pgnn.trajectories import read_file

CART = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "F/m"},
    {"m": 2.0},
    {"F": "N"},
    outputs={"position": "x"},
)
RUN = "t,F,position\n" + "".join(f"{k / 10},{k % 3},{k / 7:.6f}\n" for k in range(20))
#: longest message
LONGEST = 2000


def refused_or_read(path):
    """Return what is said; anything but a refusal in one line, or a record, fails."""
    try:
        X, y = read_file(path, CART)
    except (RecordError, ModuleNotFoundError) as error:
        said = str(error)
        assert len(said) < LONGEST
        assert len(said.splitlines()) == 1
        return said
    assert len(X) == len(y) >= 4
    assert np.isfinite(X[["t", "F"]]).all(axis=None)
    return ""


def archive(**files):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, raw in files.items():
            packed.writestr(f"{name}.csv", raw)
    return file.getvalue()


@cache
def valid(ending):
    """Return the bytes of a valid file."""
    table, file = pd.read_csv(io.StringIO(RUN)), io.BytesIO()
    writers = {
        ".csv": lambda: file.write(RUN.encode()),
        ".txt": lambda: file.write(RUN.replace(",", ";").encode("utf-16")),
        ".dat": lambda: file.write(RUN.replace(",", " ").encode()),
        ".csv.gz": lambda: file.write(gzip.compress(RUN.encode())),
        ".csv.bz2": lambda: file.write(bz2.compress(RUN.encode())),
        ".csv.xz": lambda: file.write(lzma.compress(RUN.encode())),
        ".zip": lambda: file.write(archive(run=RUN)),
        ".mat": lambda: savemat(file, {name: table[name].to_numpy() for name in table}),
        ".parquet": lambda: table.to_parquet(file),
        ".xlsx": lambda: table.to_excel(file, index=False),
    }
    try:
        writers[ending]()
    except ImportError:
        return b""
    return file.getvalue()


ENDINGS = (".csv", ".txt", ".dat", ".csv.gz", ".csv.bz2", ".csv.xz", ".zip", ".mat", ".parquet",
           ".xlsx")  # fmt: skip
OTHERS = (".mf4", ".mdf", ".bag", ".db3", ".mcap", ".pq", ".xlsm")
PIECES = [b"\0", b"\n", b'"', b",", b";", b"\t", b"\xff", b"\x1b[31m", b"1e999", b"-", b"[", b"t",
          b"9" * 5000, b"a" * 200_000, b",,,,,,", b"\r", b"1,000", b"12:00", b"31.02.2026", b"#",
          b"\xef\xbb\xbf", b"\xff\xfe", b"nan", b"inf", b"s,N,m\n", b"t,F,position\n"]  # fmt: skip


@st.composite
def broken(draw):
    """Return a file's ending and the bytes of a valid file that were tampered with."""
    ending = draw(st.sampled_from(ENDINGS))
    raw = bytearray(valid(ending))
    for _ in range(draw(st.integers(1, 4))):
        place = draw(st.integers(0, max(len(raw), 1)))
        match draw(st.sampled_from(["cut", "drop", "put", "flip", "repeat"])):
            case "cut":
                del raw[place:]
            case "drop":
                del raw[place : place + draw(st.integers(1, 50))]
            case "put":
                raw[place:place] = draw(st.one_of(st.sampled_from(PIECES), st.binary(max_size=20)))
            case "flip":
                raw[place : place + 1] = draw(st.binary(min_size=1, max_size=1))
            case "repeat":
                raw[place:place] = raw[place : place + 200]
    return ending, bytes(raw)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(broken())
@example((".csv", b""))
@example((".csv", RUN.encode("cp500")))
@example((".csv", RUN.encode("utf-16")[:-1]))
def test_a_broken_file_is_refused_in_one_line_or_read(tmp_path_factory, case):
    ending, raw = case
    path = tmp_path_factory.mktemp("broken") / f"run{ending}"
    path.write_bytes(raw)
    refused_or_read(path)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.sampled_from((*ENDINGS, *OTHERS)), st.binary(max_size=300))
def test_random_bytes_are_refused_in_one_line(tmp_path_factory, ending, raw):
    path = tmp_path_factory.mktemp("random") / f"run{ending}"
    path.write_bytes(raw)
    assert refused_or_read(path)


@pytest.mark.core
@pytest.mark.parametrize("ending", [".csv", ".csv.gz", ".zip", ".mat"])
def test_what_is_no_file_is_refused_before_it_is_opened(tmp_path, ending):
    pipe = tmp_path / f"pipe{ending}"
    os.mkfifo(pipe)
    assert "got: a device, a pipe or a socket. Remedy: give files" in refused_or_read(pipe)
    (tmp_path / f"folder{ending}").mkdir()
    assert "got: Is a directory" in refused_or_read(tmp_path / f"folder{ending}")
    device = tmp_path / f"zero{ending}"
    device.symlink_to("/dev/zero")
    assert "got: a device, a pipe or a socket" in refused_or_read(device)
    for name in ("x" * 300, "a\0b", "none"):
        assert "expected a" in refused_or_read(tmp_path / f"{name}{ending}")


@pytest.mark.core
@pytest.mark.parametrize(
    "cell", ["9" * 10**6, "a" * 10**6, "," * 10**6, " " * 2 * 10**6, '"' + "1," * 60_000 + '"'],
    ids=["digits", "letters", "commas", "blanks", "quoted"],
)  # fmt: skip
def test_a_huge_cell_is_no_huge_message(tmp_path, cell):
    (tmp_path / "run.csv").write_text(RUN.replace("0.5,2", f"0.5,{cell}"))
    assert refused_or_read(tmp_path / "run.csv") or "," in cell
    (tmp_path / "run.csv").write_text(RUN.replace("position", cell))
    assert refused_or_read(tmp_path / "run.csv")


@pytest.mark.core
def test_archives_that_unpack_to_too_much_or_to_several_files_are_refused(tmp_path):
    zeros = b"0" * 40_000_000
    for name, raw in {"a.csv.gz": gzip.compress(zeros), "b.zip": archive(run=zeros)}.items():
        (tmp_path / name).write_bytes(raw)
        assert "no record is so regular. Remedy: unpack it" in refused_or_read(tmp_path / name)
    (tmp_path / "two.zip").write_bytes(archive(one=RUN, two=RUN))
    assert "got 2: one.csv, two.csv. Remedy: unpack it." in refused_or_read(tmp_path / "two.zip")


def test_a_workbook_that_unpacks_to_too_much_is_refused(tmp_path):
    pytest.importorskip("openpyxl")
    rows = b"<row><c><v>1</v></c></row>" * 1_000_000
    bomb = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(valid(".xlsx"))) as book, zipfile.ZipFile(
        bomb, "w", zipfile.ZIP_DEFLATED
    ) as packed:  # fmt: skip
        for part in book.namelist():
            raw = book.read(part)
            if "sheet1" in part:
                raw = raw.replace(b"</sheetData>", rows + b"</sheetData>")
            packed.writestr(part, raw)
    (tmp_path / "bomb.xlsx").write_bytes(bomb.getvalue())
    assert "no record is so regular" in refused_or_read(tmp_path / "bomb.xlsx")


@pytest.mark.parametrize(("size", "said"), [(50, "/0, "), (500, "expected a number, got [")])
def test_lists_in_a_parquet_file_are_refused(size, said, tmp_path):
    pytest.importorskip("pyarrow")
    table = pd.read_csv(io.StringIO(RUN))
    for name in table:
        lists = table.assign(**{name: [[value] * size for value in table[name]]})
        lists.to_parquet(tmp_path / "run.parquet")
        assert said in refused_or_read(tmp_path / "run.parquet")
