"""The project keeps its own rules: format, lint, types, layers, docstrings, constants, top
level.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import io
import pkgutil
import re
import subprocess
import sys
import tokenize
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import is_dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from numpydoc.docscrape import NumpyDocString, Parameter

import mlg_troubleshoot

from . import house

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "mlg_troubleshoot"
TOP_LEVEL = {
    *("pyproject.toml", "mlg_troubleshoot", "inspection_data", "templates", "tests", "docs"),
    "README.md",
}


def run(*arguments: str) -> None:
    """Run a tool on the project and show what it says if it is not content."""
    done = subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_code_is_formatted() -> None:
    run("-m", "ruff", "format", "--check", ".")


def test_the_linter_finds_nothing() -> None:
    run("-m", "ruff", "check", ".")


def test_the_types_are_right() -> None:
    run("-m", "mypy")


def test_imports_run_downward_only() -> None:
    run("-c", "from importlinter.cli import lint_imports_command; lint_imports_command()")


def sources() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def test_25_4_stands_only_in_units() -> None:
    found = set()
    for path in sources():
        text = path.read_text(encoding="utf-8")
        tokens = tokenize.generate_tokens(io.StringIO(text).readline)
        if re.search(r"25\.4|393", text) and any(
            token.type == tokenize.NUMBER and float_of(token.string) in {25.4, 1 / 25.4}
            for token in tokens
        ):
            found.add(path.relative_to(PACKAGE).as_posix())
    assert found == {"units.py"}


def float_of(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def test_nothing_catches_every_exception() -> None:
    found = [
        f"{file}:{node.lineno}"
        for file, tree in house.trees().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ExceptHandler)
        and (
            node.type is None
            or {"Exception", "BaseException"}
            & {n.id for n in ast.walk(node.type) if isinstance(n, ast.Name)}
        )
    ]
    assert found == []


def code_lines(function: ast.FunctionDef, text: Sequence[str]) -> int:
    """Lines of a function that are neither signature nor docstring, blank or comment."""
    first = function.body[1 if ast.get_docstring(function) and len(function.body) > 1 else 0].lineno
    lines = [line.strip() for line in text[first - 1 : function.end_lineno]]
    return sum(bool(line) and not line.startswith("#") for line in lines)


def test_no_function_is_longer_than_seventy_lines() -> None:
    long = [
        f"{file}:{node.lineno} {node.name}"
        for file, tree in house.trees().items()
        for text in [(PACKAGE / file).read_text(encoding="utf-8").splitlines()]
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and code_lines(node, text) > 70
    ]
    assert long == []


def test_the_linter_limits_parameters_and_branches_and_every_exception_has_its_reason() -> None:
    lint = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["ruff"][
        "lint"
    ]
    assert (lint["pylint"]["max-args"], lint["mccabe"]["max-complexity"]) == (8, 15)
    assert not {"PLR0913", "C901"} & set(lint["ignore"])
    marked = [
        line
        for path in sources()
        for line in path.read_text(encoding="utf-8").splitlines()
        if "# noqa" in line
    ]
    assert [line for line in marked if not re.search(r"# noqa: [A-Z0-9, ]+ - \w", line)] == []


def test_nothing_else_stands_at_the_top_level() -> None:
    visible = {entry.name for entry in ROOT.iterdir() if not entry.name.startswith(".")}
    # What the README's commands leave behind is ignored there and here.
    left_behind = {
        line.rstrip("/") for line in (ROOT / ".gitignore").read_text(encoding="utf-8").split()
    }
    assert visible - TOP_LEVEL - left_behind == set()


def test_the_geometry_knows_no_aircraft() -> None:
    words = re.compile(
        r"hawker|landing|plunger|sidestay|bellcrank|valve|retract|down.?lock|\bgears?\b",
        re.IGNORECASE,
    )
    found = [
        f"{path.name}:{number}: {line.strip()}"
        for path in (PACKAGE / "geometry").glob("*.py")
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if words.search(line)
    ]
    assert found == []


@cache
def modules() -> tuple[ModuleType, ...]:
    names = [
        info.name for info in pkgutil.walk_packages(mlg_troubleshoot.__path__, "mlg_troubleshoot.")
    ]
    return tuple(importlib.import_module(name) for name in names if not name.endswith("__main__"))


def module_names() -> list[str]:
    return [
        ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for path in sources()
        if path.name not in {"__init__.py", "__main__.py"}
    ]


def public(module: ModuleType) -> Iterator[tuple[str, Any]]:
    """Public functions, classes and methods that a module defines."""
    for name, thing in vars(module).items():
        if name.startswith("_") or getattr(thing, "__module__", None) != module.__name__:
            continue
        if inspect.isfunction(thing):
            yield name, thing
        elif inspect.isclass(thing):
            yield name, thing
            yield from (
                (f"{name}.{part}", member)
                for part, member in members_of(thing)
                if inspect.isfunction(member)
            )


def members_of(thing: Any) -> Iterator[tuple[str, Any]]:
    """Public methods and properties that a class itself defines."""
    for part, member in vars(thing).items() if inspect.isclass(thing) else ():
        function = member.__func__ if isinstance(member, classmethod | staticmethod) else member
        if not part.startswith("_") and (
            inspect.isfunction(function) or isinstance(function, property)
        ):
            yield part, function


def documented(thing: Any, section: str = "Parameters") -> list[Parameter]:
    """Entries of a docstring; those of a class and of what it extends, which are its parameters,
    too.
    """
    described = [
        each
        for each in getattr(thing, "__mro__", (thing,))
        if each.__module__.startswith("mlg_troubleshoot")
    ]
    return [entry for each in described for entry in parsed(vars_doc(each) or "")[section]]


@cache
def parsed(docstring: str) -> NumpyDocString:
    return NumpyDocString(inspect.cleandoc(docstring))


def names_of(entries: list[Parameter]) -> list[str]:
    return [name.strip().lstrip("*") for entry in entries for name in entry.name.split(",")]


def accepted(thing: Any) -> list[str]:
    """Names of the parameters that a caller gives."""
    if inspect.isclass(thing) and (
        thing.__init__ is object.__init__ or getattr(thing, "_is_protocol", False)
    ):
        return []
    try:
        parameters = inspect.signature(thing).parameters
    except ValueError:
        return []
    return [name for name in parameters if name not in {"self", "cls"} and not name.startswith("_")]


def is_an_exception_or_a_value(thing: Any) -> bool:
    return inspect.isclass(thing) and issubclass(thing, BaseException | str | int)


# Rooms that stand on their own for those who write scripts.
ROOMS_FOR_SCRIPTS = ("diagnosis", "wear")


def stands_in_the_public_api(label: str, thing: Any) -> bool:
    """Names that a package lists for those who use it from Python; the others are read beside their
    code.
    """
    packages = ("mlg_troubleshoot", *(f"mlg_troubleshoot.{room}" for room in ROOMS_FOR_SCRIPTS))
    lists = [importlib.import_module(package) for package in packages]
    return any(label in package.__all__ and getattr(package, label) is thing for package in lists)


def test_every_module_has_a_docstring() -> None:
    assert [name for name in module_names() if not importlib.import_module(name).__doc__] == []


def test_every_name_of_the_public_api_has_a_docstring() -> None:
    in_api = [
        (f"{name}.{label}", thing)
        for name in module_names()
        for label, thing in public(importlib.import_module(name))
        if stands_in_the_public_api(label, thing)
    ]
    parts = [
        (f"{label}.{part}", member) for label, thing in in_api for part, member in members_of(thing)
    ]
    assert [label for label, thing in [*in_api, *parts] if not vars_doc(thing)] == []


def vars_doc(thing: Any) -> str | None:
    """The docstring that stands at the thing itself, not one that it inherits."""
    doc = thing.__doc__
    # A dataclass without a docstring gets its signature as one.
    return None if doc is None or doc.startswith(f"{getattr(thing, '__name__', '')}(") else doc


def public_names(*rooms: str) -> Iterator[tuple[str, Any]]:
    """Public functions, classes and methods of all rooms, or of these."""
    for name in module_names():
        if not rooms or name.split(".")[1] in rooms:
            yield from public(importlib.import_module(name))


def test_documented_parameters_are_those_of_the_signature() -> None:
    wrong = []
    for label, thing in public_names():
        found, wanted = names_of(documented(thing)), accepted(thing)
        if "Parameters\n" not in (vars_doc(thing) or "") and (
            is_an_exception_or_a_value(thing) or not stands_in_the_public_api(label, thing)
        ):
            continue
        if set(found) != set(wanted):
            wrong.append(f"{label}: documented {found}, takes {wanted}")
    assert wrong == []


NUMERIC = re.compile(r"\bfloat\b|\bndarray\b|\barray_like\b")
NOT_NUMERIC = re.compile(r"\bof (?:str|int|bool)\b|\bmapping of str to str\b|dict of str to str")
HAS_UNIT = re.compile(r"\[[^\[\]]+\]\.?$")
# Rooms whose numbers are lengths, angles and probabilities.
ROOMS_WITH_UNITS = ("geometry", "gear", "decision")
# A value in a unit that the object itself says, and the two results of a search that are named
# there.
UNIT_SAID_ELSEWHERE = {"LengthUnit.to_inches", "LengthUnit.from_inches", "WrittenLength", "Sourced"}


def test_every_numeric_line_of_a_docstring_ends_in_its_unit() -> None:
    wrong = []
    for label, thing in public_names(*ROOMS_WITH_UNITS):
        if label in UNIT_SAID_ELSEWHERE:
            continue
        for entry in (
            e for s in ("Parameters", "Returns", "Attributes") for e in documented(thing, s)
        ):
            if NUMERIC.search(entry.type) and not NOT_NUMERIC.search(entry.type):
                text = " ".join(entry.desc).strip()
                if not HAS_UNIT.search(text):
                    wrong.append(f"{label}: {entry.name} : {entry.type}: {text}")
    assert wrong == []


def test_results_cannot_be_changed_after_they_are_made() -> None:
    thawed = [
        f"{module.__name__}.{label}"
        for module in modules()
        if module.__name__.split(".")[1] in (*ROOMS_WITH_UNITS, "indices", "paper", "surveying")
        for label, thing in public(module)
        if inspect.isclass(thing) and is_dataclass(thing) and not thing.__dataclass_params__.frozen  # type: ignore[attr-defined]
    ]
    assert thawed == []


def test_the_package_holds_no_machine_path() -> None:
    pattern = re.compile(r"[\"'(\s]/(?:home|work|root|tmp)/")
    found = [path.name for path in sources() if pattern.search(path.read_text(encoding="utf-8"))]
    assert found == []
