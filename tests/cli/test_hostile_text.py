"""Data are shown as they are: no markup, no escape sequence and no direction mark in them acts on a
terminal.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from rich.panel import Panel
from rich.rule import Rule

from mlg_troubleshoot.cli.output import console
from tests.cli.conftest import FAILURE, HAND, Run, Table, mlg, row
from tests.gear.own import own_gear

# Markup of rich, an OSC link, a C1 introducer, an override of the writing direction, a lone
# surrogate.
HOSTILE = "WO[/b][link=http://x][conceal]\x1b]8;;http://x\x07\x9b31m\u202egnp\udcff"


def harmless(found: Run) -> None:
    """Neither stream holds a character that acts; the run did not end as a defect."""
    assert found.code not in (70, None)
    shown = found.out + found.err
    acting = [c for c in shown if not (c.isprintable() or c in "\n\u00a0")]
    assert not acting, acting


def in_a_table(text: str) -> str:
    """The text as far as UTF-8 can hold it."""
    return text.replace("\udcff", "")


@pytest.mark.parametrize("column", ["record_id", "side", "clearance_3_in", "work_order"])
def test_a_cell_acts_on_neither_stream(column: str, table: Table) -> None:
    harmless(mlg("check", table(row(**{column: in_a_table(HOSTILE)}))))


def test_a_header_and_a_command_act_on_neither_stream(table: Table) -> None:
    harmless(mlg("check", table(row(**{in_a_table(HOSTILE): "x"}))))
    harmless(mlg("[/b]\x1b[31m"))


@pytest.mark.parametrize("column", ["record_id", "tail_no"])
@pytest.mark.parametrize("rows", [1, 2])
def test_markup_in_an_identity_is_shown_as_it_is(column, rows, table, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    found = mlg(
        "check", table(*[row(**{column: "[/b][conceal]X"}), row(record_id="B", side="RH")][:rows])
    )
    harmless(found)
    assert "[/b][conceal]X" in found.out


def test_a_record_id_of_two_lines_stays_on_one(table: Table) -> None:
    path = table(row(record_id="R1\n= WITHIN_MARGIN N9 LH"), row(record_id="B", side="RH"))
    assert not any(
        line.startswith("= WITHIN_MARGIN N9") for line in mlg("check", path).out.splitlines()
    )


@pytest.mark.parametrize("command", ["check", "diagnose"])
def test_a_file_name_acts_on_neither_stream(command: str, tmp_path: Path) -> None:
    path = tmp_path / ("[b]\x1b[31m\u202e" + "x.csv")
    path.write_text("nothing", encoding="utf-8")
    harmless(mlg(command, path))
    harmless(mlg(command, tmp_path / "lost[conceal]\x1b[2J.csv"))


@pytest.mark.parametrize(
    "flags",
    [
        ("--tail", HOSTILE),
        ("--side", HOSTILE),
        ("--set", HOSTILE),
        ("--set", f"outcome={HOSTILE}"),
        ("--set", f"{HOSTILE}=1"),
        ("--convention", HOSTILE),
        ("--unit", HOSTILE),
        ("--gear", HOSTILE),
        ("--map", HOSTILE),
        ("--format", HOSTILE),
        ("--" + HOSTILE,),
    ],
    ids=lambda flags: flags[0][:12],
)
def test_a_flag_acts_on_neither_stream(flags: tuple[str, ...]) -> None:
    harmless(mlg(*HAND, "--convention", "RADIAL", "--set", "3=0.001in", *flags))


def test_a_gear_file_acts_on_neither_stream(tmp_path: Path) -> None:
    own = own_gear(tmp_path, ('name = "Hawker', 'name = "[/b][conceal]Hawker'))
    path = own.rename(tmp_path / "[b]\x1b[31mmine.toml")
    harmless(mlg("gear", "--gear", path))
    harmless(mlg("check", FAILURE, "--gear", path))
    path.write_text("[[points", encoding="utf-8")
    harmless(mlg("gear", "--gear", path))


def test_an_extension_acts_on_neither_stream(tmp_path: Path) -> None:
    path = tmp_path / "[b]\x1b[31m.toml"
    path.write_text('schema = "[/b]\\u001b[31m"\n', encoding="utf-8")
    harmless(mlg("check", FAILURE, "--extension", path))


def test_the_names_of_outputs_act_on_neither_stream(tmp_path: Path) -> None:
    names = [tmp_path / f"[b]\x1b[31m.{ending}" for ending in ("csv", "xlsx", "d")]
    outputs = [
        part
        for pair in zip(("--csv", "--annotate", "--report"), names, strict=True)
        for part in pair
    ]
    harmless(mlg("check", FAILURE.with_suffix(".xlsx"), *outputs, "--format", "html"))


@pytest.mark.parametrize("shown", [Panel(HOSTILE), Rule(HOSTILE), HOSTILE])
def test_what_reaches_the_console_as_a_bare_text_acts_on_no_terminal(shown, capsys):
    console().print(shown)
    harmless(Run(0, *capsys.readouterr()))
