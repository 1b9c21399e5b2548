"""README.md and docs/: their commands work, their sessions and pictures are what the program makes
today.
"""

from __future__ import annotations

import re
import subprocess
import tomllib
from pathlib import Path
from urllib.parse import unquote

import pytest
from pytest_examples import CodeExample, EvalExample, find_examples

import mlg_troubleshoot
from mlg_troubleshoot.decision.columns import COLUMNS
from mlg_troubleshoot.diagnosis import CATALOGUE
from tests import docs_examples, numbers_page
from tests.docs_examples import PAGES, PICTURES, README, ROOT

TEXT = README.read_text(encoding="utf-8")
CHECK_COMMAND = (
    "python3 -m venv .venv && .venv/bin/pip install -q . && "
    ".venv/bin/mlg check inspection_data/failure_case.csv --report report"
)
TEST_COMMAND = (
    "python3 -m venv .venv && .venv/bin/pip install -q -e '.[dev]' && .venv/bin/python -m pytest"
)
SESSIONS = {
    f"{page.relative_to(ROOT).as_posix()} {session.commands[0].split('|')[0].strip()[:50]}": session
    for page in PAGES
    for _match, session in docs_examples.sessions(page.read_text(encoding="utf-8"))
}
NUMBER = re.compile(r"-?\d+\.\d+")
OUT_OF_DATE = "run: python tests/docs_examples.py"


def test_the_first_command_stands_there_exactly() -> None:
    assert f"```sh\n{CHECK_COMMAND}\n```" in TEXT


def test_the_test_command_stands_directly_under_its_mark() -> None:
    assert f"<!-- test command -->\n```sh\n{TEST_COMMAND}\n```" in TEXT


def test_continuous_integration_takes_the_test_command_from_here() -> None:
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    (line,) = [line for line in script.splitlines() if line.startswith("test_command=")]
    found = subprocess.run(
        ["bash", "-c", f'{line}\nprintf %s "$test_command"'],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert found.stdout == TEST_COMMAND


def test_exit_code_1_is_explained_beside_the_command() -> None:
    after = TEXT.partition(CHECK_COMMAND)[2][:200]
    assert 'exit code 1. That is not an error: it means "not within margin"' in after


# Pages of many long commands: run with the slow part.
LONG = {"life-of-a-gear.md", "diagnosis-solution.md", "robot-arm.md", "groundwater-heads.md"}
# Of these only the examples in Python take seconds.
LONG_EXAMPLES = {
    *LONG,
    *("measured-gear.md", "why-named.md", "gear-eccentricity.md", "plotter-hysteresis.md"),
    "python.md",
}


@pytest.mark.parametrize(
    "page",
    [pytest.param(page, marks=[pytest.mark.slow] * (page.name in LONG)) for page in PAGES],
    ids=lambda page: page.relative_to(ROOT).as_posix(),
)
def test_a_page_shows_what_its_commands_print_today(page: Path, tmp_path: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert docs_examples.refreshed(text, tmp_path) == text, OUT_OF_DATE


def test_a_page_says_in_its_first_lines_for_whom_it_is_and_how_long_it_takes() -> None:
    for page in PAGES:
        beginning = " ".join(page.read_text(encoding="utf-8").split()[:70])
        assert re.search(r"\bfor\b|One page", beginning, re.IGNORECASE), page
        assert re.search(r"minute|look up", beginning, re.IGNORECASE), page


def test_there_are_sessions() -> None:
    assert len(SESSIONS) > 5


@pytest.mark.parametrize(
    "example",
    [
        pytest.param(example, marks=[pytest.mark.slow] * (example.path.name in LONG_EXAMPLES))
        for example in find_examples(*PAGES)
        # Needs a cluster: tests/decision/test_workers.py starts one.
        if example.path.name != "cluster.md"
    ],
    ids=str,
)
def test_the_python_examples_are_true(example: CodeExample, eval_example: EvalExample) -> None:
    eval_example.run_print_check(example)


@pytest.mark.parametrize("name", ["linkage.svg"])
def test_a_picture_is_what_the_program_draws_today(name: str) -> None:
    shipped, drawn = (PICTURES / name).read_text(encoding="utf-8"), docs_examples.pictures()[name]
    assert NUMBER.sub("#", shipped) == NUMBER.sub("#", drawn), OUT_OF_DATE
    # Other processors round the last digit otherwise.
    assert [float(n) for n in NUMBER.findall(shipped)] == pytest.approx(
        [float(n) for n in NUMBER.findall(drawn)], abs=0.02
    ), OUT_OF_DATE


def test_a_picture_says_where_the_geometry_comes_from() -> None:
    assert "reconstructed from published figures, not drawing data" in (
        PICTURES / "linkage.svg"
    ).read_text("utf-8")


def anchors(text: str) -> set[str]:
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {
        "#" + re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings
    }


def links() -> list[tuple[Path, str]]:
    found = (
        (page, set(re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8"))))
        for page in PAGES
    )
    return [
        (page, link)
        for page, here in found
        for link in sorted(here)
        if not link.startswith("https:")
    ]


def leads_somewhere(page: Path, link: str) -> bool:
    name, _, heading = link.partition("#")
    target = page.parent / unquote(name) if name else page
    return target.exists() and (
        not heading or f"#{heading}" in anchors(target.read_text(encoding="utf-8"))
    )


def test_every_link_leads_somewhere() -> None:
    found = links()
    assert len(found) > 100
    assert [(page.name, link) for page, link in found if not leads_somewhere(page, link)] == []


def test_every_page_can_be_reached_from_the_readme() -> None:
    reached, todo = {README}, [README]
    while todo:
        page = todo.pop()
        for origin, link in links():
            target = (origin.parent / unquote(link.partition("#")[0])).resolve()
            if origin == page and target.suffix == ".md" and target not in reached:
                reached.add(target)
                todo.append(target)
    assert {page.relative_to(ROOT).as_posix() for page in PAGES if page not in reached} == set()


def test_every_script_that_is_named_exists() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    scripts = re.findall(r"python ((?:\w+/)+\w+\.py)", text)
    modules = re.findall(r"python -m (tests\.[\w.]+\w)", text)
    scripts += [f"{name.replace('.', '/')}.py" for name in modules]
    assert len(scripts) > 5
    assert [s for s in scripts if not (ROOT / s).is_file()] == []


# Options of other programs that a page runs.
OF_OTHERS = {"--cases", "--no-deps", "--owner", "--pwprompt", "--strict"}


def test_every_option_that_a_page_names_exists() -> None:
    params = [p for _path, command in docs_examples.all_commands() for p in command.params]
    known = {option for p in params for option in (*p.opts, *p.secondary_opts)}
    known |= OF_OTHERS | {"--version", "--help", "--help-all"}
    named = {
        (page.name, option)
        for page in PAGES
        if page.name not in {"changelog.md", "figures.md"}
        for option in re.findall(r"(?<![\w-])--[a-z][\w-]+", page.read_text(encoding="utf-8"))
    }
    assert {(page, option) for page, option in named if option not in known} == set()


def test_every_option_and_public_name_has_its_user_and_no_other_one() -> None:
    options = [
        (path, max(option.opts, key=len))
        for path, command in docs_examples.all_commands()
        for option in command.params
        if option.param_type_name == "option" and "--help" not in option.opts
    ]
    users = set(docs_examples.by_name(docs_examples.USERS))
    assert {name for path, name in options if not {name, f"{path} {name}"} & users} == set()
    assert users - {name for path, name in options for name in (name, f"{path} {name}")} == set()
    assert set(docs_examples.by_name(docs_examples.USERS_OF_NAMES)) == set(mlg_troubleshoot.__all__)


def test_the_python_version_is_that_of_the_project() -> None:
    wanted = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "requires-python"
    ]
    assert f"Python {wanted.removeprefix('>=')} or later" in TEXT


@pytest.mark.parametrize(
    "said",
    [
        "does not replace the maintenance manual's limits",
        *("not an approval for return to service", "The geometry is synthetic"),
        *("The published failure was fitted", "The worst case is a bound"),
        *("Both ends of one link act alike", "In-plane joint clearance only"),
    ],
)
def test_what_the_program_cannot_say_is_said(said: str) -> None:
    assert said in " ".join(TEXT.split())


def test_every_cause_has_a_line_that_states_the_columns_it_needs() -> None:
    page = (ROOT / "docs/explanation/causes.md").read_text(encoding="utf-8")
    names = {"axial_float": "axial_float_n_in", "day": "inspection_date"}
    for cause in CATALOGUE:
        line = re.findall(rf"^\| \[?`{cause.name}`.*", page, re.MULTILINE)[0]
        needs = line.split(" | ")[2]
        assert [n for n in cause.needs if f"`{names.get(n, n)}`" not in needs] == [], cause.name


def test_every_column_is_described() -> None:
    page = (ROOT / "docs/reference/columns.md").read_text(encoding="utf-8")
    assert [column.name for column in COLUMNS if f"`{column.name}" not in page] == []


SUMMARY = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in (ROOT / "docs/reference/figures.md").read_text(encoding="utf-8").splitlines()
    if re.match(r"\| (?:technician|fleet engineer|analyst) \|", line)
]


def section(page: Path, anchor: str) -> str:
    """The text below a heading, up to the next heading."""
    parts = re.split(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    (text,) = [
        text
        for heading, text in zip(parts[1::2], parts[2::2], strict=True)
        if anchors(f"# {heading}") == {anchor}
    ]
    return text


def test_the_figures_begin_with_the_twenty_numbers_that_matter() -> None:
    assert len(SUMMARY) == 20


def test_a_number_that_matters_stands_in_the_section_it_links_to() -> None:
    for _reader, what, value, _meaning, link in SUMMARY:
        anchor = link.partition("(")[2].rstrip(")")
        details = section(ROOT / "docs/reference/figures.md", anchor)
        assert [n for n in re.findall(r"\d+(?:\.\d+)?", value) if n not in details] == [], what


def test_a_file_that_a_page_names_exists() -> None:
    """From the top or within the package."""
    named = {
        path
        for page in PAGES
        if page.name != "changelog.md"
        for path in re.findall(
            r"`([a-z_]+/[\w./-]*(?:\.py|\.toml|\.md|/))`", page.read_text(encoding="utf-8")
        )
    }
    tops = ROOT, ROOT / "mlg_troubleshoot"
    assert [path for path in named if not any((top / path).exists() for top in tops)] == []


def test_the_map_for_contributors_leads_into_every_room_that_holds_a_rule() -> None:
    page = ROOT / "docs/contributing.md"
    map_of_files = section(page, "#where-is-")
    rooms = set(re.findall(r"`(\w+)/", map_of_files))
    assert {"cli", "decision", "diagnosis", "gear", "life", "misfit", "records", "store"} <= rooms


def test_the_table_of_numbers_is_current() -> None:
    written = numbers_page.PAGE.read_text(encoding="utf-8")
    assert numbers_page.page() == written, "run: python tests/numbers_page.py"


def test_every_number_of_the_diagnosis_has_a_meaning() -> None:
    assert [c.name for c in numbers_page.chosen() if not c.meaning] == []


def test_the_readme_is_not_a_book() -> None:
    assert len(TEXT.splitlines()) <= 200


def test_every_room_of_the_package_is_named() -> None:
    rooms = {
        p.name
        for p in (ROOT / "mlg_troubleshoot").iterdir()
        if p.is_dir() and not p.name.startswith("_")
    }
    assert {room for room in rooms if f"`{room}/`" not in TEXT} == set()


def test_the_readme_has_the_first_run_on_windows() -> None:
    """Each command of the first run, as a Windows prompt takes it."""
    text = README.read_text(encoding="utf-8")
    (lines,) = re.findall(r"```bat\n(.*?)```", text, re.DOTALL)
    venv, install, first = lines.splitlines()
    assert venv == "py -m venv .venv"
    assert install.startswith(".venv\\Scripts\\pip install")
    assert first.startswith(".venv\\Scripts\\mlg check inspection_data\\failure_case.csv")
