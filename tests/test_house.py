"""The rooms of the house: doors, names, layers, and the picture of them in docs/contributing.md."""

from __future__ import annotations

import ast
from collections import Counter
from importlib import import_module

import pytest

from . import house

# The picture shows it; the types and the layers themselves are tests of test_project.py.


def test_the_picture_of_the_house_is_current() -> None:
    assert house.page() == house.PAGE.read_text(encoding="utf-8"), "run: python tests/house.py"


def test_nobody_reaches_past_the_door_of_a_room() -> None:
    past = [
        f"{found.file}:{found.line} takes {'.'.join((*found.module, found.name))}"
        for found in house.past_a_door()
    ]
    assert past == []


def test_a_room_says_what_it_is_and_names_doors_that_lead_into_it() -> None:
    for room in house.rooms():
        assert house.first_line(house.trees()[f"{room}/__init__.py"]), room
        assert house.doors(room), room
        named = import_module(f"mlg_troubleshoot.{room}")
        files = {path.stem for path in (house.PACKAGE / room).iterdir()}
        lost = {door for door in house.doors(room) if not hasattr(named, door)} - files
        assert lost == set(), room


def test_each_room_has_a_budget_and_stays_within_it() -> None:
    weights = house.weights()
    assert sorted(house.BUDGETS) == sorted({*house.rooms(), "(top)"})
    heavy = {room: weights[room] for room in house.BUDGETS if weights[room] > house.BUDGETS[room]}
    assert heavy == {}


# Rooms that scripts use, whose names nobody in the package needs to take.
FOR_SCRIPTS = {"diagnosis", "notebook", "records", "schemas", "wear", "cli"}


def test_every_door_is_used() -> None:
    taken = {
        (*found.module, found.name)[:2]
        for found in house.imports()
        if found.other and found.other != found.room
    }
    doors = {(room, door) for room in house.rooms() for door in house.doors(room)}
    assert {(room, door) for room, door in doors - taken if room not in FOR_SCRIPTS} == set()


def test_no_private_name_is_taken_from_another_file() -> None:
    private = [
        f"{found.file}:{found.line} takes {found.name}"
        for found in house.imports()
        if found.name.startswith("_") and not found.name.startswith("__")
    ]
    assert private == []


def test_a_public_class_name_stands_once_in_the_package() -> None:
    names = Counter(
        node.name
        for tree in house.trees().values()
        for node in tree.body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )
    assert [name for name, count in names.items() if count > 1] == []


@pytest.mark.parametrize("title", house.WAYS)
def test_every_step_of_a_way_is_taken_by_the_imports(title: str) -> None:
    """A file of the way is imported by a file that was passed before."""
    steps = [file for file, _name in house.WAYS[title]]
    taken = {(found.file, house.file_of(found)) for found in house.imports()}
    lost = [
        file
        for n, file in enumerate(steps[1:], 1)
        if not any((before, file) in taken for before in steps[:n])
    ]
    assert lost == []
