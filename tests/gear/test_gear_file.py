"""Gear files: every number has a source, and what is wrong with a file is named with its place."""

from __future__ import annotations

import re
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mlg_troubleshoot.datafile import LONGEST_LINE, MOST_BYTES
from mlg_troubleshoot.errors import GearFileError, MechanismError, UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.gear.gear import Gear, SourceKind
from mlg_troubleshoot.gear.gear_file import load_gear, shipped_gears
from mlg_troubleshoot.paper.verification import targets_file, verify
from tests.machine import SLOWER

from .own import own_gear

Edit = Callable[..., Path]


@pytest.fixture
def edited(tmp_path: Path) -> Edit:
    """The shipped gear with one text of one file replaced."""

    def edit(old: str, new: str, file: str = "") -> Path:
        return own_gear(tmp_path, (old, new), file=f"hawker-800xp{file and '-'}{file}.toml")

    return edit


def numbers_in(value: Any) -> list[float]:
    """Every number of a parsed table, at any depth."""
    if isinstance(value, bool | str):
        return []
    if isinstance(value, int | float):
        return [float(value)]
    return [
        n
        for part in (value.values() if isinstance(value, dict) else value)
        for n in numbers_in(part)
    ]


# Names and branches, not quantities.
NOT_QUANTITIES = {"schema", "diagnosis"}


def without(table: Any) -> Any:
    if isinstance(table, dict):
        return {k: without(v) for k, v in table.items() if k not in NOT_QUANTITIES}
    return [without(v) for v in table] if isinstance(table, list) else table


def test_every_number_of_the_gear_file_is_listed_with_its_source(gear: Gear) -> None:
    written = numbers_in(without(tomllib.loads(gear.path.read_text(encoding="utf-8"))))
    listed = [number.value for number in gear.numbers]
    assert sorted(listed) == sorted(written)


def test_every_number_has_a_kind_a_source_and_a_unit(gear: Gear) -> None:
    assert all(
        n.kind in set(SourceKind)
        and len(n.source) > 10
        and n.unit in {"in", "deg", "min", "landings", "1"}
        for n in gear.numbers
    )


def test_the_coordinates_are_called_reconstructed_and_not_drawing_data(gear: Gear) -> None:
    assert gear.provenance == "reconstructed from published figures, not drawing data"
    kinds = {n.kind for n in gear.numbers if n.value in {-11.85, 58.73, -167.19, 48.92}}
    assert kinds == {SourceKind.RECONSTRUCTED}


@pytest.mark.parametrize(
    ("what", "value", "kind"),
    [
        ("margin", 0.03, SourceKind.STATED),
        ("limit", 0.0075, SourceKind.ASSUMED),
        ("new_part", 0.0005, SourceKind.ASSUMED),
    ],
)
def test_numbers_behind_the_verdict_say_what_they_are_worth(gear, what, value, kind):
    number = gear.margin if what == "margin" else getattr(gear.joint(3), what)
    assert (number.value, number.kind) == (value, kind)


def test_the_calibration_is_from_the_technical_order(gear: Gear) -> None:
    kinds = {n.value: n.kind for n in gear.numbers if n.kind is SourceKind.TECHNICAL_ORDER}
    assert set(kinds) == {0.03, 0.45, 0.01, 0.05}


def test_the_hash_changes_with_a_coordinate(gear: Gear, edited: Edit) -> None:
    assert (
        load_gear(edited("F = [-1.8, -11.85]", "F = [-1.8, -11.851]")).geometry_sha256
        != gear.geometry_sha256
    )


def test_the_hash_does_not_change_with_a_comment_or_a_name(gear: Gear, edited: Edit) -> None:
    copy = load_gear(edited('name = "locking pin"', 'name = "lock pin"  # as in the manual'))
    assert (copy.geometry_sha256, copy.ensemble_sha256) == (
        gear.geometry_sha256,
        gear.ensemble_sha256,
    )


def test_a_gear_file_that_was_edited_is_read_anew(edited: Edit) -> None:
    path = edited("# Hawker", "# Copied from Hawker")
    before = load_gear(path).geometry_sha256
    path.write_text(
        path.read_text(encoding="utf-8").replace("F = [-1.8, -11.85]", "F = [-1.8, -11.851]"),
        "utf-8",
    )
    assert load_gear(path).geometry_sha256 != before


def test_the_hawker_is_the_first_shipped_gear() -> None:
    assert shipped_gears() == (DEFAULT_GEAR, "four-bar-three-pins")


def test_an_unknown_gear_is_refused_with_the_names_that_exist() -> None:
    with pytest.raises(UsageError, match="no gear 'cessna'") as caught:
        load_gear("cessna")
    assert DEFAULT_GEAR in caught.value.remedy


IN_THE_FOLDER = r"\.json file in the same folder"
NAME = "expected a name of 1 to 40 printable"
TWO = "expected two numbers"
DEEP = "nested more than 24 deep"
LONG_HEX = "0x" + "f" * 5000
# What is replaced in a file of the gear, and what is said of it.
REFUSED: dict[str, list[tuple[str, str, str]]] = {
    "": [
        # a key that nobody reads, with the nearest name
        ('provenance = "', 'provenence = "x"\nprovenance = "', r"provenence: .*did.* 'provenance'"),
        ("drawn_at = 0.687", "drawn_at = 0.687\ndrawn = 1", r"input\.drawn: .*did.* 'drawn_at'"),
        ('area = "sidestay"\n', 'area = "sidestay"\nlimt = 1\n', r"joints\.1\.limt: .*'limit'"),
        ("schema = 2", "schema = 2\nseen = 2024-01-01", r"seen: expected a known key"),
        # a source that is missing or unknown
        ('margin = "margin"', 'margin = "hearsay"', r"source_of\.margin: .*'hearsay'"),
        ('{ limit = "limit"', '{ limt = "limit"', r"joints\.1\.source_of: .* keys of numbers"),
        ('source = "reconstruction"\n', "", r"source: expected a name .*found nothing"),
        ('source = "calibration"', 'source = "hearsay"', r"calibration\.source: .*'hearsay'"),
        ('kind = "technical order"', 'kind = "a friend"', r"calibration\.kind: .*'a friend'"),
        # bad numbers
        ("F = [-1.8, -11.85]", "F = [nan, -11.85]", rf"ground\.F: {TWO}"),
        ("F = [-1.8, -11.85]", "F = [-1.8]", rf"ground\.F: {TWO}"),
        ("F = [-1.8, -11.85]", "F = [1e5, -11.85]", rf"ground\.F: {TWO} from -10000 to 10000"),
        ("F = [-1.8, -11.85]", f"F = [1{'0' * 400}, 1]", rf"ground\.F: {TWO}"),
        ("travel = [0.0, 0.687]", "travel = [0.0, inf]", rf"input\.travel: {TWO}"),
        ("travel = [0.0, 0.687]", "travel = [1, 1]", r"input\.travel: .* two different numbers"),
        ("[0.01, 0.05]", "[0.05, 0.01]", rf"down_lock_range: {TWO}, the smaller one first"),
        ("dihedral_deg = 48.92", "dihedral_deg = 1e9", r"dihedral_deg: .* from -720 to 720"),
        ("margin = 0.03\n", "margin = -0.03\n", r"margin: expected a number above 0"),
        ("margin = 0.03\n", "margin = true\n", r"margin: expected a number"),
        ("limit = 0.0075\n", "limit = 0\n", r"joints\.1\.limit: expected a number above 0"),
        ("new_part = 0.0005\n", "new_part = -1\n", r"joints\.1\.new_part: .* from 0 to 10000"),
        # wrong types
        ("schema = 2\n", "schema = 3\n", r"schema: expected 2, found 3"),
        ("critical = true", 'critical = "yes"', r"joints\.1\.critical: expected true or false"),
        ('["F", "1"]', '["F", 1]', r"links\.actuator: expected a list of names"),
        ("10 = 58.73", '10 = "up"', r"guides_deg\.10: expected"),
        ('position_of = "10"', 'speed_of = "10"', r"output\.speed_of: expected .*known key"),
        ('id = "hawker-800xp"', "id = 800", r"id: expected a name of 1 to 40 .*found 800"),
        ("stages = [", "stages = 4\nstates = [", r"cycle\.stages: expected an array of tables"),
        ('plunger = "in", flow', "plunger = 1, flow", r"cycle\.valve\[1\]\.plunger: .* a text"),
        # what does not fit together
        ("[joints.10]", "[joints.11]", r"joints\.11: expected one of the points"),
        ("ground = { 8 =", "ground = { 6 = [0, 0], 8 =", r"moving\.6: expected a point that has"),
        ('area = "sidestay"', 'area = "cockpit"', r"joints\.1\.area: .*'cockpit'"),
        ('hinge_point = "6"\n', "", r"planes\.link_assembly\.hinge_point: expected a name"),
        ("dihedral_deg = 48.92\n", "", r"planes\.link_assembly\.dihedral_deg: expected a number"),
        # names and texts that nobody could read, and files elsewhere
        ("F = [-1.8", r'"F\u202e" = [-1.8', NAME),
        ('name = "locking pin"', f'name = "{"p" * 41}"', rf"joints\.2\.name: {NAME}"),
        ('provenance = "', r'provenance = "\u001b[31m', r"provenance: .* a text .* printable"),
        ('ensemble = "hawker', 'ensemble = "../hawker', "ensemble: .* file in the same folder"),
        ('indices = "hawker', 'indices = "/etc/hawker', rf"indices: .*{IN_THE_FOLDER}"),
        ('indices = "hawker', r'indices = "a\\hawker', rf"indices: .*{IN_THE_FOLDER}"),
        ('indices = "hawker-800xp-indices.json"', 'indices = "mlg.toml"', IN_THE_FOLDER),
        ('indices = "hawker', f'indices = "{"h" * 300}', rf"indices: .*{IN_THE_FOLDER}"),
        # no TOML, and TOML without end
        ("schema = 2", "schema = = 2", r"800xp\.toml: cannot be read as TOML"),
        ("schema = 2", f"schema = 2\nx = {'[' * 5000}{']' * 5000}", f"{DEEP}|a line has"),
        ("schema = 2", "schema = 2\nx = " + "[\n" * 5000 + "]" * 5000, DEEP),
        ("schema = 2", f"schema = 2\nx = {'{a=' * 30}1{'}' * 30}", DEEP),
        ("schema = 2", f"schema = 2\n{'a.' * LONGEST_LINE}a = 1", r"a line has \d+ characters"),
        ("schema = 2", "schema = 2\n# " + "x\n# " * MOST_BYTES, r"at most 2000000 are read"),
        ("schema = 2", "schema = 2" + "\n[[steps]]" * 300, r"steps: .* at most 200 entries"),
    ],
    "ensemble": [
        (
            "dihedral_deg = 48.656",
            'dihedral_deg = "flat"',
            r"B: planes\.link_.*dihedral_deg: .* a nu",
        ),
        ("dihedral_deg = 48.656", "dihedral_deg = nan", r"dihedral_deg: .* a number .*, found nan"),
        ("drawn_at = 0.576", "drawn_at = true", r"member B: input\.drawn_at: expected a number"),
        ("drawn_at = 0.576", "drawn = 0.576", r"members\.B\.input\.drawn: expected a key of"),
        ("F = [-1.243", "Z = [-1.243", r"members\.B\.ground\.Z: .* a key of the gear file"),
        ("[members.B.ground]", "[members.B.grund]", r"members\.B\.grund: expected a key of"),
        ("[members.B]\ninput", '[members."B\\u202e"]\ninput', NAME),
        ("source = ", "spurce = ", "source: expected a text, found nothing"),
        ("[4.2709, -0.0]", f"[{LONG_HEX}, 1]", rf"{TWO} .*, found"),
    ],
    "targets": [
        ("value = 0.0472", "value = nan", r"targets\[1\]\.value: expected a number"),
        ("value = 0.0472", "value = 0.0472\nat_most = 0.05", "one of value with tol.*, at_most"),
        ("tolerance = 0.00005", "tolerence = 0.00005", "tolerance|tolerence"),
        *(("= 0.00005", f"= {wide}", "tolerance: .* above 0") for wide in ("0.0", "-0.1", "1e-30")),
        ("{ 3 = 0.013", "{ 3 = true", r"clearance_in\.3: expected a number"),
        ("{ 3 = 0.013", "{ 3 = -0.013", r"clearance_in\.3: expected a number from 0 to 1"),
        ("{ 3 = 0.013", '{ "²" = 0.013', r"clearance_in\.²: expected the number of a joint"),
        ("schema = 1", f"schema = {LONG_HEX}", r"found a number of more than 4,300"),
    ],
}


@pytest.mark.parametrize(
    ("file", "old", "new", "words"), [(file, *each) for file in REFUSED for each in REFUSED[file]]
)
def test_what_no_gear_can_have_is_refused_with_file_key_and_expectation(
    edited, file, old, new, words
):
    path = edited(old, new, file)
    began = time.process_time()
    with pytest.raises(GearFileError, match=words) as caught:
        verify(load_gear(path), targets_file(load_gear(path)))
    assert f"hawker-800xp{file and '-'}{file}.toml" in caught.value.message
    assert caught.value.remedy
    assert time.process_time() - began < 5 * SLOWER


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('hinge_point = "6"', 'hinge_point = "66"', "'link_assembly' is hinged at '66'"),
        ("travel = [0.0, 0.687]", "travel = [-9.0, 0.687]", "closes over only"),
    ],
)
def test_a_linkage_that_cannot_be_assembled_is_a_mechanism_error_that_names_the_step(
    edited, old, new, words
):
    with pytest.raises(MechanismError, match=words):
        _ = load_gear(edited(old, new)).model


def test_code_in_place_of_a_name_does_not_run(edited: Edit, tmp_path: Path) -> None:
    mark = tmp_path / "ran"
    path = edited("[joints.10]", f"[joints.\"0\\nopen({str(mark)!r},'w')\"]")
    with pytest.raises(GearFileError, match=r"expected a name of 1 to 40"):
        _ = load_gear(path).model
    assert not mark.exists()


def test_a_gear_file_of_an_earlier_version_is_refused_with_the_page_that_tells_the_change(edited):
    with pytest.raises(
        GearFileError, match=r"800xp\.toml: is written as 0\.2\.0 read it"
    ) as caught:
        load_gear(edited("schema = 2", "schema = 1"))
    page, heading = re.findall(r"(docs/\S+\.md), \"([^\"]+)\"", caught.value.remedy)[0]
    assert f"## {heading}\n" in (Path(__file__).parents[2] / page).read_text(encoding="utf-8")


def test_a_gear_file_without_an_ensemble_predicts_with_its_reference_alone(edited: Edit) -> None:
    assert len(load_gear(edited('ensemble = "hawker-800xp-ensemble.toml"\n', "")).ensemble) == 1


def test_the_joints_carry_the_names_of_the_paper_and_one_to_five_are_critical(gear: Gear) -> None:
    names = {2: "locking pin", 3: "short link inner bearing", 5: "short link outer bearing"}
    assert {number: gear.joint(number).name for number in names} == names
    assert [joint.number for joint in gear.joints if joint.critical] == [1, 2, 3, 4, 5]


@pytest.mark.parametrize("clearance", [0.0075, 0.1905 / 25.4, 0.381 / 25.4 / 2, 7.5 / 1000])
def test_a_clearance_at_its_limit_is_not_over_it_in_whatever_unit_it_was_read(gear, clearance):
    assert not gear.joint(1).is_over_limit(clearance)
    assert gear.joint(1).is_over_limit(clearance + 0.0001)


def test_both_ends_of_a_link_act_alike_and_no_other_joints_do(gear: Gear) -> None:
    pairs = {frozenset((number, *others)) for number, others in gear.alike.items() if others}
    assert pairs == {frozenset({3, 5}), frozenset({6, 7}), frozenset({9, 10})}


def test_what_a_gear_file_need_not_state_is_assumed_and_says_so(edited: Edit) -> None:
    found = load_gear(edited("restore_min = 120\n", ""))
    restore = found.joints[0].restore
    assert (restore.value, restore.unit, restore.kind) == (120.0, "min", SourceKind.ASSUMED)
    assert "120 min is assumed" in restore.source


@pytest.mark.parametrize("name", ["length.F-1", "lever.6.across", "length.6-7"])
def test_a_cause_that_would_change_no_number_of_the_linkage_is_refused(edited, name):
    with pytest.raises(GearFileError, match=r"a number of the linkage instead of 'length\.1-F'"):
        load_gear(edited(f'"{name}"', '"length.1-F"'))


def test_a_joint_that_a_gear_does_not_have_is_named_with_the_option_that_gave_it() -> None:
    with pytest.raises(UsageError, match=r"^--joint 11: .* has no joint 11$") as refused:
        load_gear().require_joints([3, 11], "--joint")
    assert refused.value.remedy == "Its joints are 1, 2, 3, 4, 5, 6, 7, 8, 9, 10."
