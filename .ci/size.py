"""How large the code is: every count is at most what ``size.json`` allows, which only falls.

``python .ci/size.py --write`` makes what is counted the new limit, unless it is more.
"""

import ast
import json
import sys
from pathlib import Path

HERE = Path(__file__).parent
ALLOWED = HERE / "size.json"


def counts(folder: Path) -> dict[str, int]:
    """Return the numbers of lines, files and functions of a folder's Python code."""
    texts = [path.read_text() for path in folder.rglob("*.py")]
    nodes = [node for text in texts for node in ast.walk(ast.parse(text))]
    return {
        "lines": sum(text.count("\n") for text in texts),
        "files": len(texts),
        "functions": sum(isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef) for n in nodes),
    }


def main() -> int:
    """Compare the counts with what is allowed."""
    found = {name: counts(HERE.parent / name) for name in ("sklearn_pgnn", "tests")}
    allowed = json.loads(ALLOWED.read_text())
    more = [
        f"{name}: expected at most {allowed[name][what]} {what}, got {count}"
        for name, each in found.items()
        for what, count in each.items()
        if count > allowed[name][what]
    ]
    if more:
        print(*more, "Remedy: take out what the new design replaces.", sep="\n")
    elif "--write" in sys.argv:
        ALLOWED.write_text(json.dumps(found, indent=2) + "\n")
    return bool(more)


if __name__ == "__main__":
    sys.exit(main())
