"""The table of the numbers that somebody chose in the diagnosis: what each means, from its comment.

``python tests/numbers_page.py`` writes docs/reference/numbers.md again; ``test_docs.py`` fails
while that would change anything.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "reference" / "numbers.md"
ROOMS = ("diagnosis", "misfit")
_HEAD = """# Numbers of the diagnosis

For whoever maintains `diagnosis/` and `misfit/`: every number that somebody chose at the level of
a module, with its meaning and source. Look up a line. Made from the comments in the code by
`python tests/numbers_page.py`. What is believed beforehand stands in
[the priors](../explanation/diagnosis.md#priors), what is plausible of a cause with the cause.

"""


@dataclass(frozen=True)
class Chosen:
    """One assignment at the level of a module that holds a number with a decimal point."""

    file: str
    name: str
    value: str
    meaning: str


def chosen() -> Iterator[Chosen]:
    """Every such number, in the order of files and lines."""
    for room in ROOMS:
        for path in sorted((ROOT / "mlg_troubleshoot" / room).rglob("*.py")):
            yield from _of_file(path)


def _of_file(path: Path) -> Iterator[Chosen]:
    text = path.read_text(encoding="utf-8")
    lines = text.splitlines()
    meaning = ""
    for node in ast.parse(text).body:
        if not isinstance(node, ast.Assign):
            meaning = ""
            continue
        comment: list[str] = []
        line = node.lineno - 2
        while line >= 0 and lines[line].startswith("#"):
            comment.insert(0, lines[line].lstrip("# "))
            line -= 1
        # Numbers that follow each other share a comment.
        meaning = " ".join(comment) or meaning
        numbers = (n.value for n in ast.walk(node.value) if isinstance(n, ast.Constant))
        if any(isinstance(number, float) for number in numbers):
            file = path.relative_to(ROOT / "mlg_troubleshoot").as_posix()
            yield Chosen(file, ast.unparse(node.targets[0]), ast.unparse(node.value), meaning)


def page() -> str:
    """The page as it should be."""
    parts = []
    for file, numbers in groupby(chosen(), key=lambda c: c.file):
        parts.append(f"\n`{file}`:\n")
        for meaning, same in groupby(numbers, key=lambda c: c.meaning):
            names = ", ".join(f"`{c.name}` = `{c.value}`" for c in same)
            parts.append(f"- {names}: {meaning}")
    return _HEAD + "\n".join(parts).lstrip() + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
