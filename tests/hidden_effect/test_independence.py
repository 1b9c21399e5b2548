"""What hides the effects and what finds them know nothing of each other."""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
SIMULATOR = sorted((Path(__file__).parent / "simulator").glob("*.py"))
PRODUCT = sorted((ROOT / "mlg_troubleshoot").rglob("*.py"))


def imported(file: Path) -> set[str]:
    """First names of the modules that a file imports from outside its own package."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add(str(node.module).split(".")[0])
        elif isinstance(node, ast.ImportFrom) and node.level > 1:
            found.add("a package above its own")
    return found


def test_the_simulator_imports_nothing_of_the_product() -> None:
    allowed = "__future__ collections csv dataclasses datetime functools itertools json math numpy"
    for file in SIMULATOR:
        assert imported(file) <= {*allowed.split(), "pathlib", "scipy", "typing"}, file.name


def test_the_simulator_names_no_file_of_the_product_and_imports_nothing_by_a_name() -> None:
    words = ("mlg", "__import__", "import_module", "exec(", "eval(")
    assert not [
        (f.name, word) for f in SIMULATOR for word in words if word in f.read_text(encoding="utf-8")
    ]


def test_the_product_imports_nothing_of_the_tests() -> None:
    assert not [
        f for f in PRODUCT if imported(f) & {"tests", "simulator", "hidden_effect", "conftest"}
    ]


def test_the_product_names_no_file_of_the_tests() -> None:
    words = ("hidden_effect", "coordinates.json", "truth_term", "simulate_fleet")
    assert not [f for f in PRODUCT if any(word in f.read_text(encoding="utf-8") for word in words)]
