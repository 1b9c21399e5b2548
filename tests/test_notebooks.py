"""The notebooks of the documentation run, and the code host can show them with their pictures.

`python tests/test_notebooks.py` runs them and keeps what they show.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[1] / "docs" / "notebooks"
NAMES = ("a-hidden-cause", "another-simulation", "check-a-fleet")


def notebook(name: str) -> Any:
    return nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)


def run_notebook(name: str) -> Any:
    run = notebook(name)
    NotebookClient(
        run,
        timeout=300,
        kernel_name="python3",
        resources={"metadata": {"path": str(FOLDER)}},
        record_timing=False,
    ).execute()
    return run


def shown(cell: Any) -> list[str]:
    """The plain text of a cell's results."""
    return [
        o["data"]["text/plain"] if "data" in o else o.get("text", "")
        for o in cell.get("outputs", [])
    ]


def test_there_are_three_notebooks() -> None:
    assert sorted(path.stem for path in FOLDER.glob("*.ipynb")) == list(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_is_kept_with_a_picture_and_without_an_error(name: str) -> None:
    outputs = [o for cell in notebook(name).cells for o in cell.get("outputs", [])]
    assert any("image/svg+xml" in o.get("data", {}) for o in outputs)
    assert all(o["output_type"] != "error" for o in outputs)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_runs_and_shows_what_is_kept_in_it(name: str) -> None:
    kept, run = notebook(name), run_notebook(name)
    assert [shown(cell) for cell in run.cells] == [shown(cell) for cell in kept.cells]


if __name__ == "__main__":
    for each in NAMES:
        nbformat.write(run_notebook(each), FOLDER / f"{each}.ipynb")
