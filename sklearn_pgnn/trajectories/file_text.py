"""The text of a file, plain or compressed, in the encoding that its first bytes tell."""

import bz2
import codecs
import gzip
import io
import lzma
import os
import re
import stat
import zipfile
import zlib
from collections.abc import Callable
from contextlib import suppress
from typing import Any, BinaryIO, NoReturn

from sklearn_pgnn.exceptions import RecordError

#: endings of compressed files, whose records are named by what stands before
PACKED = (".gz", ".bz2", ".xz", ".zip")
#: most bytes of an unpacked file, and how many times larger than the packed one a larger one may be
UNPACKED, RATIO = 2**24, 100
#: bytes of the beginning in which text is told from other things
HEAD = 2**16
_BY_MAGIC: dict[bytes, Callable[[BinaryIO], Any]] = {
    b"\x1f\x8b": gzip.open,
    b"BZh": bz2.open,
    b"\xfd7zXZ\x00": lzma.open,
}
_ZIP = b"PK\x03\x04"
_BOMS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF32_LE: "utf-32",
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f]")
_BROKEN = (OSError, EOFError, zlib.error, lzma.LZMAError, zipfile.BadZipFile, RuntimeError)
_SAVE = "Remedy: save it as CSV (text in UTF-8)."


def refuse_file(path: str, why: str, line: int = 1) -> NoReturn:
    """Raise `RecordError` for a line of a file."""
    raise RecordError(f"{path}:{line}: {' '.join(why.split())}") from None


def check_regular(path: str, what: str) -> None:
    """Refuse, before it is opened, what is no file: a folder, a device, a pipe, a socket."""
    try:
        mode = os.stat(path).st_mode
    except OSError as error:
        refuse_file(path, f"expected {what}, got: {error.strerror}.")
    except ValueError as error:
        refuse_file(path, f"expected {what}, got: {error}.")
    if stat.S_ISREG(mode):
        return
    kind = "Is a directory" if stat.S_ISDIR(mode) else "a device, a pipe or a socket"
    refuse_file(path, f"expected {what}, got: {kind}. Remedy: give files by their names.")


def read_text(path: str) -> str:
    """Return the text of a file: plain, or a ``.gz``, ``.bz2``, ``.xz``, or ``.zip`` of one file.

    The encoding is told by its byte order mark, else it is UTF-8, else Windows' Western one.
    """
    check_regular(path, "a CSV file")
    try:
        with open(path, "rb") as file:
            raw = _unpacked(path, file)
    except OSError as error:
        refuse_file(path, f"expected a CSV file, got: {error.strerror or error}.")
    if not raw.strip():
        refuse_file(path, "expected a CSV file, got an empty file.")
    return _decoded(path, raw)


def _unpacked(path: str, file: BinaryIO) -> bytes:
    head = file.read(HEAD)
    opened = next((op for magic, op in _BY_MAGIC.items() if head.startswith(magic)), None)
    if opened is None and not head.startswith(_ZIP):
        _encoding(path, head)  # before what is no text is read whole
        return head + file.read()
    file.seek(0)
    limit = max(UNPACKED, RATIO * os.fstat(file.fileno()).st_size)
    try:
        with _member(path, file) if opened is None else opened(file) as packed:
            raw = packed.read(limit + 1)
    except RecordError:
        raise
    except _BROKEN as error:
        why = str(error) or type(error).__name__
        refuse_file(path, f"expected a compressed CSV file, got: {why}. Remedy: pack it anew.")
    if len(raw) > limit:
        refuse_file(
            path,
            f"expected a compressed CSV file, got one of more than {limit} bytes, {RATIO} times "
            f"its size: no record is so regular. Remedy: unpack it.",
        )
    return raw


def _member(path: str, file: BinaryIO) -> io.BufferedIOBase:
    """Open the one file in an archive."""
    archive = zipfile.ZipFile(file)
    names = [info.filename for info in archive.infolist() if not info.is_dir()]
    if "[Content_Types].xml" in names:
        refuse_file(path, "expected a CSV file, got an Excel file. Remedy: let its name end so.")
    if "mimetype" in names:
        refuse_file(path, f"expected a CSV file, got a document. {_SAVE}")
    names = [name for name in names if not name.startswith("__MACOSX/")]
    if len(names) != 1:
        shown = ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")
        refuse_file(
            path, f"expected one file in the archive, got {len(names)}: {shown}. Remedy: unpack it."
        )
    return archive.open(names[0])  # type: ignore[return-value]


def _decoded(path: str, raw: bytes) -> str:
    encoding = _encoding(path, raw)
    if encoding != "utf-8-sig":
        text = raw.decode(encoding, "replace")
        if _CONTROL.search(text.encode("latin-1", "replace")) or "\ufffd" in text:
            refuse_file(path, f"expected text in {encoding.upper()}, got something else. {_SAVE}")
        return text
    for tried in (encoding, "cp1252"):
        with suppress(UnicodeDecodeError):
            return raw.decode(tried)
    return raw.decode("latin-1")


def _encoding(path: str, raw: bytes) -> str:
    """Return the encoding, or refuse what is no text."""
    told = next((name for bom, name in _BOMS.items() if raw.startswith(bom)), None)
    if told is not None:
        return told
    zeros = raw[:HEAD:2].count(0), raw[1:HEAD:2].count(0)
    if max(zeros) > 0.4 * len(raw[:HEAD]) and not min(zeros):  # every second byte of Latin text
        told = "utf-16-be" if zeros[0] else "utf-16-le"
        if not _CONTROL.search(raw[:HEAD].replace(b"\0", b"")):
            return told
    binary = _CONTROL.search(raw)
    if binary:
        line = raw.count(b"\n", 0, binary.start()) + 1
        refuse_file(path, f"expected a CSV file (text), got a binary file. {_SAVE}", line)
    return "utf-8-sig"


def stem(path: str) -> str:
    """Return a file's name without its endings, with question marks for bytes that are no text."""
    name, ending = os.path.splitext(os.path.basename(os.path.normpath(path)))
    name = os.path.splitext(name)[0] if ending.lower() in PACKED else name
    return name.encode(errors="replace").decode()
