"""The page of the codes, from the table that ``sklearn-pgnn explain`` reads."""

from sklearn_pgnn.cli.explain import KINDS, PARTS, read_codes

HEAD = """\
.. made by make_codes.py from sklearn_pgnn/cli/codes.toml

Codes
=====

What ``sklearn-pgnn explain CODE`` says. Codes stay the same from version to version; the JSON files
(:ref:`schemas`) have them as ``verdict`` and ``code``. A cause has the id of an effect of the
:doc:`catalogue`, which ``explain`` takes as well.
"""


def page() -> str:
    """Return the page."""
    codes = read_codes()
    lines = [HEAD]
    for kind, title in KINDS.items():
        lines += [title, "-" * len(title), ""]
        for code, parts in codes[kind].items():
            lines += entry(code, parts)
    return "\n".join(lines)


def entry(code: str, parts: dict[str, str]) -> list[str]:
    """Return the lines of an entry."""
    lines = [f".. _code-{code}:", "", f"``{code}``", "~" * (len(code) + 4), ""]
    for part, text in parts.items():
        said = f"``{text}``" if part == "example" else text
        lines += [f"*{PARTS[part].strip()}* {said}" if PARTS[part] else said, ""]
    return lines
