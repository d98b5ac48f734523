"""Model files: a model as YAML text, read node by node, so that no object is constructed.

A file is composed into YAML nodes, which know their line and column, and every scalar is read as
text. Tags, anchors and merge keys are refused. Every error is reported as
``FILE:LINE:COLUMN: what was expected, what came``.
"""

import io
import math
import os
import re
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.scalarstring import DoubleQuotedScalarString

from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.exceptions import ModelError, ModelWarning, UnitWarning
from sklearn_pgnn.physics.lagrangian import SECTION
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.model_parts import is_text
from sklearn_pgnn.physics.unit_check import check_units, unknown_units
from sklearn_pgnn.readings import reading
from sklearn_pgnn.user_line import warn_user
from sklearn_pgnn.whole_file import is_stream, write_whole

#: version of the format that is written; a file without one is read as if it had this one
VERSION = 1
#: largest model file [byte]
MAX_BYTES = 1_000_000
#: doubts of one kind that are told of one entry of a file
MOST_TOLD = 5
#: characters of a text that an error message shows
SHOWN = 60
_PLAIN_TAGS = {
    f"tag:yaml.org,2002:{name}"
    for name in ("map", "seq", "str", "int", "float", "bool", "null", "timestamp")
}
_NULL = "tag:yaml.org,2002:null"


def read_model(path: FilePath) -> PhysicsModel:
    """Read a model file; an error says ``FILE:LINE:COLUMN: what``."""
    return _Reader(os.fspath(path)).model()


def robot_in(path: FilePath) -> dict | None:
    """Return the section ``robot`` of a model file, None where it has none."""
    reader = _Reader(os.fspath(path))
    return reader.document(reader.root()).get("robot")


def write_model(model: PhysicsModel, path: FilePath | None = None) -> str:
    """Write a model as a model file, whole or not at all, and return its YAML text."""
    text = written_parts(model.to_dict())
    if path is not None:
        write_whole(Path(path), text)
    return text


def written_parts(parts: dict) -> str:
    """Return the parts of a model file as its text."""
    yaml = YAML(typ="rt")
    yaml.width = 2**31
    text = io.StringIO()
    yaml.dump({"version": VERSION, **_written(parts)}, text)
    return text.getvalue()


# -- reading ---------------------------------------------------------------------------------------


class _Reader:
    """Read the nodes of one file, by key; `computed` names entries that do not stand in it."""

    def __init__(self, path: str):
        self.path = path
        self.places: dict[tuple[str, ...], Node] = {}
        self.seen: set[int] = set()
        self.computed: set[str] = set()

    def refuse(self, node: Node | None, why: str) -> NoReturn:
        mark = None if node is None else node.start_mark
        self.refuse_at(mark, why)

    def refuse_at(self, mark: Any, why: str) -> NoReturn:
        line, column = (1, 1) if mark is None else _line_and_column(mark)
        raise ModelError(f"{self.path}:{line}:{column}: {' '.join(why.split())}") from None

    def model(self) -> PhysicsModel:
        data = self.document(self.root())
        try:
            model = self.built(data)
        except ModelError as error:
            self.refuse(self.place(error.where), str(error))
        self.warn_of_unused(model.unused_parameters)
        self.warn(UnitWarning, unknown_units(model), "correct it, or leave it out")
        remedy = "correct the term, or the unit of what is in it"
        written = (said for said in check_units(model) if said.split(":")[0] not in self.computed)
        self.warn(UnitWarning, written, remedy)
        return model

    def built(self, data: dict) -> PhysicsModel:
        """Return the model of a file's parts, whose machine may be that of a robot's file."""
        if "robot" not in data:
            return PhysicsModel.from_dict(data)
        model = reading("robot_model")(data, Path(self.path).parent)
        self.computed = {f"equations.{state}" for state in model.states}
        return model

    def place(self, where: tuple[str, ...]) -> Node | None:
        """Return the node of a key, or of the part that it is in, or follows from."""
        tried = [where[:length] for length in range(len(where), 0, -1)]
        return next((self.places[w] for w in (*tried, ("lagrangian",)) if w in self.places), None)

    def warn_of_unused(self, names: tuple[str, ...]) -> None:
        """Warn of parameters without an effect, of many at once."""
        others = f", and {len(names) - 1} others neither" if len(names) > 1 else ""
        said = [f"parameters.{name}: no equation uses it{others}." for name in names[:1]]
        self.warn(ModelWarning, said, "write it into an equation, or leave it out")

    def warn(self, kind: type[ModelWarning], sentences: Iterable[str], remedy: str) -> None:
        """Warn of what is doubtful, with its line and the remedy; a few times an entry."""
        entries: dict[str, list[str]] = {}
        for said in sentences:
            entries.setdefault(said.split(":")[0], []).append(said)
        for entry, of_it in entries.items():
            node = self.place(tuple(entry.split(".")))
            line, column = (1, 1) if node is None else _line_and_column(node.start_mark)
            place = f"{self.path}:{line}:{column}"
            left = len(of_it) - MOST_TOLD
            for said in of_it[:MOST_TOLD]:
                warn_user(f"{place}: {said} Remedy: {remedy}.", kind)
            if left > 0:
                warn_user(f"{place}: {entry}: {left} more of this kind. Remedy: {remedy}.", kind)

    def root(self) -> Node:
        yaml = YAML(typ="safe", pure=True)
        try:
            node = yaml.compose(self.text())
        except MarkedYAMLError as error:
            what = error.problem or error.context or "something else"
            self.refuse_at(error.problem_mark or error.context_mark, f"expected YAML: {what}.")
        except (YAMLError, RecursionError) as error:
            self.refuse(None, f"expected YAML: {type(error).__name__}.")
        if node is None:
            self.refuse(None, "expected a model, got an empty file.")
        return node

    def text(self) -> str:
        if "\0" in self.path:
            self.refuse(None, "expected the name of a model file, got one with a null character.")
        try:
            if is_stream(self.path):
                raise OSError(0, "a pipe or a device")
            with open(self.path, "rb") as file:
                raw = file.read(MAX_BYTES + 1)
        except OSError as error:
            self.refuse(None, f"expected a model file, got: {error.strerror}.")
        if len(raw) > MAX_BYTES:
            self.refuse(None, f"expected at most {MAX_BYTES} bytes, got more.")
        try:
            return raw.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            line = raw.count(b"\n", 0, error.start) + 1
            raise ModelError(f"{self.path}:{line}:1: expected text in UTF-8, got bytes.") from None

    def document(self, root: Node) -> dict:
        data = {}
        for key, value in self.items(root):
            if key not in _SECTIONS:
                expected = ", ".join(_SECTIONS)
                self.refuse(self.places[(key,)], f"unknown key {key!r}; expected {expected}.")
            data[key] = _SECTIONS[key](self, value, key)
        balances = ("lagrangian", "forces", "flows")
        needed = ("states",) if any(map(data.get, balances)) else ("states", "equations")
        for key in _OF_ROBOTS & data.keys() if "robot" in data else ():
            self.refuse(self.places[(key,)], f"expected no {key!r} beside 'robot', whose it has.")
        for key in () if "robot" in data else needed:
            if not data.get(key):
                self.refuse(self.places.get((key,), root), f"expected {key!r}, got none.")
        data.pop("version", None)
        data.setdefault("parameters", {})
        return data

    # -- nodes -------------------------------------------------------------------------------------

    def plain(self, node: Node, expected: str) -> Node:
        """Refuse a tag or an alias."""
        if id(node) in self.seen:
            self.refuse(node, f"{expected}, got an alias.")
        self.seen.add(id(node))
        if str(node.tag) not in _PLAIN_TAGS:
            self.refuse(node, f"{expected}, got the tag {str(node.tag)!r}.")
        return node

    def items(
        self, node: Node, what: str = "", place: tuple[str, ...] = ()
    ) -> Iterator[tuple[str, Node]]:
        """Return keys and value nodes of a mapping; a repeated key is an error."""
        expected = f"{what}: expected names and values" if what else "expected a model"
        if not isinstance(self.plain(node, expected), MappingNode):
            self.refuse(node, f"{expected}, got {_shown(node)}.")
        for key_node, value in node.value:
            key = self.scalar(key_node, "expected a name")
            here = (*place, key)
            if here in self.places:
                first = self.places[here].start_mark.line + 1
                self.refuse(key_node, f"{key!r} is here twice; first in line {first}.")
            self.places[here] = key_node
            if isinstance(value, ScalarNode) and not value.value:
                value.start_mark = key_node.start_mark  # nothing stands somewhere behind the key
            yield key, value

    def scalar(self, node: Node, expected: str) -> str:
        if not isinstance(self.plain(node, expected), ScalarNode):
            self.refuse(node, f"{expected}, got {_shown(node)}.")
        if not is_text(node.value):
            self.refuse(node, f"{expected}, got the half of a character.")
        return node.value

    def text_of(self, node: Node, what: str) -> str:
        expected = f"{what}: expected text"
        text = self.scalar(node, expected)
        if str(node.tag) == _NULL or not text.strip():
            self.refuse(node, f"{expected}, got nothing.")
        return text

    def number(self, node: Node, what: str) -> float:
        expected = f"{what}: expected a number"
        text = self.scalar(node, expected)
        try:
            return float(re.sub(r"^([-+]?)\.(inf|nan)$", r"\1\2", text.strip().lower()))
        except ValueError:
            self.refuse(node, f"{expected}, got {_shown(node)}.")

    def truth(self, node: Node, what: str) -> bool:
        expected = f"{what}: expected true or false"
        text = self.scalar(node, expected).lower()
        if text not in ("true", "false"):
            self.refuse(node, f"{expected}, got {_shown(node)}.")
        return text == "true"

    def list_of(self, node: Node, what: str) -> list[Node]:
        expected = f"{what}: expected a list"
        if not isinstance(self.plain(node, expected), SequenceNode):
            self.refuse(node, f"{expected}, got {_shown(node)}.")
        return node.value

    # -- sections ----------------------------------------------------------------------------------

    def version(self, node: Node, part: str) -> str:
        text = self.scalar(node, f"{part}: expected {VERSION}")
        if text != str(VERSION):
            remedy = "a later sklearn-pgnn reads it"
            self.refuse(node, f"{part}: expected {VERSION}, got {_shown(node)}. Remedy: {remedy}.")
        return text

    def section(self, node: Node, part: str, read: Callable[[Node, str], Any]) -> dict:
        """Read a mapping; a missing one is empty."""
        if str(node.tag) == _NULL:
            return {}
        return {key: read(value, f"{part}.{key}") for key, value in self.items(node, part, (part,))}

    def named(
        self, node: Node, part: str, of_name: Callable[[str], str], read: Callable[[Node, str], str]
    ) -> dict:
        """Read a mapping or a plain list of names."""
        if not isinstance(node, SequenceNode):
            return self.section(node, part, read)
        found = {}
        for item in self.list_of(node, part):
            name = self.text_of(item, part)
            if name in found:
                self.refuse(item, f"{name!r} is here twice.")
            self.places[(part, name)] = item
            found[name] = of_name(name)
        return found

    def units(self, node: Node, part: str) -> dict[str, str]:
        return self.named(node, part, lambda name: "", self.unit)

    def unit(self, node: Node, what: str) -> str:
        text = self.scalar(node, f"{what}: expected a unit")
        return "" if str(node.tag) == _NULL else text

    def outputs(self, node: Node, part: str) -> dict[str, str]:
        return self.named(node, part, lambda name: name, self.text_of)

    def text_or_row(self, node: Node, what: str) -> str | list[str]:
        if isinstance(node, SequenceNode):
            return [self.text_of(item, what) for item in self.list_of(node, what)]
        if not isinstance(node, ScalarNode):
            self.refuse(node, f"{what}: expected text, or a row of a matrix, [M + m, m*l].")
        return self.text_of(node, what)

    def lagrangian(self, node: Node, part: str) -> dict[str, Any]:
        found = {}
        for key, value in self.items(node, part, (part,)):
            if key not in SECTION:
                expected = ", ".join(SECTION)
                self.refuse(self.places[part, key], f"unknown key {key!r}; expected {expected}.")
            nested = key in ("coordinates", "forces")
            found[key] = self.nested(value, part, key) if nested else self.text_of(value, key)
        return found

    def robot(self, node: Node, part: str) -> dict[str, Any]:
        found = {}
        for key, value in self.items(node, part, (part,)):
            if key not in _ROBOT:
                expected = ", ".join(_ROBOT)
                self.refuse(self.places[part, key], f"unknown key {key!r}; expected {expected}.")
            found[key] = _ROBOT[key](self, value, f"{part}.{key}")
        if "file" not in found:
            self.refuse(self.places[part,], "robot: expected the key 'file', got none.")
        return found

    def nested(self, node: Node, part: str, key: str) -> dict[str, str]:
        """Read a mapping within a section."""
        entries = self.items(node, f"{part}.{key}", (part, key))
        return {name: self.text_of(value, f"{part}.{key}.{name}") for name, value in entries}

    def finite(self, node: Node, what: str) -> float:
        value = self.number(node, what)
        if not math.isfinite(value):
            self.refuse(node, f"{what}: expected a finite number, got {value}.")
        return value

    def setting(self, node: Node, what: str) -> str | int:
        text = self.text_of(node, what)
        if not what.endswith(".substeps"):
            return text
        try:
            return int(text)
        except ValueError:
            self.refuse(node, f"{what}: expected an integer >= 1, got {_shown(node)}.")

    def parameter(self, node: Node, what: str) -> dict:
        if not isinstance(node, MappingNode):
            return {"value": self.number(node, what)}
        name = what.split(".", 1)[1]
        found = {}
        for key, value in self.items(node, what, ("parameters", name)):
            if key not in _PARAMETER:
                expected = ", ".join(_PARAMETER)
                key_node = self.places[("parameters", name, key)]
                self.refuse(key_node, f"{what}: unknown key {key!r}; expected {expected}.")
            found[key] = _PARAMETER[key](self, value, f"{what}.{key}")
        if "value" not in found:
            self.refuse(self.places[("parameters", name)], f"{what}: expected a value, got none.")
        return found

    def port(self, node: Node, what: str) -> dict:
        found, name = {}, what.split(".", 1)[1]
        for key, value in self.items(node, what, ("ports", name)):
            read = self.texts_of if key in ("rates", "outputs") else self.text_of
            found[key] = read(value, f"{what}.{key}")
        return found

    def texts_of(self, node: Node, what: str) -> dict:
        place = tuple(what.split("."))
        return {key: self.text_of(n, f"{what}.{key}") for key, n in self.items(node, what, place)}

    def bounds(self, node: Node, what: str) -> tuple[float, ...]:
        numbers = tuple(self.number(item, what) for item in self.list_of(node, what))
        if len(numbers) != 2:
            self.refuse(node, f"{what}: expected [low, high], got {len(numbers)} numbers.")
        return numbers


def _section(read: Callable[[_Reader, Node, str], Any]) -> Callable[[_Reader, Node, str], dict]:
    """Return what reads a section, each of its entries by a method of the reader."""
    return lambda reader, node, part: reader.section(node, part, partial(read, reader))


_TEXTS = _section(_Reader.text_of)
_SECTIONS = {
    "name": _Reader.text_of,
    "states": _Reader.units,
    "inputs": _Reader.units,
    "outputs": _Reader.outputs,
    "parameters": _section(_Reader.parameter),
    "equations": _TEXTS,
    "inertia": _section(_Reader.text_or_row),
    "forces": _TEXTS,
    "capacity": _section(_Reader.text_or_row),
    "flows": _TEXTS,
    "lagrangian": _Reader.lagrangian,
    "energy": _TEXTS,
    "delays": _TEXTS,
    "initial_state": _section(_Reader.finite),
    "settled": _TEXTS,
    "columns": _TEXTS,
    "channels": _TEXTS,
    "simulation": _section(_Reader.setting),
    "let": _TEXTS,
    "ports": _section(_Reader.port),
    "robot": _Reader.robot,
    "version": _Reader.version,
}
#: parts of a model that are a robot's own
_OF_ROBOTS = {"equations", "inertia", "forces", "capacity", "flows", "lagrangian", "energy", "let"}
_ROBOT = {
    "file": _Reader.text_of,
    "payload": _Reader.text_of,
    "controls": _Reader.truth,
    "base_parameters": _Reader.truth,
    "armatures": _Reader.truth,
    "effort_limits": _Reader.truth,
}
_PARAMETER = {
    "value": _Reader.number,
    "unit": _Reader.unit,
    "bounds": _Reader.bounds,
    "fixed": _Reader.truth,
    "spread": _Reader.number,
}


def _line_and_column(mark: Any) -> tuple[int, int]:
    return mark.line + 1, mark.column + 1


def _shown(node: Node) -> str:
    if isinstance(node, SequenceNode):
        return "a list"
    if isinstance(node, MappingNode):
        return "names and values"
    if len(node.value) > SHOWN:  # a whole file, perhaps, that is no model
        return repr(f"{node.value[:SHOWN]} ...")
    return repr(node.value) if node.value else "nothing"


# -- writing ---------------------------------------------------------------------------------------


def _written(data: dict) -> CommentedMap:
    """Write a model's plain data as readable YAML."""
    written = CommentedMap()
    for part, content in data.items():
        if part == "name":
            written[part] = content
        elif part in ("equations", "forces", "flows", "energy"):
            written[part] = CommentedMap((key, _quoted(text)) for key, text in content.items())
        elif part == "ports":
            written[part] = CommentedMap((key, _flow_of_texts(p)) for key, p in content.items())
        elif part == "parameters":
            written[part] = CommentedMap((key, _flow(p)) for key, p in content.items())
        else:
            quote = part in ("outputs", "inertia", "capacity")
            written[part] = _flow({k: _quoted_row(v) if quote else v for k, v in content.items()})
    return written


def _quoted_row(row: str | list[str]) -> str | list[str]:
    return list(map(_quoted, row)) if isinstance(row, list) else _quoted(row)


def _quoted(text: str) -> str:
    return text if text.isidentifier() else DoubleQuotedScalarString(text)


def _flow_of_texts(content: dict) -> CommentedMap:
    """Write the expressions of a port on one line."""
    return _flow(
        {
            key: _flow_of_texts(part) if isinstance(part, dict) else _quoted(part)
            for key, part in content.items()
        }
    )


def _flow(content: dict) -> CommentedMap:
    """Write a mapping, and the lists in it, on one line."""
    flow = CommentedMap()
    for key, value in content.items():
        if isinstance(value, list):
            value = CommentedSeq(value)
            value.fa.set_flow_style()
        flow[key] = value
    flow.fa.set_flow_style()
    return flow
