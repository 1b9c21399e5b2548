"""The public Python interface: what a notebook imports from ``mlg_troubleshoot``."""

from __future__ import annotations

import ast
import dataclasses
import doctest
import inspect
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import mlg_troubleshoot as mlg

ROOT = Path(__file__).parents[1]
FAILURE = {3: 0.013, 5: 0.007}


def inspection(clearance_in: dict[int, float]) -> mlg.Inspection:
    return mlg.Inspection("R1", "N123", mlg.Side.LH, mlg.ClearanceConvention.RADIAL, clearance_in)


def test_the_example_of_the_package_is_true() -> None:
    found = doctest.testmod(mlg, raise_on_error=True)
    assert found.attempted > 3


def test_every_public_name_can_be_imported_and_is_documented() -> None:
    assert [name for name in mlg.__all__ if not inspect.getdoc(getattr(mlg, name))] == []


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'chek'"):
        mlg.chek  # noqa: B018


def test_every_name_can_be_completed() -> None:
    assert set(mlg.__all__) <= set(dir(mlg))


def test_the_checker_and_the_interpreter_import_the_same_names() -> None:
    tree = ast.parse(Path(mlg.__file__).read_text(encoding="utf-8"))
    typed = {
        alias.name: str(node.module).removeprefix("mlg_troubleshoot.")
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("mlg_troubleshoot")
        for alias in node.names
    }
    assert typed == mlg._MODULES


@cache
def loaded_by(code: str) -> set[str]:
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\n{code}\nprint(*sys.modules)"],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
    )
    return set(done.stdout.split("\n")[-2].split())


def modules_of(*arguments: str) -> set[str]:
    """What a command loads."""
    return loaded_by(
        f"from mlg_troubleshoot.cli import main\nsys.argv = {['mlg', *arguments]!r}\n"
        "try: main()\nexcept SystemExit: pass"
    )


def packages_of(modules: set[str]) -> set[str]:
    """The packages of modules, without Python's own and those that it starts with."""
    named = {name.partition(".")[0] for name in modules - loaded_by("pass")}
    return named - set(sys.stdlib_module_names)


# What a command line needs: typer before 0.26 brings click from outside.
COMMAND_LINE = {"annotated_doc", "click", "mlg_troubleshoot", "rich", "shellingham", "typer"}
# And a check: numpy brings Cython's, msgspec typing_extensions.
CHECK = COMMAND_LINE | {"msgspec", "numpy", "platformdirs", "threadpoolctl"}
CHECK |= {"cython_runtime", "typing_extensions"}
COMMANDS = {"check", "diagnose", "fleet", "gear", "history", "study", "template"}
ONE_GEAR = ("check", "inspection_data/failure_case.csv")


def test_importing_the_package_loads_no_other_one() -> None:
    assert packages_of(loaded_by("import mlg_troubleshoot")) == {"mlg_troubleshoot"}


def test_a_process_that_judges_rows_loads_no_command() -> None:
    assert "mlg_troubleshoot.cli.app" not in loaded_by("import mlg_troubleshoot.__main__")


@pytest.mark.parametrize("asked", [["--help"], ["check", "-h"], []])
def test_help_loads_no_more_than_a_command_line_needs(asked: list[str]) -> None:
    assert packages_of(modules_of(*asked)) <= COMMAND_LINE


@pytest.mark.parametrize("output", [[], ["--json"], ["--detail"]])
def test_a_check_of_one_file_loads_no_library_room_or_command_that_it_does_not_use(output):
    loaded = modules_of(*ONE_GEAR, *output)
    # What stands behind a verdict is a template.
    used = CHECK | ({"jinja2", "markupsafe"} if output == ["--detail"] else set())
    assert {name for name in packages_of(loaded) if not name.startswith("_cython")} <= used
    rooms = {"diagnosis", "notebook", "paper", "schemas", "store", "surveying", "wear"}
    commands = {f"cli.{name}" for name in COMMANDS - {"check"}}
    assert {f"mlg_troubleshoot.{name}" for name in rooms | commands} & loaded == set()


def test_a_life_is_shown_without_loading_the_prompts(tmp_path: Path) -> None:
    store = f"--store={tmp_path / 'kept.sqlite'}"
    loaded = modules_of("history", "N1", "LH", store)
    assert "mlg_troubleshoot.store" in loaded
    assert "mlg_troubleshoot.cli.prompts" not in loaded


def test_predict_gives_the_failure_case() -> None:
    worst = mlg.predict(FAILURE)
    assert worst.magnitude_in == pytest.approx([0.0472], abs=2e-4)


def test_predict_takes_a_batch_in_the_order_of_the_joints() -> None:
    rows = np.zeros((2, 10))
    rows[1, [2, 4]] = 0.013, 0.007
    worst = mlg.predict(rows)
    assert worst.magnitude_in[0] == 0.0
    assert worst.magnitude_in[1] == mlg.predict(FAILURE).magnitude_in[0]


def test_predict_takes_a_gear_its_name_or_its_file() -> None:
    gear = mlg.load_gear()
    found = {
        float(mlg.predict(FAILURE, g).over_in[0])
        for g in (gear, gear.id, gear.path, str(gear.path))
    }
    assert len(found) == 1


@pytest.mark.parametrize(
    ("clearance", "said"),
    [
        ({11: 0.001}, "has no joint 11"),
        ({3: -0.001}, "-0.001 in"),
        ({3: float("nan")}, "nan in"),
        ([0.001] * 9, "do not fit 10 joints"),
    ],
    ids=str,
)
def test_predict_refuses_what_is_not_a_clearance(clearance: object, said: str) -> None:
    with pytest.raises(mlg.TroubleshootError, match=said):
        mlg.predict(clearance)  # type: ignore[arg-type]


def test_check_says_what_the_command_says() -> None:
    found = mlg.check(inspection(FAILURE))
    assert found.verdict is mlg.Verdict.OUTSIDE_MARGIN
    assert [joint.joint for joint in found.ranked][:2] == [3, 5]


def test_check_without_advice_looks_for_no_worn_joints() -> None:
    failed = {"outcome": mlg.Outcome.FAILED, "readings_in": (0.04,)}
    read = dataclasses.replace(inspection(FAILURE), **failed)
    assert mlg.check(read).posterior is not None
    assert mlg.check(read, advice=False).posterior is None


def test_check_with_repairs_finds_the_set() -> None:
    sets = mlg.check(inspection(dict.fromkeys(range(1, 11), 0.001) | FAILURE)).repair_sets
    assert sets is not None
    assert sets[0].joints == (3, 5)


def test_tables_can_be_checked_and_reported(tmp_path: Path) -> None:
    options = mlg.CheckOptions()
    result = mlg.check_files([ROOT / "inspection_data" / "failure_case.csv"], options)
    (written,) = mlg.write_reports(result, options, tmp_path, formats=("html",))
    assert written.html is not None
    assert written.html.exists()


def test_the_package_says_that_it_is_typed() -> None:
    assert (Path(mlg.__file__).parent / "py.typed").exists()
