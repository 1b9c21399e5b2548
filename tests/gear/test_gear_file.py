"""Gear files: every number has a source, and what is wrong with a file is named with its place."""

from __future__ import annotations

import re
import shutil
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlg_troubleshoot.errors import GearFileError, MechanismError, UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.gear.gear import Gear, SourceKind
from mlg_troubleshoot.gear.gear_file import load_gear, shipped_gears

Edit = Callable[[str, str], Path]


@pytest.fixture
def edited(gear: Gear, tmp_path: Path) -> Edit:
    """A copy of the shipped gear file with one text replaced, its ensemble beside it."""

    def edit(old: str, new: str) -> Path:
        text = gear.path.read_text(encoding="utf-8")
        assert old in text
        shutil.copy(gear.path.with_name("hawker-800xp-ensemble.toml"), tmp_path)
        path = tmp_path / "copy.toml"
        path.write_text(text.replace(old, new, 1), encoding="utf-8")
        return path

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
NOT_QUANTITIES = {"schema", "number", "virtual_link", "virtual_links", "sign", "diagnosis"}


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
def test_numbers_behind_the_verdict_say_what_they_are_worth(
    gear: Gear, what: str, value: float, kind: SourceKind
) -> None:
    number = gear.margin if what == "margin" else getattr(gear.joint(3), what)
    assert (number.value, number.kind) == (value, kind)


def test_the_calibration_is_from_the_technical_order(gear: Gear) -> None:
    kinds = {n.value: n.kind for n in gear.numbers if n.kind is SourceKind.TECHNICAL_ORDER}
    assert set(kinds) == {0.03, 0.45, 0.01, 0.05}


def test_the_hash_changes_with_a_coordinate(gear: Gear, edited: Edit) -> None:
    assert (
        load_gear(edited("at = [-1.8, -11.85]", "at = [-1.8, -11.851]")).geometry_sha256
        != gear.geometry_sha256
    )


def test_the_hash_does_not_change_with_a_comment_or_a_name(gear: Gear, edited: Edit) -> None:
    copy = load_gear(edited('name = "locking pin"', 'name = "lock pin"  # as in the manual'))
    assert (copy.geometry_sha256, copy.ensemble_sha256) == (
        gear.geometry_sha256,
        gear.ensemble_sha256,
    )


def test_a_copy_of_the_gear_file_predicts_the_same(gear: Gear, edited: Edit) -> None:
    copy = load_gear(edited("# Hawker", "# Copied from Hawker"))
    assert copy.model.plunger_amplification() == pytest.approx(
        gear.model.plunger_amplification(), abs=1e-15
    )


def test_a_gear_file_that_was_edited_is_read_anew(edited: Edit) -> None:
    path = edited("# Hawker", "# Copied from Hawker")
    before = load_gear(path).geometry_sha256
    path.write_text(
        path.read_text(encoding="utf-8").replace("at = [-1.8, -11.85]", "at = [-1.8, -11.851]"),
        "utf-8",
    )
    assert load_gear(path).geometry_sha256 != before


def test_the_hawker_is_the_first_shipped_gear() -> None:
    assert shipped_gears() == (DEFAULT_GEAR, "four-bar-three-pins")


def test_an_unknown_gear_is_refused_with_the_names_that_exist() -> None:
    with pytest.raises(UsageError, match="no gear 'cessna'") as caught:
        load_gear("cessna")
    assert DEFAULT_GEAR in caught.value.remedy


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        # a key that nobody reads, with the nearest name
        (
            'provenance = "rec',
            'provenence = "x"\nprovenance = "rec',
            r"provenence: .*did you mean 'provenance'",
        ),
        (
            "down_lock = 0.03\n",
            "down_lock = 0.03\ntravell = 1\n",
            r"calibration\.travell: .*did you mean 'travel'",
        ),
        ("[margin]\n", "[margin]\nu = 0.001\n", r"margin\.u: "),
        (
            "[entry]\n",
            "[entry]\nhard_limt = 0.001\n",
            r"entry\.hard_limt: .*did you mean 'hard_limit'",
        ),
        ("[bearing_span]\n", "[bearing_span]\nlength = 2\n", r"bearing_span\.length: "),
        ('name = "F"\n', 'name = "F"\nfixd = true\n', r"points\[F\]\.fixd: .*did you mean 'fixed'"),
        (
            "driven = true\n",
            "driven = true\ndrive = 1\n",
            r"steps\[1\]\.drive: .*did you mean 'driven'",
        ),
        (
            'area = "sidestay"\n',
            'area = "sidestay"\nlimt = 1\n',
            r"joints\[actuator rod end\]\.limt: .*'limit'",
        ),
        # a source that is missing or unknown
        (
            'value = 0.03\nsource = "margin"',
            "value = 0.03",
            r"margin\.source: expected a text, found nothing",
        ),
        (
            'value = 0.03\nsource = "margin"',
            'value = 0.03\nsource = "hearsay"',
            r"margin\.source: .*'hearsay'",
        ),
        (
            'fixed = true\nsource = "reconstruction"',
            "fixed = true",
            r"points\[F\]\.source: .*found nothing",
        ),
        (
            'limit_source = "limit"\n',
            "",
            r"joints\[actuator rod end\]\.limit_source: .*found nothing",
        ),
        (
            'kind = "technical order"',
            'kind = "a friend"',
            r"sources\.calibration\.kind: .*'a friend'",
        ),
        # bad numbers
        ("at = [-1.8, -11.85]", "at = [nan, -11.85]", r"points\[F\]\.at: expected two numbers"),
        ("at = [-1.8, -11.85]", "at = [-1.8]", r"points\[F\]\.at: expected two numbers"),
        ("at = [-1.8, -11.85]", 'at = ["-1.8", -11.85]', r"points\[F\]\.at: expected two numbers"),
        ("range = [0.0, 0.687]", "range = [0.0, inf]", r"input\.range: expected two numbers"),
        ("value = 0.03\n", "value = nan\n", r"margin\.value: expected a number"),
        ("value = 0.03\n", "value = -0.03\n", r"margin\.value: expected a number above 0"),
        ("value = 0.03\n", "value = true\n", r"margin\.value: expected a number"),
        (
            "limit = 0.0075\n",
            "limit = 0\n",
            r"joints\[actuator rod end\]\.limit: expected a number above 0",
        ),
        (
            "access_min = 10\n",
            "access_min = 0\n",
            r"joints\[actuator rod end\]\.access_min: expected a number above 0",
        ),
        (
            "new_part = 0.0005\n",
            "new_part = -1\n",
            r"joints\[actuator rod end\]\.new_part: expected a number from 0 to 10000",
        ),
        ("sign = +1\ndriven", "sign = 2\ndriven", r"steps\[1\]\.sign: expected \+1 or -1"),
        # wrong types
        ("schema = 1\n", "schema = 2\n", r"schema: expected 1, found 2"),
        ("schema = 1\n", 'schema = "1"\n', r"schema: expected 1, found '1'"),
        ("driven = true", 'driven = "yes"', r"steps\[1\]\.driven: expected true or false"),
        (
            "virtual_links = [1]",
            "virtual_links = 1",
            r"steps\[1\]\.virtual_links: expected a list of whole numbers",
        ),
        (
            "virtual_links = [1]",
            "virtual_links = [0]",
            r"steps\[1\]\.virtual_links: .* from 1 to 999",
        ),
        (
            'type = "slot"',
            'type = "groove"',
            r"steps\[3\]\.type: expected crank, dyad, guide, lever, slider or slot",
        ),
        ("axis_deg = 58.73", 'axis_deg = "up"', r"steps\[10\]\.axis_deg: expected"),
        ('kind = "position"', 'kind = "speed"', r"output\.kind: expected angle or position"),
        (
            'id = "hawker-800xp"',
            "id = 800",
            r"id: expected a name of 1 to 40 .*found 800",
        ),
        ("stages = [", "stages = 4\nstates = [", r"cycle\.stages: expected an array of tables"),
        (
            'plunger = "in", flow',
            "plunger = 1, flow",
            r"cycle\.valve\[1\]\.plunger: expected a text",
        ),
        # what does not fit together
        ("number = 10\n", "number = 11\n", r"joints .* and virtual links .* differ"),
        ("number = 1\n", 'number = 1\npoint = "Z"\n', r"joint 1 is at point 'Z'"),
        ('area = "sidestay"', 'area = "cockpit"', r"joint 1 lies in area 'cockpit'"),
        ("schema = 1", "schema = = 1", r"copy\.toml: cannot be read as TOML"),
    ],
)
def test_what_is_wrong_with_a_gear_file_is_named_with_its_place(
    edited: Edit, old: str, new: str, words: str
) -> None:
    with pytest.raises(GearFileError, match=words) as caught:
        load_gear(edited(old, new))
    assert caught.value.message.startswith(("copy.toml: ", str(edited(old, new))))
    assert caught.value.remedy


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('hinge_point = "6"', 'hinge_point = "66"', "'link_assembly' is hinged at '66'"),
        ('follows = "1"', 'follows = "11"', "'2' needs '11'"),
        (
            'joint = "10"\nupstream',
            'joint = "100"\nupstream',
            "'100' locates a point that has no coordinates",
        ),
        ("sign = +1\ndriven", "sign = -1\ndriven", r"'1' has the sign -1"),
        ("range = [0.0, 0.687]", "range = [-9.0, 0.687]", "closes over only"),
    ],
)
def test_a_linkage_that_cannot_be_assembled_is_a_mechanism_error_that_names_the_step(
    edited: Edit, old: str, new: str, words: str
) -> None:
    with pytest.raises(MechanismError, match=words):
        _ = load_gear(edited(old, new)).model


def test_a_mistake_in_the_ensemble_is_named_with_the_ensemble_file(edited: Edit) -> None:
    path = edited("schema = 1", "schema = 1 ")
    ensemble = path.with_name("hawker-800xp-ensemble.toml")
    text = ensemble.read_text(encoding="utf-8")
    ensemble.write_text(
        text.replace('"1" = { sign = +1 }', '"1" = { sign = 3 }', 1), encoding="utf-8"
    )
    with pytest.raises(GearFileError, match=r"hawker-800xp-ensemble\.toml: steps\[1\]\.sign"):
        load_gear(path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "dihedral_deg = 48.656",
            'dihedral_deg = "flat"',
            "members.B.planes.link_assembly.dihedral",
        ),
        ("reference = 0.576\n", "", "members.B.reference: expected a number, found nothing"),
        ('"F" = [-1.243', '"Z" = [-1.243', "members.B.points.Z: expected a name of the gear file"),
        ("[members.B.steps]", "[members.B.stepps]", "members.B.steps: expected a table"),
        ("source = ", "spurce = ", "source: expected a text, found nothing"),
    ],
)
def test_what_is_wrong_with_an_ensemble_is_named_with_its_member(
    edited: Edit, old: str, new: str, words: str
) -> None:
    path = edited("schema = 1", "schema = 1 ")
    ensemble = path.with_name("hawker-800xp-ensemble.toml")
    text = ensemble.read_text(encoding="utf-8")
    assert old in text
    ensemble.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(GearFileError) as caught:
        load_gear(path)
    assert f"hawker-800xp-ensemble.toml: {words}" in caught.value.message


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('hinge_point = "6"\n', "", "hinge_point: expected the name of a point"),
        ("dihedral_deg = 48.92\n", "", "dihedral_deg: expected a number"),
        ('= 48.92\nsource = "reconstruction"\n', "= 48.92\n", "source: expected a text"),
        ('parent = "sidestay"\n', "", "hinge_point: expected it with a parent only"),
    ],
)
def test_a_plane_says_how_it_is_hinged_if_it_has_a_parent_and_only_then(
    edited: Edit, old: str, new: str, words: str
) -> None:
    with pytest.raises(GearFileError) as caught:
        load_gear(edited(old, new))
    assert f"planes[link_assembly].{words}" in caught.value.message


def test_a_gear_file_without_an_ensemble_predicts_with_its_reference_alone(edited: Edit) -> None:
    assert len(load_gear(edited('ensemble = "hawker-800xp-ensemble.toml"\n', "")).ensemble) == 1


def test_the_joints_carry_the_names_that_the_paper_gives_them(gear: Gear) -> None:
    names = {2: "locking pin", 3: "short link inner bearing", 5: "short link outer bearing"}
    assert {number: gear.joint(number).name for number in names} == names


def test_joints_one_to_five_are_critical_and_the_others_are_not(gear: Gear) -> None:
    assert [joint.number for joint in gear.joints if joint.critical] == [1, 2, 3, 4, 5]


def test_a_joint_that_the_gear_does_not_have_is_refused(gear: Gear) -> None:
    with pytest.raises(KeyError, match="no joint 11"):
        gear.joint(11)


@pytest.mark.parametrize("clearance", [0.0075, 0.1905 / 25.4, 0.381 / 25.4 / 2, 7.5 / 1000])
def test_a_clearance_at_its_limit_is_not_over_it_in_whatever_unit_it_was_read(
    gear: Gear, clearance: float
) -> None:
    assert not gear.joint(1).is_over_limit(clearance)


def test_a_clearance_a_tenth_of_a_thou_above_its_limit_is_over_it(gear: Gear) -> None:
    assert gear.joint(1).is_over_limit(0.0076)


def test_both_ends_of_a_link_act_alike_and_no_other_joints_do(gear: Gear) -> None:
    pairs = {frozenset((number, *others)) for number, others in gear.alike.items() if others}
    assert pairs == {frozenset({3, 5}), frozenset({6, 7}), frozenset({9, 10})}


def test_the_files_carry_no_machine_path(gear: Gear) -> None:
    texts = [path.read_text(encoding="utf-8") for path in gear.path.parent.glob("*.toml")]
    assert not any(re.search(r"(?:^|[\s\"'(])/(?:home|work|root|tmp)/", text) for text in texts)


def test_limits_are_an_array_in_the_order_of_the_joints(gear: Gear) -> None:
    assert gear.limits_in == pytest.approx(np.full(10, 0.0075))


def test_what_a_gear_file_need_not_state_is_assumed_and_says_so(edited: Edit) -> None:
    restore = (
        load_gear(edited('restore_min = 120\nrestore_source = "minutes"\n', "")).joints[0].restore
    )
    assert (restore.value, restore.unit, restore.kind) == (120.0, "min", SourceKind.ASSUMED)
    assert "120 min is assumed" in restore.source


@pytest.mark.parametrize("name", ["length.F-1", "lever.6.across", "length.6-7"])
def test_a_cause_that_would_change_no_number_of_the_linkage_is_refused(
    edited: Edit, name: str
) -> None:
    with pytest.raises(GearFileError, match=r"a number of the linkage instead of 'length\.1-F'"):
        load_gear(edited(f'"{name}"', '"length.1-F"'))


def test_a_gear_that_is_given_in_place_of_a_name_is_returned_as_it_is() -> None:
    gear = load_gear()
    assert load_gear(gear) is gear


def test_a_joint_that_a_gear_does_not_have_is_named_with_the_option_that_gave_it() -> None:
    with pytest.raises(UsageError, match=r"^--joint 11: .* has no joint 11$") as refused:
        load_gear().require_joints([3, 11], "--joint")
    assert refused.value.remedy == "Its joints are 1, 2, 3, 4, 5, 6, 7, 8, 9, 10."
