"""CSV files as X and y: columns named by a model, errors with their line."""

import csv
import os
import re

from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.exceptions import RecordWarning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.trajectories.cell_table import HEAD, CellTable, quantities_in, wanted_names
from sklearn_pgnn.trajectories.file_table import FileTable
from sklearn_pgnn.trajectories.file_text import read_text, refuse_file
from sklearn_pgnn.user_line import warn_user

#: separators, the first of several that suit; two blanks leave names with one
TWO_BLANKS = "  "
SEPARATORS = ("\t", ";", "|", ",", TWO_BLANKS, " ")
#: longest line, and how much of it is looked at for the separator
LONGEST, FOR_SEPARATOR = 2**20, 20_000
_BLANKS = (TWO_BLANKS, " ")
#: a field between blanks: in quotes; a date with its time; a word, maybe with a unit in brackets
_WORD = re.compile(
    r"""("[^"]*"|\d+[-./]\d+[-./]\d+[ \t]+\d+:[^ \t]+"""
    r"""|[^ \t\[(]+(?:[ \t]*(?:\[[^\]]*\]|\([^)]*\)))?|[^ \t]+)"""
)
#: a field between two or more blanks
_WORDS = re.compile(r"""("[^"]*"|[^ \t]+(?: [^ \t]+)*)""")
#: a line that begins with a number and has nothing but numbers and dates
_NUMBERS = re.compile(r"""\s*["']?[+\-]?[.,]?\d[\s\d.,;|+\-eEdDqQ:/TZ'"]*""")
#: signs of a comment
_COMMENT = re.compile(r"\s*(?:[#%!]+|//+)\s*")
_WIDTHS = {
    True: "Remedy: write nan where a value is missing, or separate by commas.",
    False: "Remedy: put texts with separators into quotes; with decimal commas, separate by "
    "semicolons.",
}
#: a first line in which Excel declares the separator
_TOLD = re.compile(r"sep=(.)\s*")


def open_csv(path: FilePath, model: PhysicsModel, sample_time: float | None = None) -> FileTable:
    """Open a CSV file to inspect its header and columns."""
    return _CsvTable(os.fspath(path), model, sample_time)


class _CsvTable(CellTable):
    """A file as columns of text, with the line of every row."""

    kind = "CSV"

    def __init__(self, path: str, model: PhysicsModel, sample_time: float | None = None):
        super().__init__(path, model, sample_time)
        lines, texts = self.split(read_text(path))
        told = _TOLD.fullmatch(texts[0]) if len(texts) > 1 else None
        if told:
            lines, texts = lines[1:], texts[1:]
        separator = (
            told[1]
            if told
            else choose_separator(
                [text[:FOR_SEPARATOR] for text in texts[:HEAD]], wanted_names(model)
            )
        )
        self.decimal_comma = separator == ";"
        self.take(self.parse(texts, lines, separator), lines)
        self.check_widths(separator)

    def remedy(self, name: str) -> str:
        """Return the remedy for a missing column, with the separators if there is one column."""
        between = " Columns are separated by commas, semicolons, tabs, bars or blanks."
        return super().remedy(name) + between * (len(self.header) == 1)

    def split(self, text: str) -> tuple[list[int], list[str]]:
        """Return the line numbers and texts of all lines but comments and empty ones.

        Comments right above numbers, as NumPy writes the names of columns, may be the header.
        """
        lines = re.split(r"\r\n|\n|\r", text)
        self.whole = not lines[-1]
        told = [k for k, line in enumerate(lines) if line.strip()]
        for k in told:
            if len(lines[k]) > LONGEST:
                why = f"expected lines of at most {LONGEST} characters, got {len(lines[k])}."
                refuse_file(self.path, f"{why} Remedy: save one sample a line.", k + 1)
        kept = [k for k in told if not _COMMENT.match(lines[k])]
        if not kept:
            refuse_file(self.path, "expected a header and samples, got comments only.")
        if _NUMBERS.fullmatch(lines[kept[0]]):
            above = [k for k in told[: told.index(kept[0])] if lines[k].strip(" \t#%!/*-=")]
            for k in above:
                lines[k] = _COMMENT.sub("", lines[k], count=1)
            kept = above + kept
        return [k + 1 for k in kept], [lines[k] for k in kept]

    def parse(self, texts: list[str], lines: list[int], separator: str) -> list[list[str]]:
        """Return the fields of every line."""
        rows: list[list[str]] = []
        try:
            for text in texts:
                rows.append(fields(text, separator))
        except csv.Error as error:
            refuse_file(self.path, f"expected CSV, got: {error}.", lines[len(rows)])
        return rows

    def check_widths(self, separator: str) -> None:
        """Refuse a row that is longer than the header, and leave out a last line that was cut off.

        Empty fields at the end are ignored; where blanks separate, none can be left out.
        """
        width = len(self.header)
        if len(self.rows) > 1 and not self.whole and len(self.rows[-1]) < len(self.rows[-2]):
            warn_user(
                f"{self.path}:{self.lines[-1]}: the file ends within this line, which is left out.",
                RecordWarning,
            )
            del self.rows[-1], self.lines[-1]
        for line, row in zip(self.lines, self.rows, strict=True):
            short = separator in _BLANKS and len(row) < width
            if short or (len(row) > width and any(text.strip() for text in row[width:])):
                refuse_file(
                    self.path,
                    f"expected {width} fields as in the header, got {len(row)}. {_WIDTHS[short]}",
                    line,
                )


def choose_separator(texts: list[str], names: list[str]) -> str:
    """Return the separator with which a line names most quantities; else that of most lines.

    Blanks divide what tabs divide, too, and therefore come last.
    """

    def suits(separator: str) -> tuple[int, bool, float]:
        rows = [_fields_or_none(text, separator) for text in texts]
        widths = [len(row) for row in rows]
        usual = max(set(widths), key=widths.count)
        named = max(quantities_in(row, names) for row in rows)
        signs = named > 1 and separator not in _BLANKS
        return named, signs, round(widths.count(usual) / len(rows), 2) if usual > 1 else 0.0

    best = {separator: suits(separator) for separator in SEPARATORS}
    if not any(regular for *_, regular in best.values()):
        return ","
    return max(best, key=best.__getitem__)


def _fields_or_none(text: str, separator: str) -> list[str]:
    try:
        return fields(text, separator)
    except csv.Error:
        return []


def fields(text: str, separator: str) -> list[str]:
    """Split a line into fields; the csv module is used only if there are quotes."""
    if separator in _BLANKS:
        words = _WORDS if separator == TWO_BLANKS else _WORD
        return [word.strip('"') for word in words.findall(text)]
    if '"' in text:
        return next(csv.reader([text], delimiter=separator, skipinitialspace=True))
    return text.split(separator)
