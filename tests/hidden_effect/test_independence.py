"""What hides the effects and what finds them know nothing of each other."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

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


@pytest.mark.parametrize("file", SIMULATOR, ids=lambda f: f.name)
def test_the_simulator_imports_nothing_of_the_product(file: Path) -> None:
    assert imported(file) <= {
        "__future__",
        "collections",
        "csv",
        "dataclasses",
        "datetime",
        "functools",
        "itertools",
        "json",
        "math",
        "numpy",
        "pathlib",
        "scipy",
        "typing",
    }


def test_the_simulator_reads_no_file_of_the_product() -> None:
    assert not [f.name for f in SIMULATOR if "mlg_troubleshoot" in f.read_text(encoding="utf-8")]


def test_the_product_imports_nothing_of_the_tests() -> None:
    assert not [
        f for f in PRODUCT if imported(f) & {"tests", "simulator", "hidden_effect", "conftest"}
    ]


def test_the_product_names_no_file_of_the_tests() -> None:
    words = ("hidden_effect", "coordinates.json", "truth_term", "simulate_fleet")
    assert not [f for f in PRODUCT if any(word in f.read_text(encoding="utf-8") for word in words)]
