"""No output replaces an input or a store, nor another file without ``--force``: refused with exit
code 2 before anything is read.
"""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.conftest import DATA, FAILURE, ROOT, Run, mlg

GEAR = ROOT / "mlg_troubleshoot" / "gear" / "data"
posix = pytest.mark.skipif(sys.platform == "win32", reason="needs links and modes of POSIX")


@pytest.fixture
def measured(tmp_path: Path) -> Path:
    """A table that somebody measured."""
    return Path(shutil.copy(FAILURE, tmp_path / "in.csv"))


@pytest.fixture
def own_gear(tmp_path: Path) -> Path:
    """A gear file with what goes with it."""
    for source in GEAR.glob("hawker*"):
        shutil.copy(source, tmp_path / source.name)
    return Path(shutil.copy(GEAR / "hawker-800xp.toml", tmp_path / "mine.toml"))


def kept(found: Run, path: Path, before: bytes, option: str) -> None:
    assert found.code == 2, found.err
    assert f"{option} " in found.err
    assert "is one of the inputs" in found.err
    assert path.read_bytes() == before
    assert found.out == ""


@pytest.mark.parametrize("option", ["--csv", "--annotate"])
def test_a_check_does_not_replace_its_table(option: str, measured: Path) -> None:
    before = measured.read_bytes()
    kept(mlg("check", measured, option, measured), measured, before, option)


def test_a_table_in_a_folder_is_not_replaced(measured: Path) -> None:
    before = measured.read_bytes()
    kept(mlg("check", measured.parent, "--csv", measured), measured, before, "--csv")


def test_a_table_that_a_pattern_names_is_not_replaced(measured: Path) -> None:
    before = measured.read_bytes()
    kept(mlg("check", measured.parent / "i*.csv", "--csv", measured), measured, before, "--csv")


@posix
@pytest.mark.parametrize("link", [os.symlink, os.link], ids=["symbolic", "hard"])
def test_a_table_behind_a_link_is_not_replaced(link, measured: Path) -> None:
    other = measured.with_name("other.csv")
    link(measured, other)
    before = measured.read_bytes()
    kept(mlg("check", measured, "--csv", other), measured, before, "--csv")


def test_a_diagnosis_does_not_replace_its_table(tmp_path: Path) -> None:
    path = Path(shutil.copy(DATA / "measured_pressure.csv", tmp_path / "m.csv"))
    before = path.read_bytes()
    kept(mlg("diagnose", path, "--write-extension", path), path, before, "--write-extension")


@pytest.mark.parametrize("flag", ["--extension", "--causes"])
def test_a_file_that_a_check_reads_beside_the_table_is_not_replaced(
    flag: str, measured: Path
) -> None:
    other = measured.with_name("other.toml")
    other.write_text("what was found", encoding="utf-8")
    kept(mlg("check", measured, flag, other, "--csv", other), other, b"what was found", "--csv")


@pytest.mark.parametrize(
    ("command", "name"),
    [
        (("check", FAILURE, "--csv"), "mine.toml"),
        (("study", "--csv"), "hawker-800xp-ensemble.toml"),
        (("study", "--csv"), "hawker-800xp-indices.json"),
        (("diagnose", FAILURE, "--write-extension"), "mine-targets.toml"),
    ],
)
def test_no_file_of_a_gear_is_replaced(
    command: tuple[object, ...], name: str, own_gear: Path
) -> None:
    path = own_gear.with_name(name)
    path.touch()
    before = path.read_bytes()
    kept(mlg(*command, path, "--gear", own_gear), path, before, str(command[-1]))


def test_a_study_may_write_its_table_again_but_not_over_the_gear(own_gear: Path) -> None:
    text = own_gear.read_text(encoding="utf-8").replace("hawker-800xp-indices.json", "mine.json")
    gear = own_gear.with_name("mine.json")
    gear.write_text(text, encoding="utf-8")
    kept(mlg("study", "--gear", gear, "--write-table"), gear, text.encode(), "--write-table")


def test_a_report_does_not_replace_an_input_of_its_name(measured: Path) -> None:
    table = measured.rename(measured.with_name("mlg-258-003-LH.html"))
    before = table.read_bytes()
    kept(mlg("check", table, "--report", table.parent), table, before, "--report")


def test_reports_may_stand_beside_their_table(measured: Path) -> None:
    assert mlg("check", measured, "--report", measured.parent, "--format", "html").code == 1


@posix
def test_a_special_file_is_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    found = mlg("check", FAILURE, "--csv", pipe)
    assert found.code == 5
    assert "a device, a pipe or a socket" in found.err
    assert stat.S_ISFIFO(pipe.stat().st_mode)


@posix
@pytest.mark.parametrize("old", [False, True], ids=["new", "old"])
def test_an_output_respects_the_umask_and_the_mode_of_the_old_file(
    old: bool, tmp_path: Path
) -> None:
    path = tmp_path / "out.csv"
    if old:
        path.touch(mode=0o640)
    before = os.umask(0o077)
    try:
        mlg("check", FAILURE, "--csv", path, "--force")
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == (0o640 if old else 0o600)


@pytest.mark.parametrize("command", ["check", "diagnose"])
def test_the_help_of_causes_says_that_the_file_is_run(command: str) -> None:
    assert "runs this file" in " ".join(mlg(command, "--help-all").out.lower().split())


@pytest.fixture
def store(tmp_path: Path) -> Path:
    """A store that holds an inspection."""
    place = tmp_path / "st.sqlite"
    assert mlg("check", FAILURE, "-q", "--keep", "--store", place).code == 1
    return place


@pytest.fixture
def text(tmp_path: Path) -> Path:
    """A file that somebody wrote with another program."""
    path = tmp_path / "letter.txt"
    path.write_text("Dear Sir,", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "command",
    [("check", "--csv"), ("diagnose", "--write-extension")],
    ids=lambda c: c[0],
)
def test_a_table_is_not_replaced_through_a_folder_that_is_missing(
    command: tuple[object, ...], measured: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(measured.parent)
    before = measured.read_bytes()
    found = mlg(command[0], "in.csv", *command[1:], "no/../in.csv", "--force")
    kept(found, measured, before, str(command[-1]))


def test_a_gear_file_is_not_replaced_through_a_folder_that_is_missing(own_gear: Path) -> None:
    before = own_gear.read_bytes()
    found = mlg(
        "check", FAILURE, "--gear", own_gear, "--csv", f"{own_gear.parent}/no/../{own_gear.name}"
    )
    kept(found, own_gear, before, "--csv")


def test_an_export_does_not_replace_its_store_through_a_folder_that_is_missing(store: Path) -> None:
    before = store.read_bytes()
    kept(
        mlg("history", "export", f"{store.parent}/no/../{store.name}", "--store", store),
        store,
        before,
        "export",
    )


@pytest.mark.parametrize("option", ["--csv", "--annotate"])
@pytest.mark.parametrize("named", ["path", "url", "environment"])
def test_a_check_does_not_replace_the_store(
    option: str, named: str, store: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = store.read_bytes()
    given = ("--keep", "--store", store if named == "path" else f"sqlite:///{store}")
    if named == "environment":
        monkeypatch.setenv("MLG_STORE", str(store))
        given = ()
    table = DATA / "failure_case.xlsx"
    kept(mlg("check", table, "-q", "--force", *given, option, store), store, before, option)


def test_an_output_is_not_the_store_that_the_run_would_make(tmp_path: Path) -> None:
    found = mlg(
        "check", FAILURE, "-q", "--keep", "--store", tmp_path / "new", "--csv", tmp_path / "new"
    )
    assert found.code == 2
    assert "is one of the inputs" in found.err
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("place", ["sqlite:///{}", "sqlite+pysqlite:///{}"])
def test_an_export_does_not_replace_its_store_by_url(place: str, store: Path) -> None:
    before = store.read_bytes()
    kept(
        mlg("history", "export", store, "--store", place.format(store), "--force"),
        store,
        before,
        "export",
    )


@pytest.mark.parametrize(
    "place", ["sqlite+pysqlite:///{}?timeout=3", "sqlite:///file:{}?mode=ro&uri=true"]
)
def test_a_store_by_a_url_with_parameters_is_refused_and_stays(place: str, store: Path) -> None:
    before = store.read_bytes()
    run = mlg("history", "export", store, "--store", place.format(store), "--force")
    assert run.code == 2
    assert store.read_bytes() == before


@pytest.mark.parametrize("force", [(), ("--force",)])
def test_another_store_is_not_replaced_by_an_export(force: tuple[str, ...], store: Path) -> None:
    other = Path(shutil.copy(store, store.with_name("other.sqlite")))
    found = mlg("history", "export", other, "--store", store, *force)
    assert found.code == 2
    assert "is a database" in found.err
    assert other.read_bytes() == store.read_bytes()


def test_an_export_is_written_again_with_force_only(store: Path, tmp_path: Path) -> None:
    file = tmp_path / "chain.jsonl"
    command = ("history", "export", file, "--store", store)
    assert [mlg(*command).code, mlg(*command).code, mlg(*command, "--force").code] == [0, 2, 0]


@pytest.mark.parametrize(
    "command",
    [
        ("check", FAILURE, "--csv"),
        ("check", DATA / "failure_case.xlsx", "--annotate"),
        ("diagnose", DATA / "measured_pressure.csv", "--write-extension"),
        ("study", "--csv"),
        ("history", "export"),
        ("template",),
    ],
    ids=lambda command: " ".join(str(word) for word in command if not isinstance(word, Path)),
)
def test_a_file_that_something_else_wrote_is_not_replaced(
    command: tuple[object, ...], text: Path
) -> None:
    path = text.rename(text.with_name("letter.xlsx"))
    found = mlg(*command, path)
    assert found.code == 2, found.err
    assert "--force" in found.err
    assert found.out == ""
    assert path.read_text(encoding="utf-8") == "Dear Sir,"


def test_a_table_of_a_study_replaces_another_with_force_only(own_gear: Path) -> None:
    indices = own_gear.with_name("hawker-800xp-indices.json")
    indices.write_text("{}", encoding="utf-8")
    found = mlg("study", "--gear", own_gear, "--write-table")
    assert found.code == 2
    assert f"{indices} exists" in found.err


def test_a_file_is_replaced_where_that_is_asked_for(text: Path) -> None:
    assert mlg("check", FAILURE, "-q", "--csv", text, "--force").code == 1
    assert text.read_text(encoding="utf-8").startswith("record_id,")


def test_an_earlier_table_and_an_earlier_copy_are_replaced_with_force_only(tmp_path: Path) -> None:
    command = ("check", DATA / "failure_case.xlsx", "-q")
    outputs = ("--csv", tmp_path / "o.csv", "--annotate", tmp_path / "o.xlsx")
    again = [(), (), ("--force",)]
    assert [mlg(*command, *outputs, *more).code for more in again] == [1, 2, 1]


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


@pytest.mark.parametrize(
    "command",
    [
        ("check", DATA / "fleet_batch.csv", "-q", "--format", "html"),
        ("diagnose", DATA / "measured_pressure.csv", "-q"),
        ("history", "not-stated", "LH", "-q"),
        ("fleet", "-q"),
    ],
    ids=lambda command: command[0],
)
def test_no_page_of_any_command_is_replaced_without_force(
    command: tuple[object, ...], store: Path, tmp_path: Path
) -> None:
    out = ("--report", tmp_path / "out")
    places = () if command[0] == "diagnose" else ("--store", store)
    codes = [mlg(*command, *places, *out, *more).code for more in ((), (), ("--force",))]
    assert codes[0] in (0, 1)
    assert codes[1:] == [2, codes[0]]


def test_a_report_in_a_folder_through_one_that_is_missing_does_not_replace_another_file(
    tmp_path: Path,
) -> None:
    command = ("check", FAILURE, "-q", "--format", "html", "--report")
    mlg(*command, tmp_path)
    (report,) = tmp_path.glob("*.html")
    report.write_text("mine", encoding="utf-8")
    assert mlg(*command, f"{tmp_path}/no/..").code == 2
    assert report.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("option", ["--annotate", "--report"])
def test_two_outputs_of_one_run_are_two_files(option: str, tmp_path: Path) -> None:
    csv = tmp_path / ("mlg-x.html" if option == "--report" else "o.xlsx")
    found = mlg(
        "check",
        DATA / "failure_case.xlsx",
        "--csv",
        csv,
        option,
        tmp_path if option == "--report" else csv,
    )
    assert found.code == 2
    assert found.out == ""
    assert not csv.exists()


def test_a_table_may_have_the_name_of_a_report_in_another_folder_than_the_reports(
    tmp_path: Path,
) -> None:
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
def test_a_dash_is_not_taken_for_a_file(
    command: tuple[object, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    found = mlg(*command, "-")
    assert found.code == 2
    assert "- is not the name of a file" in found.err
    assert not (tmp_path / "-").exists()


def test_a_table_that_is_standard_input_is_not_replaced(measured: Path) -> None:
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


def test_a_template_that_was_filled_in_is_not_replaced(tmp_path: Path) -> None:
    mlg("template", tmp_path / "t.xlsx")
    before = (tmp_path / "t.xlsx").read_bytes()
    found = mlg("template", tmp_path / "t.xlsx")
    assert found.code == 2
    assert (tmp_path / "t.xlsx").read_bytes() == before


def test_a_gear_file_that_is_not_in_use_is_not_replaced_either(own_gear: Path) -> None:
    before = own_gear.read_bytes()
    line = ("diagnose", DATA / "measured_pressure.csv", "--write-extension", own_gear, "--force")
    found = mlg(*line)
    assert (found.code, own_gear.read_bytes()) == (2, before)
