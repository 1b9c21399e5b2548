"""``mlg gear new`` and ``mlg gear draw``, and a table of indices that follows the geometry."""

from __future__ import annotations

import re
import tomllib
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

import pytest

from mlg_troubleshoot.cli.gear_prompts import ask_gear
from mlg_troubleshoot.cli.prompts import Line
from mlg_troubleshoot.errors import GearFileError
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.gear.short_form import read_short_form
from mlg_troubleshoot.indices.index_table import read_index_table
from mlg_troubleshoot.workflows.check import next_step
from mlg_troubleshoot.workflows.index_tables import load_index_table
from mlg_troubleshoot.workflows.new_gear import from_pylinkage, new_gear
from tests.cli.conftest import FAILURE, ROOT, mlg

SHORT = ROOT / "docs" / "how-to" / "data" / "four-bar-three-pins.toml"
ANSWERS = (
    "door linkage",
    *("O 0 0", "D 3 0", ""),
    *("A 0 1", "B 3.5 2.4", ""),
    *("crank O A", "coupler A B", "rocker D B", ""),
    "",
    "",
    "crank crank -10 0",
    "angle_of rocker",
    *("A 0.005", "D 0.004", ""),
    "0.02",
    "measured on the bench",
)


@pytest.fixture
def gear(tmp_path: Path) -> Path:
    """A gear file made from a short form."""
    new_gear(SHORT, tmp_path / "mine.toml")
    return tmp_path / "mine.toml"


class Typed:
    """A terminal on which the answers are typed in turn; what was said is kept."""

    width = 80

    def __init__(self, *answers: str) -> None:
        self.answers, self.said = list(answers), ""

    def say(self, lines: Iterable[Line]) -> None:
        self.said += "".join(f"{each.text}\n" for each in lines)

    def ask(self, prompt: str) -> str:
        self.said += prompt
        return self.answers.pop(0)


def test_a_new_gear_says_how_each_point_was_understood_and_what_was_assumed(tmp_path: Path) -> None:
    out = mlg("gear", "new", tmp_path / "mine.toml", "--from", SHORT).out
    assert "B: dyad RRR: coupler from A, rocker from D" in out
    assert "Assumed: new parts without clearance" in out


def test_a_new_gear_has_its_table_of_indices(gear: Path) -> None:
    assert read_index_table(load_gear(gear)).first_order == pytest.approx([1 / 3] * 3, abs=0.01)


def test_a_new_gear_is_drawn_with_all_its_joints(tmp_path: Path) -> None:
    mlg("gear", "new", tmp_path / "mine.toml", "--from", SHORT)
    text = "".join(ET.parse(tmp_path / "mine.svg").getroot().itertext())
    assert {"1", "2", "3"} <= set(re.findall(r"\d", text))


def test_a_mechanism_of_pylinkage_becomes_a_gear_that_can_be_checked(tmp_path: Path) -> None:
    file = tmp_path / "theirs.json"
    places = {"O": [0, 0], "D": [3, 0], "A": [0, 1], "B": [3.5, 2.4]}
    links = {"crank": "OA", "coupler": "AB", "rocker": "DB"}
    file.write_text(
        '{"name": "theirs", "joints": ['
        + ", ".join(f'{{"id": "{n}", "position": {at}}}' for n, at in places.items())
        + '], "links": [{"id": "ground", "type": "ground", "joints": ["O", "D"]}, '
        + ", ".join(
            f'{{"id": "{n}", "joints": ["{e[0]}", "{e[1]}"]'
            + (', "type": "driver", "motor_joint": "O"}' if n == "crank" else "}")
            for n, e in links.items()
        )
        + "]}"
    )
    own = tmp_path / "own.toml"
    made = mlg("gear", "new", own, "--from", file, "--limit", "0.005", "--margin", "0.02")
    assert made.code == 0
    assert "4 joints" in made.out
    checked = ("--set", "1=0.001in", "--tail", "N1", "--side", "LH", "--convention", "radial")
    assert mlg("check", *checked, "--gear", own, "--json").json["gear"]["id"] == "theirs"


def test_a_file_of_pylinkage_without_a_limit_is_refused(tmp_path: Path) -> None:
    found = mlg("gear", "new", tmp_path / "own.toml", "--from", tmp_path / "x.json")
    assert found.code == 2
    assert "--limit" in found.err


def test_from_python_a_linkage_becomes_a_gear_with_its_table(tmp_path: Path) -> None:
    pylinkage = pytest.importorskip("pylinkage.mechanism")
    linkage = pylinkage.fourbar(1.0, 3.0, 3.0, 4.0, initial_angle=0.5)
    gear = from_pylinkage(linkage, tmp_path / "theirs.toml", limit=0.001, margin=0.01)
    assert len(read_index_table(gear).joints) == 4


def test_a_linkage_of_pylinkage_moves_ten_degrees_up_to_its_position_unless_told(
    tmp_path: Path,
) -> None:
    pylinkage = pytest.importorskip("pylinkage.mechanism")
    linkage = pylinkage.fourbar(1.0, 3.0, 3.0, 4.0, initial_angle=0.5)
    written = []
    for n, travel in enumerate([{}, {"travel_deg": (-10.0, 0.0)}, {"travel_deg": (-9.0, 0.0)}]):
        file = tmp_path / str(n) / "theirs.toml"
        file.parent.mkdir()
        from_pylinkage(linkage, file, limit=0.001, margin=0.01, **travel)
        written.append(file.read_text())
    assert written[0] == written[1] != written[2]


def test_without_a_terminal_a_new_gear_needs_a_short_form(tmp_path: Path) -> None:
    found = mlg("gear", "new", tmp_path / "mine.toml")
    assert found.code == 2
    assert "--from" in found.err


@pytest.mark.parametrize("name", ["mine.toml", "mine.svg", "mine-indices.json"])
def test_a_file_that_somebody_wrote_is_not_replaced(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("schema = 1\n")
    assert mlg("gear", "new", tmp_path / "mine.toml", "--from", SHORT).code == 2
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "schema = 1\n"


@pytest.mark.parametrize("kept", ["ground = 3\n", "name = [\n"])
def test_kept_answers_that_were_spoilt_end_in_no_internal_error(kept: str, tmp_path: Path) -> None:
    (tmp_path / "short.toml").write_text(kept)
    try:
        assert not ask_gear(tmp_path / "short.toml", Typed("door linkage", "O 0 0", "q"))
    except GearFileError as error:
        assert "short.toml: cannot be read as TOML" in error.message


def test_a_linkage_that_does_not_close_leaves_no_file(tmp_path: Path) -> None:
    text = SHORT.read_text("utf-8").replace("D = [3, 0]", "D = [6.5, 0]")
    (tmp_path / "short.toml").write_text(text.replace("[-20, 0]", "[-360, 0]"), "utf-8")
    found = mlg("gear", "new", tmp_path / "mine.toml", "--from", tmp_path / "short.toml")
    assert "closes over only" in found.err
    assert not (tmp_path / "mine.toml").exists()


def test_the_answers_at_the_prompt_become_a_short_form(tmp_path: Path) -> None:
    assert ask_gear(tmp_path / "short.toml", Typed(*ANSWERS))
    steps = read_short_form(tmp_path / "short.toml").steps
    assert steps == (
        "A: crank about O, turned by the input",
        "B: dyad RRR: coupler from A, rocker from D",
    )


def test_the_prompt_says_what_is_missing_and_asks_for_it(tmp_path: Path) -> None:
    lines = [line.replace("_of rocker", "_of coupler") for line in ANSWERS if line != "rocker D B"]
    asked = Typed(*lines, "rocker D B", *[""] * 8)
    assert ask_gear(tmp_path / "short.toml", asked)
    assert "moving.B: nothing locates this point: it is on coupler" in " ".join(asked.said.split())


def test_answers_are_kept_when_the_prompt_is_left(tmp_path: Path) -> None:
    assert not ask_gear(tmp_path / "short.toml", Typed("door linkage", "O 0 0", "q"))
    again = Typed("A 0 1", "q")
    ask_gear(tmp_path / "short.toml", again)
    assert "Points that move" in again.said


def test_a_slider_is_asked_for_with_the_direction_of_its_guide(tmp_path: Path) -> None:
    answers = (
        "slider crank",
        *("O 0 0", ""),
        *("A 0 1", "C 3 0", ""),
        *("crank O A", "rod A C", ""),
        *("C 0", ""),
        "",
        "crank crank -10 0",
        "position_of C",
        *("A 0.005", ""),
        "0.02",
        "measured on the bench",
    )
    asked = Typed(*answers)
    assert ask_gear(tmp_path / "short.toml", asked)
    assert tomllib.loads((tmp_path / "short.toml").read_text("utf-8"))["guides_deg"] == {"C": 0.0}


def test_a_line_that_cannot_be_read_is_asked_again(tmp_path: Path) -> None:
    asked = Typed("door linkage", "O nought 0", "q")
    ask_gear(tmp_path / "short.toml", asked)
    assert "expected a line such as: O 0 0" in asked.said


def test_an_edited_gear_is_checked_at_once_and_its_renewed_table_is_named(gear: Path) -> None:
    gear.write_text(re.sub(r"3\.0,\s+0\.0", "3.001, 0.0", gear.read_text("utf-8")), "utf-8")
    hand = ("--set", "1=0.004in", "--tail", "N1", "--side", "LH", "--convention", "radial")
    found = mlg("check", *hand, "--gear", gear)
    assert found.code in (0, 1)
    assert "was computed for another geometry" in found.err
    assert "computed again" in found.err
    assert "computed again" not in mlg("check", *hand, "--gear", gear).err


def test_from_python_the_table_of_an_edited_gear_is_renewed(gear: Path) -> None:
    loaded = load_gear(gear)
    loaded.indices_file.unlink()
    with pytest.warns(UserWarning, match="is missing. It was computed again"):
        table = load_index_table(loaded)
    assert table.gear.geometry_sha256 == loaded.geometry_sha256


def test_from_python_a_renewed_table_is_warned_of(gear: Path) -> None:
    loaded = load_gear(gear)
    loaded.indices_file.unlink()
    with pytest.warns(UserWarning, match="is missing. It was computed again"):
        next_step(loaded, {1: 0.001})
    with warnings.catch_warnings(action="error"):
        next_step(loaded, {1: 0.001})


def test_a_file_that_is_not_a_table_is_not_replaced_by_one(gear: Path) -> None:
    table = load_gear(gear).indices_file
    table.write_text('{"mine": 1}')
    found = mlg("check", FAILURE, "--gear", gear)
    assert found.code == 2
    assert table.read_text() == '{"mine": 1}'


def test_a_gear_draws_itself(tmp_path: Path) -> None:
    mlg("gear", "draw", tmp_path / "gear.svg")
    panels = ET.parse(tmp_path / "gear.svg").getroot().findall("{http://www.w3.org/2000/svg}svg")
    assert len(panels) == 2


def test_a_drawing_does_not_replace_what_is_not_a_drawing(tmp_path: Path) -> None:
    file = tmp_path / "gear.svg"
    file.write_text("<svg/>")
    assert mlg("gear", "draw", file).code == 2
