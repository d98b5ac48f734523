"""Excel workbooks: the sheet that holds the record, as a table of cells."""

import zipfile
from pathlib import Path
from typing import Any

import pandas as pd

from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.cell_table import HEAD, CellTable, quantities_in, wanted_names
from sklearn_pgnn.trajectories.file_text import RATIO, UNPACKED, check_regular
from sklearn_pgnn.trajectories.shown import LISTED, cut, listed


class ExcelTable(CellTable):
    """A sheet of a workbook; rows are counted as Excel counts them."""

    kind = "Excel file"

    def __init__(
        self, path: str, model: PhysicsModel, sample_time: float | None, sheets: dict[str, list]
    ):
        super().__init__(path, model, sample_time)
        name = self.sheet(sheets)
        self.where = f", sheet {name!r}" if len(sheets) > 1 else ""
        self.sheets, rows = listed(sheets), sheets[name]
        lines = [k for k, row in enumerate(rows, 1) if any(cell != "" for cell in row)]
        self.take([rows[k - 1] for k in lines], lines)

    def sheet(self, sheets: dict[str, list]) -> str:
        """Return the sheet that names most of the model's quantities; else the first."""
        names = wanted_names(self.model)
        counts = {
            sheet: max((quantities_in(row, names) for row in rows[:HEAD]), default=0)
            for sheet, rows in sheets.items()
        }
        most = max(counts.values(), default=0)
        best = [sheet for sheet, count in counts.items() if count == most and sheets[sheet]]
        if not best:
            raise RecordError(f"{self.path}: expected an Excel file with samples, got none.")
        if most and len(best) > 1:
            raise RecordError(
                f"{self.path}: expected the record on one sheet, got {len(best)} that hold it: "
                f"{listed(best)}. Remedy: save each record in a file of its own."
            )
        return best[0]

    def remedy(self, name: str) -> str:
        """Return the remedy for a missing column, with the sheets if there are several."""
        more = f" The sheets are {self.sheets}; one is read whose header names the model's columns."
        return super().remedy(name) + (more if self.where else "")

    def place_of(self, line: int) -> str:
        """Return the sheet, if there are several, and the row; the header's row is left out."""
        row = "" if line == self.header_line else f", row {line}"
        return f"{self.where}{row}"

    def name_of(self, row: int) -> str:
        """Return the row."""
        return f"row {self.lines[row]}"


def open_excel(path: str, model: PhysicsModel, sample_time: float | None = None) -> ExcelTable:
    """Open a workbook."""
    with needed_by("Reading an Excel file"):
        import openpyxl  # noqa: F401
    return ExcelTable(path, model, sample_time, _sheets(path))


def _sheets(path: str) -> dict[str, list[list[Any]]]:
    """Return the rows of every sheet, with empty texts in empty cells."""
    check_regular(path, "an Excel file")
    try:
        _check_size(path)
        frames = pd.read_excel(
            path,
            sheet_name=None,
            header=None,
            dtype=object,
            keep_default_na=False,
            engine="openpyxl",
        )
    except RecordError:
        raise
    except Exception as error:  # what openpyxl raises on a broken file is anything
        why = " ".join((getattr(error, "strerror", None) or str(error)).split())
        raise RecordError(
            f"{path}: expected an Excel file, got: {cut(why or type(error).__name__, LISTED)}."
        ) from None
    return {str(name): frame.to_numpy(dtype=object).tolist() for name, frame in frames.items()}


def _check_size(path: str) -> None:
    """Refuse a small file that unpacks to a huge one."""
    with zipfile.ZipFile(path) as archive:
        size = sum(part.file_size for part in archive.infolist())
    if size > max(UNPACKED, RATIO * Path(path).stat().st_size):
        raise RecordError(
            f"{path}: expected an Excel file, got one that unpacks to {size} bytes: no record is "
            f"so regular. Remedy: save the record as CSV."
        )
