"""The wheel, installed into an empty environment and used from another folder."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import venv
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import pypdf
import pytest

ROOT = Path(__file__).parents[1]
TABLE = (
    "record_id,tail_no,side,clearance_convention,clearance_3_in,clearance_5_in,outcome\n"
    "R1,N123,LH,RADIAL,0.013,0.007,FAILED\n"
)
pytestmark = pytest.mark.slow


# As pytest was started: pip finds what its user has set up.
FOR_PIP = dict(os.environ)


def run(
    command: Sequence[str | Path], folder: Path, environment: Mapping[str, str] = os.environ
) -> subprocess.CompletedProcess[str]:
    """Run a command away from the source tree: nothing of this process's Python comes with it."""
    clean = {
        key: value
        for key, value in environment.items()
        if not key.startswith(("PYTHON", "VIRTUAL_ENV"))
    }
    return subprocess.run(
        [str(part) for part in command],
        cwd=folder,
        env=clean,
        capture_output=True,
        text=True,
        encoding="utf-8",
        check=False,
    )


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of this source tree."""
    folder = tmp_path_factory.mktemp("dist")
    done = run(
        [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", folder, ROOT],
        folder,
        FOR_PIP,
    )
    assert done.returncode == 0, done.stderr
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def scripts(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The scripts of an environment that holds the wheel and what it needs."""
    folder = tmp_path_factory.mktemp("installed")
    venv.create(folder / "env", with_pip=True)
    found = folder / "env" / ("Scripts" if sys.platform == "win32" else "bin")
    done = run([found / "python", "-m", "pip", "install", "-q", wheel], folder, FOR_PIP)
    assert done.returncode == 0, done.stderr
    return found


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that knows nothing of the source tree, with one inspection in it."""
    folder = tmp_path_factory.mktemp("elsewhere")
    (folder / "inspection.csv").write_text(TABLE, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def checked(scripts: Path, elsewhere: Path) -> subprocess.CompletedProcess[str]:
    """The check of that inspection, with its report."""
    return run(
        [scripts / "mlg", "check", "inspection.csv", "--json", "--report", "report"], elsewhere
    )


def test_the_wheel_carries_templates_fonts_gears_and_its_types(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    assert {
        "mlg_troubleshoot/templates/inspection.html.j2",
        "mlg_troubleshoot/templates/fonts/DejaVuSans.ttf",
        "mlg_troubleshoot/gear/data/hawker-800xp.toml",
        "mlg_troubleshoot/gear/data/hawker-800xp-indices.json",
        "mlg_troubleshoot/py.typed",
    } <= names


def test_the_wheel_carries_no_tests_and_no_example_data(wheel: Path) -> None:
    tops = {name.split("/")[0] for name in zipfile.ZipFile(wheel).namelist()}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"mlg_troubleshoot"}


def test_the_installed_package_is_not_the_source_tree(scripts: Path, elsewhere: Path) -> None:
    where = run(
        [scripts / "python", "-c", "import mlg_troubleshoot as m; print(m.__file__)"], elsewhere
    ).stdout
    assert Path(where.strip()).is_relative_to(scripts.parent)


def test_the_installed_command_gives_the_failure_case(checked):
    assert checked.returncode == 1, checked.stderr
    (found,) = json.loads(checked.stdout)["inspections"]
    assert found["verdict"] == "OUTSIDE_MARGIN"
    assert found["predicted_displacement_in"] == pytest.approx(0.0472, abs=2e-4)


def test_the_installed_command_writes_html_and_pdf(checked, elsewhere):
    assert sorted(path.suffix for path in (elsewhere / "report").iterdir()) == [".html", ".pdf"]


def test_the_pdf_of_the_installed_command_has_its_fonts_embedded(checked, elsewhere):
    (path,) = (elsewhere / "report").glob("*.pdf")
    for page in pypdf.PdfReader(path).pages:
        for font in page["/Resources"]["/Font"].values():
            entry = font.get_object()
            described = (
                (entry.get("/DescendantFonts") or [entry])[0]
                .get_object()["/FontDescriptor"]
                .get_object()
            )
            assert {"/FontFile", "/FontFile2", "/FontFile3"} & set(described)


def test_the_installed_command_writes_a_template(scripts: Path, elsewhere: Path) -> None:
    assert run([scripts / "mlg", "template", "new.xlsx"], elsewhere).returncode == 0
    assert (elsewhere / "new.xlsx").read_bytes().startswith(b"PK")


def test_the_installed_command_verifies_its_gear(scripts: Path, elsewhere: Path) -> None:
    assert run([scripts / "mlg", "gear", "verify"], elsewhere).returncode == 0


def test_the_installed_package_gives_its_schemas(scripts: Path, elsewhere: Path) -> None:
    code = "import mlg_troubleshoot as m; print(m.schema('check')['$id'])"
    assert (
        run([scripts / "python", "-c", code], elsewhere).stdout == "urn:mlg-troubleshoot:check:2\n"
    )
