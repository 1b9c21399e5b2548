"""No process of ours imports a file of the current folder, which holds tables of others."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from .conftest import FLEET

MLG = (str(Path(sys.executable).with_name("mlg")),)
AS_A_MODULE = (sys.executable, "-m", "mlg_troubleshoot")
# What is imported under one of these names was not found in the folder, or its tests would end.
OWN = {"mlg_troubleshoot", "tests"}
LEFT = "imported.txt"
TRAP = f'with open({LEFT!r}, "a") as file: file.write(__name__ + "\\n")\n'


def trapped(folder: Path, spared: set[str]) -> Path:
    """A table of 552 rows and a file for each module that anything imports."""
    header, *rows = FLEET.read_text(encoding="utf-8").splitlines()
    numbered = [f"{k}{row}" for k in range(12) for row in rows]
    (folder / "table.csv").write_text("\n".join([header, *numbered]), encoding="utf-8")
    for name, some in (("few", rows), ("one", rows[:1])):
        (folder / f"{name}.csv").write_text("\n".join([header, *some]), encoding="utf-8")
    for name in (sys.stdlib_module_names | packages_distributions().keys()) - OWN - spared:
        (folder / f"{name}.py").write_text(TRAP, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, ...], Path]:
    """A folder for each way to start; python -m itself imports from there before it starts us."""
    loaded = [sys.executable, "-c", "import runpy, sys; print(*sys.modules)"]
    before = subprocess.run(loaded, capture_output=True, text=True, check=True).stdout.split()
    spared = {name.partition(".")[0] for name in before}
    return {
        MLG: trapped(tmp_path_factory.mktemp("script"), set()),
        AS_A_MODULE: trapped(tmp_path_factory.mktemp("module"), spared),
    }


# With worker processes and with the engine of pages; the others start alike.
EVERY_DAY = [
    (MLG, "check table.csv --csv verdicts.csv"),
    (MLG, "check one.csv --report report --keep"),
]
SLOW = [
    (MLG, "fleet"),
    (AS_A_MODULE, "check table.csv"),
    (AS_A_MODULE, "check few.csv --json"),
    (MLG, "history"),
    (MLG, "diagnose few.csv"),
    (MLG, "study --design lhs --size 4,60,1"),
    (MLG, "gear verify"),
    (MLG, "template form.pdf"),
    (MLG, "template form.xlsx"),
]


@pytest.mark.parametrize(
    ("program", "arguments"),
    [*EVERY_DAY, *(pytest.param(*each, marks=pytest.mark.slow) for each in SLOW)],
)
def test_nothing_in_the_folder_runs(folders, program, arguments):
    folder = folders[program]
    imported = folder / LEFT
    imported.unlink(missing_ok=True)
    run = subprocess.run(
        [*program, *arguments.split()],
        cwd=folder,
        env={**os.environ, "MLG_STORE": str(folder / "store.db")},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    assert not imported.exists(), imported.read_text(encoding="utf-8")
    assert run.returncode in {0, 1, 3}, run.stderr
    assert "Traceback" not in run.stderr
