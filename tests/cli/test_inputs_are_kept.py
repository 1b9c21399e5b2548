"""No output replaces an input or a store, nor another file without ``--force``: refused with exit
code 2 before anything is read. What counts as the same file stands in ``tests/test_outputs.py``.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.conftest import DATA, FAILURE, ROOT, Run, mlg

GEAR = ROOT / "mlg_troubleshoot" / "gear" / "data"
WORKBOOK = FAILURE.with_suffix(".xlsx")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the run: tables, a gear file with what goes with it, and other inputs."""
    shutil.copy(FAILURE, tmp_path / "in.csv")
    shutil.copy(DATA / "measured_pressure.csv", tmp_path / "fleet.csv")
    for source in GEAR.glob("hawker*"):
        shutil.copy(source, tmp_path / source.name)
    shutil.copy(GEAR / "hawker-800xp.toml", tmp_path / "mine.toml")
    for name in ("other.toml", "mine-targets.toml"):
        (tmp_path / name).write_text("what was found", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("command", ["check", "diagnose"])
def test_the_help_of_causes_says_that_the_file_is_run(command: str) -> None:
    assert "runs this file" in " ".join(mlg(command, "--help-all").out.lower().split())


@pytest.fixture
def store(here: Path) -> Path:
    """A store that holds an inspection."""
    place = here / "st.sqlite"
    assert mlg("check", FAILURE, "-q", "--keep", "--store", place).code == 1
    return place


def kept(found: Run, path: Path, before: bytes, option: str) -> None:
    assert found.code == 2, found.err
    assert f"{option} " in found.err
    assert "is one of the inputs" in found.err
    assert path.read_bytes() == before
    assert found.out == ""


@pytest.mark.parametrize(
    "line",
    [
        *("check in.csv --csv in.csv", "check in.csv --annotate in.csv", "check . --csv in.csv"),
        *("check i*.csv --csv in.csv", "check in.csv --force --csv no/../in.csv"),
        "check in.csv --extension other.toml --csv other.toml",
        "check in.csv --causes other.toml --csv other.toml",
        "check in.csv --gear mine.toml --csv mine.toml",
        "check in.csv --force --map other.toml --csv other.toml",
        "diagnose fleet.csv --map other.toml --write-extension other.toml",
        "diagnose fleet.csv --write-extension fleet.csv",
        "diagnose fleet.csv --gear mine.toml --write-extension mine-targets.toml",
        "check in.csv --gear mine.toml --csv hawker-800xp-ensemble.toml",
        "check in.csv --gear mine.toml --csv hawker-800xp-indices.json",
    ],
)
def test_no_output_replaces_an_input(line: str, here: Path) -> None:
    *_command, option, name = words = line.split()
    path = here / Path(name).name
    before = path.read_bytes()
    kept(mlg(*words), path, before, option)


@pytest.mark.parametrize(
    "place", ["st.sqlite", "sqlite:///st.sqlite", "sqlite+pysqlite:///st.sqlite"]
)
@pytest.mark.parametrize("name", ["st.sqlite", "no/../st.sqlite"])
def test_an_export_does_not_replace_its_store(place: str, name: str, store: Path) -> None:
    before = store.read_bytes()
    kept(mlg("history", "export", name, "--store", place, "--force"), store, before, "export")


@pytest.mark.parametrize("option", ["--csv", "--annotate"])
@pytest.mark.parametrize("named", ["path", "url", "environment"])
def test_a_check_does_not_replace_the_store(option, named, store, monkeypatch):
    before = store.read_bytes()
    given = ("--keep", "--store", store if named == "path" else f"sqlite:///{store}")
    if named == "environment":
        monkeypatch.setenv("MLG_STORE", str(store))
        given = ()
    kept(mlg("check", WORKBOOK, "-q", "--force", *given, option, store), store, before, option)


def test_an_output_is_not_the_store_that_the_run_would_make(here: Path) -> None:
    found = mlg("check", "in.csv", "-q", "--keep", "--store", "new", "--csv", "new")
    assert (found.code, "is one of the inputs" in found.err) == (2, True)
    assert not (here / "new").exists()


def test_a_study_may_write_its_table_again_but_not_over_the_gear(here: Path) -> None:
    text = (
        (here / "mine.toml")
        .read_text(encoding="utf-8")
        .replace("hawker-800xp-indices.json", "mine.json")
    )
    gear = here / "mine.json"
    gear.write_text(text, encoding="utf-8")
    kept(mlg("study", "--gear", gear, "--write-table"), gear, text.encode(), "--write-table")


def test_a_report_does_not_replace_an_input_of_its_name(here: Path) -> None:
    table = (here / "in.csv").rename(here / "mlg-258-003-LH.html")
    before = table.read_bytes()
    kept(mlg("check", table, "--report", table.parent), table, before, "--report")


def test_reports_may_stand_beside_their_table(here: Path) -> None:
    assert mlg("check", "in.csv", "--report", here, "--format", "html").code == 1


@pytest.mark.parametrize(
    "place", ["sqlite+pysqlite:///{}?timeout=3", "sqlite:///file:{}?mode=ro&uri=true"]
)
def test_a_store_by_a_url_with_parameters_is_refused_and_stays(place: str, store: Path) -> None:
    before = store.read_bytes()
    run = mlg("history", "export", store, "--store", place.format(store), "--force")
    assert run.code == 2
    assert store.read_bytes() == before


def test_another_store_is_not_replaced_by_an_export(store: Path) -> None:
    other = Path(shutil.copy(store, store.with_name("other.sqlite")))
    found = mlg("history", "export", other, "--store", store, "--force")
    assert (found.code, "is a database" in found.err) == (2, True)
    assert other.read_bytes() == store.read_bytes()


@pytest.mark.parametrize(
    "line",
    [
        "check in.csv --csv",
        f"check {WORKBOOK} --annotate",
        pytest.param("diagnose fleet.csv --write-extension", marks=pytest.mark.slow),
        "history export",
        "template",
    ],
)
def test_a_file_that_something_else_wrote_is_replaced_with_force_only(line, here):
    path = here / "letter.xlsx"
    path.write_text("Dear Sir,", encoding="utf-8")
    found = mlg(*line.split(), path)
    assert (found.code, found.out, "--force" in found.err) == (2, "", True)
    assert path.read_text(encoding="utf-8") == "Dear Sir,"
    assert mlg(*line.split(), path, "--force").code in (0, 1)
    assert path.read_bytes() != b"Dear Sir,"


def test_a_table_of_a_study_replaces_another_with_force_only(here: Path) -> None:
    indices = here / "hawker-800xp-indices.json"
    indices.write_text("{}", encoding="utf-8")
    found = mlg("study", "--gear", "hawker-800xp.toml", "--write-table")
    assert (found.code, f"{indices.name} exists" in found.err) == (2, True)


@pytest.mark.parametrize("suffix", [".html", ".pdf"])
def test_a_report_is_replaced_with_force_only(suffix: str, tmp_path: Path) -> None:
    command = ("check", FAILURE, "-q", "--report", tmp_path, "--format", suffix[1:])
    assert mlg(*command).code == 1
    (report,) = tmp_path.glob(f"*{suffix}")
    report.write_bytes(b"signed by an inspector")
    found = mlg(*command)
    assert found.code == 2
    assert f"--report {report} exists" in found.err
    assert report.read_bytes() == b"signed by an inspector"
    assert mlg(*command, "--force").code == 1
    assert report.read_bytes() != b"signed by an inspector"


def test_rows_that_were_corrected_get_their_reports_beside_those_that_exist(tmp_path: Path) -> None:
    table, out = tmp_path / "fleet.csv", tmp_path / "out"
    rows = "record_id,tail_no,side,clearance_convention,clearance_3_in\nA,N1,LH,RADIAL,0.001\n"
    command = ("check", table, "-q", "--format", "html", "--report", out)
    table.write_text(f"{rows}B,N2,middle,RADIAL,0.001\nC,N3,LH,RADIAL,0.001\n")
    mlg(*command)
    before = {path: path.read_bytes() for path in out.iterdir()}
    table.write_text(f"{rows}B,N2,RH,RADIAL,0.001\nC,N3,LH,RADIAL,0.001\n")
    found = mlg(*command)
    (new,) = {*out.iterdir()} - {*before}
    assert (found.code, new.name.startswith("mlg-N2-RH-")) == (2, True)
    assert {path: path.read_bytes() for path in before} == before
    named = sorted(path.name[:9] for path in before if str(path) in found.err)
    assert named == ["mlg-N1-LH", "mlg-N3-LH"]
    assert f"{new} was written" in found.err


@pytest.mark.parametrize(
    "command",
    [
        pytest.param(("diagnose", "-q"), marks=pytest.mark.slow),
        ("history", "not-stated", "LH", "-q"),
        ("fleet", "-q"),
    ],
    ids=lambda command: command[0],
)
def test_no_page_of_any_command_is_replaced_without_force(command, store, tmp_path):
    few = tmp_path / "few.csv"
    rows = (DATA / "measured_pressure.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    few.write_text("".join(rows[:61]), encoding="utf-8")
    out = ("--report", tmp_path / "out")
    places = (few,) if command[0] == "diagnose" else ("--store", store)
    codes = [mlg(*command, *places, *out, *more).code for more in ((), (), ("--force",))]
    assert codes[0] in (0, 1)
    assert codes[1:] == [2, codes[0]]


def test_a_report_in_a_folder_through_one_that_is_missing_does_not_replace_another_file(tmp_path):
    command = ("check", FAILURE, "-q", "--format", "html", "--report")
    mlg(*command, tmp_path)
    (report,) = tmp_path.glob("*.html")
    report.write_text("mine", encoding="utf-8")
    assert mlg(*command, f"{tmp_path}/no/..").code == 2
    assert report.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    ("first", "second"), [("o.xlsx", "--annotate o.xlsx"), ("mlg-x.html", "--report .")]
)
def test_two_outputs_of_one_run_are_two_files(first: str, second: str, here: Path) -> None:
    found = mlg("check", WORKBOOK, "--csv", first, *second.split())
    assert (found.code, found.out, (here / first).exists()) == (2, "", False)


def test_a_table_may_have_the_name_of_a_report_in_another_folder_than_the_reports(tmp_path):
    csv = tmp_path / "mlg-x.html"
    assert (
        mlg(
            "check", FAILURE, "--csv", csv, "--report", tmp_path / "reports", "--format", "html"
        ).code
        == 1
    )
    assert csv.exists()


@pytest.mark.parametrize(
    "command", [("check", FAILURE, "--csv"), ("history", "export")], ids=lambda c: c[0]
)
def test_a_dash_is_not_taken_for_a_file(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = mlg(*command, "-")
    assert found.code == 2
    assert "- is not the name of a file" in found.err
    assert not (tmp_path / "-").exists()


def test_a_table_that_is_standard_input_is_not_replaced(here: Path) -> None:
    measured = here / "in.csv"
    before = measured.read_bytes()
    with measured.open("rb") as file:
        found = subprocess.run(
            [sys.executable, "-m", "mlg_troubleshoot", "check", "-", "--csv", measured, "--force"],
            stdin=file,
            capture_output=True,
            check=False,
            cwd=ROOT,
        )
    assert found.returncode == 2
    assert b"is one of the inputs (standard input)" in found.stderr
    assert measured.read_bytes() == before


def test_a_gear_file_that_is_not_in_use_is_not_replaced_either(here: Path) -> None:
    gear = here / "mine.toml"
    before = gear.read_bytes()
    found = mlg("diagnose", "fleet.csv", "--write-extension", gear, "--force")
    assert (found.code, gear.read_bytes()) == (2, before)
