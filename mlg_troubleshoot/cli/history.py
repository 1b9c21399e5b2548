"""``mlg history``: the records of each gear, and what is added to them later."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from mlg_troubleshoot.cli import options, output
from mlg_troubleshoot.errors import ExitCode, UsageError
from mlg_troubleshoot.units import LengthUnit, in_unit

if TYPE_CHECKING:
    from mlg_troubleshoot.gear.gear import Gear
    from mlg_troubleshoot.store import Store
    from mlg_troubleshoot.workflows.history import Forecast, GearLife, Verified

EPILOG = (
    "Example: [b]mlg history N123 LH[/b] · [b]mlg history repair N123 LH --joint 3 --date"
    " 2026-05-04[/b] · [b]mlg history verify[/b]"
)
_SHOW = "show"

Place = Annotated[
    str | None,
    typer.Option(
        "--store",
        metavar="PATH|URL",
        help="Store of the records; else MLG_STORE, else a file of your own.",
    ),
]
Tail = Annotated[str, typer.Argument(metavar="TAIL", help="Tail number.")]
Side = Annotated[str, typer.Argument(metavar="LH|RH", help="Which gear.")]
RecordId = Annotated[
    str, typer.Argument(metavar="RECORD", help="Record id, or the start of its hash.")
]
Day = Annotated[str, typer.Option("--date", metavar="YYYY-MM-DD", help="Day of the repair.")]
Landings = Annotated[
    str | None, typer.Option("--landings", metavar="N", help="Landings at the repair.")
]
WorkOrder = Annotated[str | None, typer.Option("--work-order", help="Work order.")]
Chain = Annotated[Path, typer.Argument(metavar="FILE", help="JSON Lines, one record per line.")]
NoForecast = Annotated[
    bool, typer.Option("--no-forecast", help="Records only, without a forecast: faster.")
]


class HistoryGroup(TyperGroup):
    """``mlg history`` without the name of a command shows: all gears, an aircraft, or one gear."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if not (args and (args[0] in self.commands or args[0] in ("-h", "--help"))):
            args = [_SHOW, *args]
        return super().parse_args(ctx, args)


def kept_in(place: str | None, gear: str) -> Store:
    """The store, in which every content is judged as it is read."""
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.store import Store
    from mlg_troubleshoot.workflows.kept import KeptGate

    return Store(place, judge=KeptGate(load_gear(gear)))


def show(
    tail: Annotated[
        str | None, typer.Argument(metavar="[TAIL]", help="Tail number; without it all gears.")
    ] = None,
    side: Annotated[
        str | None, typer.Argument(metavar="[LH|RH]", help="Which gear; without it both.")
    ] = None,
    store: Place = None,
    gear: options.Gear = options.DEFAULT_GEAR,
    no_forecast: NoForecast = False,
    report: options.Report = None,
    page: options.Paper = None,
    force: options.Force = False,
    show_in: options.Show = None,
    as_json: options.Json = False,
) -> None:
    """Show the records: the gears and their latest state, or one gear's life with the forecast of
    each joint.
    """
    from mlg_troubleshoot.cli.claims import claim
    from mlg_troubleshoot.cli.remembered import settings
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.workflows import history as task

    place, known = kept_in(store, gear), load_gear(gear)
    claim(gear, (), (), report, store=store, force=force)
    shown = settings(gear, show_in, page)
    if tail is None and report is not None:
        raise UsageError(
            "--report needs a gear",
            "Give TAIL, or write the page of all gears: mlg fleet --report DIR",
        )
    if tail is None:
        found = task.lives(place)
        if as_json:
            output.write_json(task.fleet_as_json(list(found.values()), {}))
        else:
            _show_gears(list(found.values()), place.place)
        return
    tail, meant = task.key_of(tail, "LH" if side is None else side)
    sides = ["LH", "RH"] if side is None else [meant]
    wanted = [key for key in place.gears() if key[0] == tail and key[1] in sides]
    if not wanted:
        task.life_of(place, tail, sides[0])
    # The whole fleet teaches how joints wear.
    everything = task.lives(place, tail if no_forecast else None)
    model = None if no_forecast else task.fit_fleet(everything.values(), known)
    ahead = task.forecast([everything[key] for key in wanted], model, known)
    if as_json:
        if len(wanted) != 1:
            raise UsageError(
                f"{tail} has two gears here, and JSON shows one",
                f"Run: mlg history {tail} LH --json",
            )
        output.write_json(task.life_as_json(everything[wanted[0]], ahead[wanted[0]], known))
    else:
        for key in wanted:
            _show_life(everything[key], ahead[key], known, shown.show)
    if report is not None:
        lives = [everything[key] for key in wanted]
        written = task.write_pages(
            lives,
            ahead,
            known,
            report,
            fleet=False,
            page=shown.page.value,
            unit=shown.show,
            remembered=shown.note or None,
        )
        output.say_written(written)


def _show_gears(found: Sequence[GearLife], place: str) -> None:
    from mlg_troubleshoot.workflows import history as task

    console = output.console()
    if not found:
        console.print(f"No records in {place}. Keep inspections with: mlg check FILE --keep")
        return
    headings = (
        "tail",
        "side",
        "last seen",
        "landings",
        "verdict",
        "look at",
        "inspections",
        "repairs",
    )
    table = output.plain_table(console, *headings, right=("landings", "inspections", "repairs"))
    for life in found:
        seen = life.latest
        landings = None if seen is None else seen.inspection.gear_landings
        joint = None if seen is None else task.worst_joint(seen)
        table.add_row(
            output.word(life.key[0]),
            life.key[1],
            "-" if seen is None else seen.record.day or "no date",
            "-" if landings is None else f"{landings:g}",
            "-" if seen is None else str(seen.result.get("verdict")),
            "-" if joint is None else f"#{joint}",
            str(len(life.inspections)),
            str(len(life.repairs)),
        )
    show_warnings(console, [warning for life in found for warning in life.warnings])
    console.print(table)
    advice = task.advice(found)
    if advice.asked:
        console.print(advice.words)


def show_warnings(console: output.DataConsole, warnings: Iterable[str]) -> None:
    for warning in warnings:
        console.print(output.text(f"Warning: {warning}"))


def say_warnings(place: Store, keys: Collection[tuple[str, str]]) -> None:
    """Say on stderr which records of gears that were just added to disagree."""
    from mlg_troubleshoot.workflows.history import warnings_of

    for warning in warnings_of(place, keys):
        output.say(f"Warning: {warning}")


def _show_life(life: GearLife, ahead: Forecast, gear: Gear, unit: LengthUnit) -> None:
    from mlg_troubleshoot.workflows import history as task

    console = output.console(unit=unit)
    told = task.life_as_json(life, ahead, gear)
    console.print(output.text(" ".join(life.key), "bold"))
    table = output.plain_table(
        console, "date", "landings", "what", "record", "hash", right=("landings",)
    )
    for event in told["events"]:
        landings = event["gear_landings"]
        table.add_row(
            event["date"] or "no date",
            "-" if landings is None else f"{landings:g}",
            _what(event, unit),
            output.word(event["record_id"] or "-"),
            event["hash"][:10],
        )
    console.print(table)
    show_warnings(console, life.warnings)
    if outlook := task.outlook_words(life, ahead, gear):
        console.print(outlook)
    headings = (
        "joint",
        f"limit {unit}",
        f"readings since restored (landings: {unit})",
        "landings to its limit",
    )
    joints = output.plain_table(console, *headings)
    unread = [f"#{joint['joint']}" for joint in told["joints"] if not joint["readings"]]
    for joint in told["joints"]:
        if not joint["readings"] and joint["joint"] not in ahead.joints:
            continue
        shown = joint["readings"][-4:]
        read = (
            ", ".join(f"{landings:g}: {console.length(clearance)}" for landings, clearance in shown)
            or "none"
        )
        joints.add_row(
            f"#{joint['joint']}",
            console.length(joint["limit_in"]),
            ("… " if len(joint["readings"]) > len(shown) else "") + read,
            task.span(joint["landings_to_limit"], gear),
        )
    console.print(joints)
    if unread:
        console.print(
            f"Not read since new or restored: {', '.join(unread)}; unread joints count as 0 above."
        )
    advice = task.advice([life])
    if advice.asked:
        console.print(advice.words)


def _what(event: dict[str, Any], unit: LengthUnit) -> str:
    match event["kind"]:
        case "assessment":
            found = event["predicted_displacement_in"]
            worst = "" if found is None else in_unit(f", worst case {found:.4f} in", unit)
            return f"assessed {event['verdict']}{worst}"
        case "repair":
            return "restored " + ", ".join(f"#{joint}" for joint in event["joints"])
        case "void":
            return f"void: {event['why']}"
        case "outcome":
            return f"found: {event['found']}" + (
                "" if event["joint"] is None else f" (#{event['joint']})"
            )
        case kind:
            corrected = kind == "inspection" and not event["counts"]
            return (
                f"{kind} (corrected or void)"
                if corrected
                else "re-rigged"
                if kind == "rerig"
                else str(kind)
            )


def repair(
    tail: Tail,
    side: Side,
    joints: Annotated[
        list[int],
        typer.Option("--joint", metavar="N", help="A joint that was restored; may repeat."),
    ],
    day: Day,
    landings: Landings = None,
    work_order: WorkOrder = None,
    store: Place = None,
    gear: options.Gear = options.DEFAULT_GEAR,
) -> None:
    """Record joints that were restored: their wear starts again."""
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.store import Kind
    from mlg_troubleshoot.workflows import history as task

    known = load_gear(gear)
    _refuse_unknown(joints, known)
    restored = sorted(set(joints))
    place = kept_in(store, gear)
    record = task.work(place, Kind.REPAIR, (tail, side), day, work_order, landings, restored)
    output.say(
        f"Kept: repair of {record.tail_no} {record.side}, {', '.join(f'#{j}' for j in restored)}."
    )
    say_warnings(place, [(record.tail_no, record.side)])


def rerig(
    tail: Tail,
    side: Side,
    day: Day,
    landings: Landings = None,
    work_order: WorkOrder = None,
    store: Place = None,
    gear: options.Gear = options.DEFAULT_GEAR,
) -> None:
    """Record that the reversing valve was re-rigged; the wear of the joints continues."""
    from mlg_troubleshoot.store import Kind
    from mlg_troubleshoot.workflows import history as task

    place = kept_in(store, gear)
    record = task.work(place, Kind.RERIG, (tail, side), day, work_order, landings)
    output.say(f"Kept: re-rigging of {record.tail_no} {record.side}.")
    say_warnings(place, [(record.tail_no, record.side)])


def _refuse_unknown(joints: Sequence[int], gear: Gear) -> None:
    unknown = [joint for joint in joints if joint not in gear.joint_numbers]
    if unknown:
        raise UsageError(
            f"--joint {unknown[0]}: {gear.name} has no joint {unknown[0]}",
            f"Its joints are {', '.join(map(str, gear.joint_numbers))}.",
        )


def correct(
    record: RecordId,
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="A table with the one corrected inspection.")
    ],
    store: Place = None,
    gear: options.Gear = options.DEFAULT_GEAR,
    unit: options.Unit = None,
    convention: options.Convention = None,
    sheet: options.Sheet = None,
) -> None:
    """Append a corrected inspection. The wrong one stays in the chain but no longer counts."""
    from mlg_troubleshoot.cli.views import notes
    from mlg_troubleshoot.workflows import history as task
    from mlg_troubleshoot.workflows.check import CheckOptions, check_files

    asked = CheckOptions(gear=gear, unit=unit, convention=convention, sheet=sheet)
    result = check_files([file], asked)
    notes.show_problems(result.problems)
    place = kept_in(store, gear)
    added = task.correct(place, record, result, asked)
    output.say(f"Kept: correction of {record} ({added.tail_no} {added.side}).")
    say_warnings(place, [(added.tail_no, added.side)])


def void(
    record: RecordId,
    why: Annotated[
        str, typer.Option("--why", metavar="TEXT", help="Why the record does not count.")
    ],
    store: Place = None,
    gear: options.Gear = options.DEFAULT_GEAR,
) -> None:
    """Void a record: it stays in the chain but does not count."""
    from mlg_troubleshoot.workflows import history as task

    added = task.void(kept_in(store, gear), record, why)
    output.say(f"Kept: {record} ({added.tail_no} {added.side}) does not count.")


def outcome(
    record: RecordId,
    found: Annotated[str, typer.Option("--found", metavar="TEXT", help="What was found.")],
    joint: Annotated[
        int | None, typer.Option("--joint", metavar="N", help="The joint that was the cause.")
    ] = None,
    store: Place = None,
    gear: options.Gear = options.DEFAULT_GEAR,
) -> None:
    """Record what was found after the advice; mlg history then shows how often it was right."""
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.workflows import history as task

    if joint is not None:
        _refuse_unknown([joint], load_gear(gear))
    added = task.outcome(kept_in(store, gear), record, found, joint)
    output.say(f"Kept: outcome of {record} ({added.tail_no} {added.side}).")


def verify(
    store: Place = None,
    expect: Annotated[
        str | None,
        typer.Option(
            "--expect",
            metavar="HASH",
            help="A last hash noted earlier; it must still be in the chain.",
        ),
    ] = None,
    gear: options.Gear = options.DEFAULT_GEAR,
) -> None:
    """Check the chain and name the first record that does not fit (exit code 1). It does not prove
    who wrote a record.

    The last hash is printed. Note it elsewhere and pass it to --expect later: this shows whether
    records were removed.
    """
    from mlg_troubleshoot.workflows import history as task

    noted = None if expect is None else expect.strip().lower()
    if noted is not None and not re.fullmatch(r"[0-9a-f]{64}", noted):
        raise UsageError(
            f"--expect {expect!r} is not a hash",
            "Give the 64 letters and digits that verify printed.",
        )
    found = task.verify(kept_in(store, gear), noted)
    if found.broken is None:
        output.write(f"{found.count} records fit the chain.")
    else:
        broken = found.broken
        output.write(
            f"Record {broken.seq} ({broken.kind} {broken.record_id!r}) does not fit the chain:"
            f" {broken.why}. {found.count} records before it fit."
        )
    if found.last:
        output.write(f"The last hash is {found.last}")
    if noted is not None:
        output.write(_expected(found))
    for each in found.wrong:
        output.write(f"Not as expected: {each}.")
    if found.wrong:
        output.write(
            "What to do: void a record that cannot be read (mlg history void HASH --why TEXT)."
            " Otherwise export the chain, and import it into a new store."
        )
    if found.broken is not None or found.wrong or (noted is not None and found.expected is None):
        raise typer.Exit(ExitCode.ATTENTION)


def _expected(found: Verified) -> str:
    if found.expected is None:
        return (
            "The expected hash is not in the chain: records were taken away or changed, or this is"
            " another store or an older copy."
        )
    since = found.count - found.expected
    return (
        f"The expected hash is that of record {found.expected}; {since} were added since."
        if since
        else "The expected hash is the last one."
    )


def export(
    file: Chain,
    store: Place = None,
    gear: options.Gear = options.DEFAULT_GEAR,
    force: options.Force = False,
) -> None:
    """Write the whole chain as JSON Lines."""
    from mlg_troubleshoot.cli.claims import claim
    from mlg_troubleshoot.outputs import OutputFile, OutputKind, write_text

    lines = list(kept_in(store, gear).export())
    # An export of another store may be all that is left of it.
    own = OutputKind.marked("is not an export of this store", lines[0] if lines else "")
    claim(None, (), [OutputFile("the export", file, own)], store=store, force=force)
    write_text(file, "".join(lines))
    output.say(f"Written: {file}, {len(lines)} records.")


def import_chain(
    file: Chain, store: Place = None, gear: options.Gear = options.DEFAULT_GEAR
) -> None:
    """Read an exported chain into an empty store, or the rest of it into a store that contains its
    beginning.
    """
    from mlg_troubleshoot.workflows import history as task

    added = task.import_file(kept_in(store, gear), file)
    output.say(f"Imported: {added.new} records; {added.known} were there already.")


def ask_tail(tail: str, kept: str) -> bool:
    return typer.confirm(
        f"Tail {tail!r} differs from {kept!r} only in spelling. Is it the same aircraft?", err=True
    )


def history_app() -> typer.Typer:
    app = typer.Typer(
        name="history",
        cls=HistoryGroup,
        help=(
            "Show the records of each gear ([b]mlg history[/b], [b]mlg history TAIL LH[/b]) and add"
            " repairs, corrections and outcomes."
        ),
        epilog=EPILOG,
    )
    app.command(_SHOW, hidden=True)(show)
    for command in (repair, rerig, correct, void, outcome, verify, export):
        app.command()(command)
    app.command("import")(import_chain)
    return app
