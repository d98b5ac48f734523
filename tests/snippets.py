"""What the README and the pages of the documentation show, and what each snippet needs."""

import re
import textwrap
from dataclasses import dataclass
from pathlib import Path

from sklearn_pgnn.extras import EXTRAS

ROOT = Path(__file__).parents[1]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.rst")))

#: in Markdown the line above a snippet, in reStructuredText its caption, says what it needs
MARKDOWN = re.compile(r"(?P<needs>[^\n]*)\n\n```python\n(?P<code>.*?)```", re.DOTALL)
TEXT = re.compile(
    r"\.\. code-block:: python\n(    :caption: (?P<needs>[^\n]*)\n)?\n"
    r"(?P<code>(    [^\n]*\n|\n)+)"
)
NEEDS = re.compile(r'pip install "\.\[([\w,]+)\]"([ \w]*)')

LIBRARIES = {**EXTRAS, "skops": ("skops",)}


@dataclass(frozen=True)
class Snippet:
    """A snippet of Python, and the extras and packages that the text above it names."""

    page: str
    code: str
    needs: frozenset[str]


def read_needs(text, where):
    """Return the extras and packages that a text names; "no extra" is none."""
    found = NEEDS.search(text or "")
    assert found or "no extra" in (text or "").lower(), f"{where} does not say what it needs"
    return frozenset([*found[1].split(","), *found[2].split()] if found else ())


def read_page(path):
    """Return the snippets of a page, in order."""
    text = path.read_text(encoding="utf-8")
    found = list((MARKDOWN if path.suffix == ".md" else TEXT).finditer(text))
    assert len(found) == len(re.findall(r"^(?:```|\.\. code-block:: )python$", text, re.MULTILINE))
    return [
        Snippet(
            path.name,
            textwrap.dedent(part["code"]),
            read_needs(part["needs"], f"{path.name}: {part['code'].strip()[:40]!r}"),
        )
        for part in found
    ]


def blocked(needs):
    """Return the optional libraries that are not installed where only some extras are."""
    return {name for extra, names in LIBRARIES.items() if extra not in needs for name in names}
