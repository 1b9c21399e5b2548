"""The house as its imports show it: rooms, doors, and the ways of a cell and of a diagnosis.

``python tests/house.py`` draws the picture in docs/contributing.md again; ``test_house.py`` fails
while that would change anything.
"""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "mlg_troubleshoot"
PAGE = ROOT / "docs" / "contributing.md"
_DRAWN = re.compile(r"(?<=<!-- drawn by tests/house.py -->\n).*?(?=<!-- end -->)", re.DOTALL)

# What happens to one cell of a table, and to a table of plunger readings: file and function.
WAYS = {
    "One cell, from the file to the judgement of its gear": (
        ("cli/check_run.py", "Run"),
        ("workflows/check.py", "check_files"),
        ("records/read.py", "read_many"),
        ("records/tables.py", "read_table"),
        ("records/tables.py", "Columns"),
        ("records/rows.py", "RowReader"),
        ("records/values.py", "read_length"),
        ("decision/inspection.py", "Inspection"),
        ("decision/judge_rows.py", "assess"),
        ("decision/prediction.py", "Cases"),
        ("decision/prediction.py", "predict"),
        ("gear/linkage.py", "worst_case"),
        ("gear/linkage.py", "LinkageModel"),
        ("geometry/kernel.py", "Kernel"),
        ("decision/verdict_rule.py", "verdict"),
        ("decision/planner.py", "plans"),
        ("decision/assessment.py", "Assessment"),
        ("cli/views/one_gear.py", "show"),
    ),
    "One diagnosis, from the table to the extension of the model": (
        ("cli/diagnose.py", "diagnose"),
        ("workflows/diagnose.py", "diagnose_files"),
        ("records/read.py", "read_many"),
        ("diagnosis/table.py", "table_from_inspections"),
        ("diagnosis/diagnose.py", "diagnose"),
        ("diagnosis/causes/base.py", "Cause"),
        ("diagnosis/extension.py", "ModelExtension"),
        ("reporting/diagnosis_report.py", "diagnosis_document"),
    ),
}


# Code tokens that each room may weigh at most. A budget only falls: whoever makes a room lighter
# writes it down again.
BUDGETS: dict[str, int] = {
    "(top)": 8607,
    "cli": 25995,
    "decision": 28760,
    "diagnosis": 33368,
    "gear": 11149,
    "geometry": 5766,
    "indices": 2976,
    "life": 18716,
    "misfit": 17624,
    "notebook": 1729,
    "paper": 5874,
    "records": 43576,
    "reporting": 18187,
    "schemas": 1247,
    "store": 7965,
    "surveying": 4496,
    "wear": 6804,
    "workflows": 16046,
}
_NO_CODE = {
    *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT),
    *(tokenize.ENDMARKER, tokenize.ENCODING),
}


@dataclass(frozen=True)
class Import:
    """One name that a file takes from a module of the package."""

    file: str
    line: int
    module: tuple[str, ...]
    name: str

    @property
    def room(self) -> str:
        return room_of(self.file)

    @property
    def other(self) -> str:
        """The room that it is taken from; a file at the top level has no room."""
        first = (*self.module, self.name)[0]
        return first if (PACKAGE / first).is_dir() else ""


def room_of(file: str) -> str:
    return file.partition("/")[0] if "/" in file else ""


@cache
def trees() -> Mapping[str, ast.Module]:
    return {
        path.relative_to(PACKAGE).as_posix(): ast.parse(path.read_text(encoding="utf-8"))
        for path in sorted(PACKAGE.rglob("*.py"))
    }


@cache
def imports() -> tuple[Import, ...]:
    """Every import of one file from another; a module that is imported stands as its name."""
    return tuple(
        Import(file, node.lineno, tuple(node.module.split(".")[1:]), alias.name)
        for file, tree in trees().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        and node.module is not None
        and node.module.split(".")[0] == PACKAGE.name
        for alias in node.names
    )


def file_of(found: Import) -> str:
    """The file that an import takes its name from, past the door that only hands it on."""
    for parts in ((*found.module, found.name), found.module):
        path = PACKAGE.joinpath(*parts)
        if path.with_suffix(".py").exists():
            return path.with_suffix(".py").relative_to(PACKAGE).as_posix()
    door = "/".join((*found.module, "__init__.py"))
    handed = (each for each in imports() if (each.file, each.name) == (door, found.name))
    return next((file_of(each) for each in handed), door)


def weights() -> Counter[str]:
    """Code tokens of each room, without comments and docstrings; ``(top)`` has the files above."""
    found: Counter[str] = Counter()
    for file, tree in trees().items():
        documented = {
            line
            for node in ast.walk(tree)
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
            and ast.get_docstring(node, clean=False) is not None
            for line in range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1)
        }
        text = (PACKAGE / file).read_text(encoding="utf-8")
        found[room_of(file) or "(top)"] += sum(
            token.type not in _NO_CODE and token.start[0] not in documented
            for token in _with_whole_f_strings(tokenize.generate_tokens(io.StringIO(text).readline))
        )
    return found


def _with_whole_f_strings(tokens: Iterable[tokenize.TokenInfo]) -> Iterator[tokenize.TokenInfo]:
    """Tokens of which an f-string is one, as before Python 3.12."""
    depth = 0
    for token in tokens:
        name = tokenize.tok_name[token.type]
        if depth == 0:
            yield token
        depth += (name == "FSTRING_START") - (name == "FSTRING_END")


def rooms() -> list[str]:
    return sorted({room_of(file) for file in trees()} - {""})


def doors(room: str) -> tuple[str, ...]:
    """What the room's ``__init__`` names for others: names of its own, or whole modules."""
    for node in trees()[f"{room}/__init__.py"].body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return tuple(ast.literal_eval(node.value))
    return ()


def past_a_door() -> Iterator[Import]:
    """Imports that take from another room what its ``__init__`` does not name, or what is
    private.
    """
    for found in imports():
        if not found.other or found.other == found.room or not found.room:
            continue
        taken = (*found.module, found.name)[1]
        if taken not in doors(found.other) or found.name.startswith("_"):
            yield found


def first_line(node: ast.AST) -> str:
    """The first sentence of a docstring."""
    text = ast.get_docstring(node) or ""  # type: ignore[arg-type]
    return " ".join(text.split("\n\n")[0].split()).rstrip(".")


def uses() -> dict[str, set[str]]:
    """The rooms that each room imports from."""
    found: dict[str, set[str]] = {room: set() for room in rooms()}
    for each in imports():
        if each.room and each.other and each.other != each.room:
            found[each.room].add(each.other)
    return found


def reach(direct: Mapping[str, set[str]]) -> dict[str, set[str]]:
    """The rooms that each room needs at last; imports run downward, so there is an end."""
    found: dict[str, set[str]] = {}

    def of(room: str) -> set[str]:
        if room not in found:
            found[room] = direct[room].union(*(of(other) for other in direct[room]))
        return found[room]

    for room in direct:
        of(room)
    return found


def picture() -> str:
    """Rooms from top to bottom; an arrow is left out where a longer way leads to the same room."""
    direct = uses()
    needed = reach(direct)
    arrows = [
        f"    {room} --> {other}"
        for room in sorted(direct, key=lambda room: (-len(needed[room]), room))
        for other in sorted(direct[room])
        if not any(other in needed[third] for third in direct[room])
    ]
    return "\n".join(["```mermaid", "flowchart TD", *arrows, "```"])


def table() -> str:
    """Each room with what it is."""
    order = sorted(rooms(), key=lambda room: (-len(reach(uses())[room]), room))
    lines = [f"| `{room}/` | {first_line(trees()[f'{room}/__init__.py'])} |" for room in order]
    return "\n".join(["| room | what it is |", "|---|---|", *lines])


def ways() -> str:
    """The files that a cell and a diagnosis pass; each file says what is done there."""
    found = []
    for title, steps in WAYS.items():
        lines = [
            f"{n}. `{file}` `{defined(file, name).name}`" for n, (file, name) in enumerate(steps, 1)
        ]
        found.append("\n".join([f"**{title}**", "", *lines]))
    return "\n\n".join(found)


def defined(file: str, name: str) -> ast.ClassDef | ast.FunctionDef:
    """The function or class of that name; `StopIteration` if the file has none."""
    return next(
        node
        for node in trees()[file].body
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name == name
    )


def drawn() -> str:
    return "\n\n".join([picture(), table(), ways()]) + "\n"


def page() -> str:
    """docs/contributing.md with the house as it is now."""
    return _DRAWN.sub(lambda _: drawn(), PAGE.read_text(encoding="utf-8"))


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
