"""``mlg history``: the records of each gear, and what is added to them later."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from mlg_troubleshoot.cli import options, output
from mlg_troubleshoot.errors import ExitCode, UsageError
from mlg_troubleshoot.units import LengthUnit, said_in

if TYPE_CHECKING:
    from mlg_troubleshoot.life.forecast import FleetLine, LifeAhead
    from mlg_troubleshoot.store import Record, Store
    from mlg_troubleshoot.workflows.history import Lives

EPILOG = (
    "Example: mlg history N123 LH; mlg history repair N123 LH --joint 3 --date"
    " 2026-05-04; mlg history verify"
)
_SHOW = "show"

Tail = Annotated[str, typer.Argument(metavar="TAIL", help="Tail number.")]
Side = Annotated[str, typer.Argument(metavar="LH|RH", help="Which gear.")]
RecordId = Annotated[
    str, typer.Argument(metavar="RECORD", help="Record id, or the start of its hash.")
]
Day = Annotated[str, typer.Option("--date", metavar="YYYY-MM-DD", help="Date of the repair.")]
Landings = Annotated[
    str | None, typer.Option("--landings", metavar="N", help="Landings at the repair.")
]
WorkOrder = Annotated[str | None, typer.Option("--work-order", help="Work order.")]
Chain = Annotated[Path, typer.Argument(metavar="FILE", help="JSON Lines, one record per line.")]


class HistoryGroup(TyperGroup):
    """``mlg history`` without the name of a command shows: all gears, an aircraft, or one gear."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if not (args and (args[0] in self.commands or args[0] in ("-h", "--help"))):
            args = [_SHOW, *args]
        return super().parse_args(ctx, args)


@options.flat
def show(
    *,
    tail: Annotated[
        str | None, typer.Argument(metavar="[TAIL]", help="Tail number; without it all gears.")
    ] = None,
    side: Annotated[
        str | None, typer.Argument(metavar="[LH|RH]", help="Which gear; without it both.")
    ] = None,
    records: options.Records,
    no_forecast: options.NoForecast = False,
    shown: options.Shown,
) -> None:
    """Show all gears with their latest state, or the life of one gear with its forecast."""
    from mlg_troubleshoot.cli.output import stages
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.life.forecast import LifeAhead
    from mlg_troubleshoot.workflows import history

    place = records.kept
    known = load_gear(records.gear)
    output.claim(records.gear, (), (), shown.report, store=records.store, force=shown.force)
    if tail is None:
        if shown.report is not None:
            raise UsageError(
                "--report needs a gear",
                "Give TAIL, or write the page of all gears: mlg fleet --report DIR",
            )
        with stages(quiet=shown.quiet) as bar:
            everything = history.show_fleet(place, known, ahead=False, whole=False, progress=bar)
        if shown.as_json:
            output.write_json(everything)
        elif everything.lines:
            show_gears(everything, unit_of(everything, place, shown), ahead=False)
        else:
            output.console().print(no_records(place.place))
        return
    with stages(quiet=shown.quiet) as bar:
        ahead = not no_forecast
        found = history.show_lives(place, known, tail, side, ahead=ahead, progress=bar)
    if shown.as_json and len(found.lives) != 1:
        raise UsageError(
            f"{tail} has two gears here, and JSON shows one", f"Run: mlg history {tail} LH --json"
        )
    unit = unit_of(found, place, shown)
    for life, line in zip(found.lives, found.lines, strict=True):
        if shown.as_json:
            output.write_json(LifeAhead(life, line.ahead, known))
        else:
            _show_life(LifeAhead(life, line.ahead, known), unit)
    write_pages(found, place, shown, unit, fleet=False)


def write_pages(
    found: Lives, store: Store, shown: options.Shown, unit: LengthUnit, *, fleet: bool
) -> None:
    """Write the pages of gears if they are asked for, and name them on stderr."""
    from mlg_troubleshoot.workflows import history

    if shown.report is None:
        return
    written = history.write_pages(
        found,
        store,
        shown.report,
        fleet=fleet,
        page=options.paper_size(),
        unit=unit,
        replace_files=shown.force,
    )
    output.say_written(written, quiet=shown.quiet)


def unit_of(found: Lives, store: Store, shown: options.Shown) -> LengthUnit:
    """The unit of most gears, or that of the user's last entry where no clearance says it."""
    from mlg_troubleshoot.cli.prompts.saved import SavedEntries

    usual = SavedEntries(store.place).offered().get("unit")
    own = [LengthUnit(usual)] if usual else []
    return shown.unit(*(line.unit for line in found.lines), *own)


def no_records(place: str) -> str:
    return f"No records in {place}. Keep inspections with: mlg check FILE --keep"


def show_gears(
    found: Lives, unit: LengthUnit, *, ahead: bool, within: float = 0.0, joint: int | None = None
) -> None:
    """Show one line per gear, the most urgent first and why; `within`: with the parts of so many
    landings, `joint`: with the readings of that joint.
    """
    from mlg_troubleshoot.cli.views.batch import Cell
    from mlg_troubleshoot.life.forecast import most_urgent_first, parts_within, work_sentence

    console = output.console(unit=unit)
    lines = most_urgent_first(found.lines)
    worst_in = f"worst {console.unit}"
    why = "changed" if any(line.changed for line in lines) else "why"
    headings = (
        *("tail", "side", why, f"{worst_in}>", "by when", "last seen", "landings>"),
        *("verdict", "failed", "next action"),
    )
    rows: list[list[Cell]] = [
        [
            output.word(line.tail_no),
            line.side,
            "; ".join(line.changed) or said_in(line.urgency.why, console.unit),
            console.length(line.now.predicted_displacement_in),
            line.by_when(found.gear),
            str(line.inspection_date or "no date"),
            _count(line.gear_landings),
            line.now.title or "-",
            ", ".join(line.failed) or "-",
            line.now.next_action or "-",
        ]
        for line in lines
    ]
    console.print("The most urgent gear first.")
    for warning in (said for line in found.lines for said in line.warnings):
        console.print(f"Warning: {warning}")
    spare = ("landings", "last seen", "failed", worst_in, "verdict")
    output.print_table(console, headings, rows, spare, "--json lists all of them", folded=why)
    if joint is not None:
        _show_trend(console, lines, joint)
    console.print(work_sentence(lines))
    if within and ahead:
        console.print(parts_within(lines, within))


def _show_trend(console: output.DataConsole, lines: Sequence[FleetLine], joint: int) -> None:
    """Show the readings of one joint over the fleet, the widest last reading first."""
    read = [line for line in lines if line.readings]
    rows = [
        (
            line.tail_no,
            line.side,
            ", ".join(
                f"{each.date or 'no date'}: {console.length(each.clearance_in)}"
                for each in line.readings[-4:]
            ),
        )
        for line in sorted(read, key=lambda line: -line.readings[-1].clearance_in)
    ]
    console.print(f"Readings of #{joint}, {console.unit} radial:")
    output.print_table(console, ("tail", "side", "date: reading"), rows, (), "--json lists all")


def _count(landings: float | None) -> str:
    return "-" if landings is None else f"{landings:g}"


def _show_life(found: LifeAhead, unit: LengthUnit) -> None:
    from mlg_troubleshoot.life.forecast import outlook_sentence
    from mlg_troubleshoot.life.logbook import shortened
    from mlg_troubleshoot.life.urgency import repair_sentence

    life = found.life
    console = output.console(unit=unit)
    console.print(output.text(life.name, "bold"))
    events = []
    before: tuple[str, ...] = ()
    lines = found.events
    for line in shortened(lines):
        # What was found together bears its day once.
        visit = line.date or "no date", _count(line.gear_landings), line.hash[:10]
        what = f"{said_in(line.full, unit)}{'' if line.counts else ' (void)'}"
        events.append((*([""] * len(visit) if visit == before else visit), what))
        before = visit
    headings = ("date", "landings>", "hash", "what")
    output.print_table(console, headings, events, ("hash",))
    for warning in life.warnings:
        console.print(f"Warning: {warning}")
    for note in life.notes:
        console.print(note)
    if outlook := outlook_sentence(life, found.ahead, found.gear):
        console.print(outlook)
    if helped := repair_sentence(lines):
        console.print(helped)
    _show_joints(console, found)


def _show_joints(console: output.DataConsole, found: LifeAhead) -> None:
    from mlg_troubleshoot.decision.sentences import joint_list
    from mlg_troubleshoot.life.forecast import span, stretches

    headings = (
        "joint",
        f"limit {console.unit} radial",
        "landings to its limit",
        f"readings (landings: {console.unit} radial)",
    )
    rows = []
    for joint in found.joints:
        read = [f"{at:g}: {console.length(clearance)}" for at, clearance in joint.readings]
        if read or joint.landings_to_limit is not None:
            rows.append(
                (
                    f"#{joint.joint}",
                    console.length(joint.limit_in),
                    span(joint.landings_to_limit, found.gear),
                    "… " * (len(read) > 3) + (", ".join(read[-3:]) or "none"),
                )
            )
    if rows:
        output.print_table(console, headings, rows, ())
    ever = {n for kept in found.life.inspections for n in kept.inspection.clearance_in}
    since = stretches(found.life, found.gear.joint_numbers)
    unread = [n for n, of in since.items() if not of[-1].readings]
    placeless = [n for n, of in since.items() if of[-1].readings and not of[-1].placed]
    for said, which in (
        ("Never read, counted as 0 above", [n for n in unread if n not in ever]),
        ("Not read since restored, counted as 0 above", [n for n in unread if n in ever]),
        ("Read, but without landings (gear_landings), so no forecast", placeless),
    ):
        if which:
            console.print(f"{said}: {joint_list(which)}.")


def _say_added(place: Store, what: str, record: Record) -> None:
    """Say on stderr what was added, and which records of its gear disagree now."""
    from mlg_troubleshoot.life.folding import warnings_of

    output.say(f"Kept: {what}.")
    for warning in warnings_of(place, [(record.tail_no, record.side)]):
        output.say(f"Warning: {warning}")


@options.flat
def repair(
    *,
    tail: Tail,
    side: Side,
    joints: Annotated[
        list[int],
        typer.Option("--joint", metavar="N", help="A joint that was restored; may repeat."),
    ],
    day: Day,
    landings: Landings = None,
    work_order: WorkOrder = None,
    records: options.Records,
) -> None:
    """Record joints that were restored: their wear starts again."""
    from mlg_troubleshoot.decision.sentences import joint_list
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.workflows import history

    load_gear(records.gear).require_joints(joints, "--joint")
    restored = sorted(set(joints))
    place = records.kept
    record = history.repair(place, (tail, side), restored, day, work_order, landings)
    listed = joint_list(restored)
    _say_added(place, f"repair of {record.tail_no} {record.side}, {listed}", record)


@options.flat
def amend(
    *,
    record: RecordId,
    values: Annotated[
        list[str], typer.Argument(metavar="COLUMN=VALUE", help="E.g. 3=0.013in, landings=4000.")
    ],
    records: options.Records,
) -> None:
    """Correct values of an inspection; nothing behind = clears one. The old ones stay readable."""
    from mlg_troubleshoot.cli.check_run import named_cells
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.life.folding import find
    from mlg_troubleshoot.workflows import keep

    gear = load_gear(records.gear)
    place = records.kept
    changes = {column: text.strip() for column, (_, text) in named_cells(values, gear).items()}
    added = keep.amend(place, gear, find(place, record), changes)
    _say_added(place, f"correction of {record} ({added.tail_no} {added.side})", added)


@options.flat
def void(
    *,
    record: RecordId,
    why: Annotated[str, typer.Option(metavar="TEXT", help="Why the record does not count.")],
    records: options.Records,
) -> None:
    """Void a record: it stays in the chain but does not count."""
    from mlg_troubleshoot.workflows import history

    added = history.void(records.kept, record, why)
    output.say(f"Kept: {record} ({added.tail_no} {added.side}) does not count.")


@options.flat
def move(
    *,
    record: RecordId,
    tail: Tail,
    side: Side,
    why: Annotated[str, typer.Option(metavar="TEXT", help="Why it is moved.")],
    records: options.Records,
) -> None:
    """Move an inspection to the gear that it is of: one inspection, never two."""
    from mlg_troubleshoot.workflows import history

    added = history.move_record(records.kept, record, (tail, side), why)
    _say_added(records.kept, f"{record} is an inspection of {added.tail_no} {added.side}", added)


@options.flat
def verify(
    *,
    expect: Annotated[
        str | None,
        typer.Option(
            metavar="HASH",
            help="A last hash noted earlier; it must still be in the chain.",
        ),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A report: HOLDS, STALE or VIOLATED, and why."),
    ] = None,
    records: options.Records,
) -> None:
    """Check the chain and name the first record that does not fit (exit code 1).

    This does not prove who wrote a record.

    The last hash is printed. Note it elsewhere and pass it to --expect later: this shows whether
    records were removed.
    """
    from mlg_troubleshoot.cli.output import stages
    from mlg_troubleshoot.workflows import history

    if report is not None:
        from mlg_troubleshoot.gear.gear_file import load_gear
        from mlg_troubleshoot.workflows.witness import Standing, compare_report

        checked = compare_report(records.kept, load_gear(records.gear), report)
        output.write("\n".join([f"{checked.standing}: {report}", *checked.why]))
        if checked.standing is not Standing.HOLDS:
            raise typer.Exit(ExitCode.ATTENTION)
        return
    noted = None if expect is None else expect.strip().lower()
    if noted is not None and not re.fullmatch(r"[0-9a-f]{64}", noted):
        raise UsageError(
            f"--expect {expect!r} is not a hash",
            "Give the 64 letters and digits that verify printed.",
        )
    with stages(quiet=False) as bar:
        found = history.verify(records.kept, noted, partial(bar, "Verifying"))
    output.write("\n".join(output.page("chain", found=found, noted=noted)))
    if found.broken is not None or found.wrong or (noted is not None and found.expected is None):
        raise typer.Exit(ExitCode.ATTENTION)


@options.flat
def export(*, file: Chain, records: options.Records, force: options.Force = False) -> None:
    """Write the whole chain as JSON Lines."""
    from mlg_troubleshoot.cli.output import claim
    from mlg_troubleshoot.outputs import write_text

    claim(None, (), [("the export", file)], store=records.store, force=force)
    lines = list(records.kept.export())
    write_text(file, "".join(lines))
    output.say(f"Written: {file}, {len(lines)} records.")


@options.flat
def import_chain(*, file: Chain, records: options.Records) -> None:
    """Add the records of an exported chain that the store lacks, of this store or another one."""
    from mlg_troubleshoot.workflows import history

    added = history.import_file(records.kept, file)
    output.say(f"Imported: {added.new} records; {added.known} were there already.")


app = options.commands(
    name="history",
    cls=HistoryGroup,
    help=(
        "Show the records of each gear (mlg history, mlg history TAIL LH) and add repairs and"
        " corrections."
    ),
    epilog=EPILOG,
)
app.command(_SHOW, hidden=True)(show)
for command in (repair, amend, void, move, verify, export):
    app.command()(command)
app.command("import")(import_chain)
