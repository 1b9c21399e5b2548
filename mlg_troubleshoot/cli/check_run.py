"""``mlg check``: judges tables or a gear entered by hand; shows, writes and keeps what was
found.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import partial
from itertools import chain, repeat
from pathlib import Path
from typing import TYPE_CHECKING

from mlg_troubleshoot.cli import options, output
from mlg_troubleshoot.cli.output import stages
from mlg_troubleshoot.cli.views import batch, one_gear
from mlg_troubleshoot.decision.columns import (
    OUTCOME,
    RECORD_ID,
    SIDE,
    TAIL_NO,
)
from mlg_troubleshoot.decision.inspection import Inspection, RowSource, Side
from mlg_troubleshoot.decision.judge_rows import Listed, listed
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.outputs import whole_file
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit
from mlg_troubleshoot.workflows import check as task
from mlg_troubleshoot.workflows.check import load_index_table
from mlg_troubleshoot.workflows.diagnose import load_model_extension

if TYPE_CHECKING:
    from mlg_troubleshoot.cli.check import Flags, Wanted
    from mlg_troubleshoot.decision.assessment import Judgement
    from mlg_troubleshoot.records import ReadResult
    from mlg_troubleshoot.store import Store
    from mlg_troubleshoot.workflows.keep import Told

# Inspections that --report writes at most: HTML and PDF of one take 0.1 s, and their judgements
# stand in memory until then. [1]
_MOST_REPORTS = 1000


@dataclass
class _Gathered:
    """What is still needed of judgements that went out as they came."""

    lines: list[Listed] = field(default_factory=list)
    held: list[Judgement] = field(default_factory=list)
    entries: list[Told] = field(default_factory=list)
    annotated: dict[RowSource, task.Annotated] = field(default_factory=dict)
    end: str = ""


class Run:
    """One run of the command: what was asked for, read once."""

    convention: ClearanceConvention | None = None

    def __init__(
        self, files: Sequence[str], flags: Flags, tables: options.Tables, wanted: Wanted
    ) -> None:
        if len(files) == 2 and Side.spelt(files[1]) and not Path(files[0]).exists():
            flags, files = replace(flags, tail=files[0], side=files[1]), []
        if wanted.annotate is not None and (len(files) != 1 or files[0] == "-"):
            raise UsageError("--annotate needs exactly one workbook", "Give one .xlsx FILE.")
        extensions = wanted.extension or ()
        causes = wanted.causes or ()
        self._files = files
        self._flags = flags
        self._wanted = wanted
        self._page = options.paper_size()
        self._asks = not (files or flags.values)
        output.claim(
            tables.gear,
            [*files, *extensions, *causes, *tables.map_files],
            [("--csv", wanted.csv), ("--annotate", wanted.annotate)],
            wanted.report,
            store=wanted.store,
            force=wanted.force,
        )
        if wanted.causes and not wanted.extension:
            raise UsageError(
                "--causes was given without the extension that its causes are for",
                "Give --extension EXT.toml as well, or leave out --causes.",
            )
        self.asked = task.CheckOptions(
            side=None if flags.side is None else Side.parse(flags.side),
            **tables.declared(),
            # Each report of a table says what a report of one gear says.
            advice=True if wanted.report is not None else None,
            extension=load_model_extension(extensions, tables.gear, causes),
            workers=os.cpu_count() or 1,
        )
        self._records = options.Records(wanted.store, tables.gear)
        # A store that is not asked for is not opened: SQLAlchemy is a third of a check.
        reads = wanted.keep or self._asks or wanted.store is not None
        self._place = self._records.kept if reads else None

    def run(self) -> int:
        """Judge, show and keep; the exit code is returned."""
        load_index_table(load_gear(self.asked.gear), lambda said: output.say(f"Note: {said}"))
        if self._files:
            return self._check_files()
        if self._asks:
            return self._ask().exit_code
        typed = from_flags(self._flags, self.asked, self._place)
        result = task.check_inspection(typed, self.asked, self._place)
        against: list[str] = []
        try:
            against = self._keep(result.judgements)
        finally:
            self.publish(result, typed.unit_entered or self.asked.unit)
        return task.exit_code_of(listed(result.judgements), against)

    def _check_files(self) -> int:
        # The side of a FILE is that of a table without a column of sides.
        if self._flags.values or self._flags.tail is not None:
            raise UsageError(
                "--set and --tail describe one gear entered by hand, and a FILE was given as well",
                "Give either a FILE or the values of one gear.",
            )
        for file in map(Path, self._files):
            if file.name.startswith("~$"):
                raise UsageError(
                    f"{file} is the lock file of a workbook that is open",
                    f"Give the workbook: {file.with_name(file.name[2:])}.",
                )
            if file.name == "-" or file.exists() or not file.parent.is_dir():
                continue
            near = get_close_matches(file.name, [each.name for each in file.parent.iterdir()], 1)
            if near:
                output.say(f"There is no file {file}. Did you mean {file.with_name(near[0])}?")
        wanted = self._wanted
        # On one terminal a bar would stand between the lines of the result.
        quiet = wanted.quiet or (wanted.as_json and sys.stdout.isatty())
        with ExitStack() as files:
            found = _Gathered()
            with stages(quiet=quiet) as bar:
                result = task.check_files(
                    [Path(name) for name in self._files],
                    self.asked,
                    on_read=partial(bar, "Reading"),
                    on_judged=partial(bar, "Judging"),
                    store=self._place,
                    outputs=partial(self._outputs, found, files),
                )
            result = replace(result, judgements=tuple(found.held))
            unit = wanted.unit(*(line.unit for line in found.lines))
            if found.end:
                output.write_pieces((found.end,))
            elif wanted.as_json:
                output.write_json(result)
            else:
                self.show(result, unit, found.lines, detail=wanted.detail)
        if wanted.annotate is not None and result.read is not None:
            self._annotate(result.read, found.annotated, wanted.annotate)
        # A report states what was kept.
        against = self._keep((), found.entries)
        if wanted.report is not None:
            self.write_reports(result, wanted.report, unit)
        if found.lines and not (wanted.keep or wanted.quiet or wanted.as_json):
            output.say("Not kept: --keep adds these inspections to the records.")
        if result.problems and not wanted.as_json and not found.lines:
            output.say("No row could be judged.")
        return task.exit_code_of(found.lines, (*result.unread_files, *against))

    def _outputs(
        self, found: _Gathered, files: ExitStack, read: task.CheckResult, total: int
    ) -> list[task.BlockOutput]:
        """What is made of the judgements as they come."""
        wanted = self._wanted
        if wanted.report is not None and total > _MOST_REPORTS:
            raise UsageError(
                f"--report of {total} inspections: at most {_MOST_REPORTS} are written at once;"
                " nothing was judged",
                "Give a table with the gears that need a report; --csv and --json take all.",
            )
        outputs = [task.BlockOutput(listed, found.lines.extend)]
        if wanted.as_json and total > 1:
            begin, found.end = task.json_around(read)
            joint = chain((begin,), repeat(",\n"))
            outputs.append(
                task.BlockOutput(
                    task.json_lines,
                    lambda block: output.write_pieces((next(joint), block)),
                    sets=True,
                )
            )
        if wanted.csv is not None:
            write = files.enter_context(whole_file(wanted.csv))
            write(task.VERDICT_HEADER.encode())
            outputs.append(
                task.BlockOutput(task.verdict_lines, lambda block: write(block.encode()))
            )
        if wanted.annotate is not None:
            outputs.append(task.BlockOutput(task.annotated, found.annotated.update))
        if self._place is not None:
            from mlg_troubleshoot.workflows.keep import told_by

            outputs.append(task.BlockOutput(told_by, found.entries.extend))
        if total == 1 or wanted.report is not None:
            outputs.append(task.BlockOutput(tuple, found.held.extend, sets=True))
        return outputs

    def _ask(self) -> task.CheckResult:
        if not output.can_ask():
            raise UsageError(
                "nothing to check: no FILE was given, and this is not a terminal to ask on",
                "Pass a FILE, - for standard input, or --set COLUMN=VALUE with --tail, --side and"
                " --convention.",
            )

        assert self._place
        from mlg_troubleshoot.cli.prompts.sitting import Sitting

        return Sitting(self, self._place).hold(self._flags.tail)

    def publish(self, result: task.CheckResult, entered_in: LengthUnit | None) -> None:
        """Show and write one gear that was entered by hand."""
        wanted = self._wanted
        unit = wanted.unit(entered_in)
        if wanted.as_json:
            output.write_json(result)
        else:
            self.show(result, unit, detail=wanted.detail)
        if wanted.csv is not None:
            task.write_verdicts(result, wanted.csv)
        if wanted.report is not None:
            self.write_reports(result, wanted.report, unit)

    def show(
        self,
        result: task.CheckResult,
        unit: LengthUnit,
        lines: Sequence[Listed] = (),
        *,
        detail: bool,
    ) -> None:
        batch.show_notes(result.unread if self._wanted.quiet else result.notes)
        batch.show_problems(result.problems)
        screen = output.console(unit=unit)
        screen.asks = self._asks
        screen.convention = self.convention
        if len(lines) > 1:
            batch.show(lines, result.gear, screen)
        elif result.judgements:
            one_gear.show(result.judgements[0], result.gear, screen, detail=detail)
        if lines or result.judgements:
            batch.show_unread(result.unread_files, screen)

    def _annotate(
        self, read: ReadResult, said: Mapping[RowSource, task.Annotated], out: Path
    ) -> None:
        if not read.layouts:
            output.say(f"{out} was not written: no table was found to annotate.")
            return
        for loss in task.annotate(read, said, Path(self._files[0]), out):
            output.say(f"Note: {loss}.")
        if not self._wanted.quiet:
            output.say(f"Annotated workbook: {out}")

    def write_reports(
        self, result: task.CheckResult, directory: Path, unit: LengthUnit
    ) -> list[Path]:
        """Write the reports of what was found; their files are returned."""
        with stages(quiet=self._wanted.quiet) as bar:
            written = task.write_reports(
                result,
                self.asked,
                directory,
                tuple(self._wanted.formats or options.ReportFormat),
                self._page,
                on_written=partial(bar, "Writing reports"),
                unit=unit,
                store=self._place,
                # The prompts write the report of one inspection anew after each change.
                replace_files=self._asks or self._wanted.force,
            )
        return output.say_written(written, quiet=self._wanted.quiet)

    def _keep(self, judgements: Sequence[Judgement], told: Sequence[Told] = ()) -> list[str]:
        """Add what was found to the store, if that is asked for; return the gears that need
        attention with all of their records.
        """
        if self._place is None or not self._wanted.keep:
            return []
        from mlg_troubleshoot.workflows.keep import keep, told_by

        with stages(quiet=self._wanted.quiet) as bar:
            progress = partial(bar, "Keeping")
            found = [*told_by(judgements), *told]
            added = keep(found, self._place, progress, amend=self._wanted.amend)
        if not self._wanted.quiet:
            noun = "inspection" if added.new == 1 else "inspections"
            known = f", {added.known} known already" if added.known else ""
            output.say(f"{added.new} {noun} kept in {self._place.place}{known}.")
        gears = [each.key for each in found]
        # After --amend or --keep-old what is kept of a visit is not what its row says.
        is_settled = self._wanted.amend is not None
        seen = Counter(dict.fromkeys(gears, 0)) if is_settled else Counter(gears)
        warnings, against = task.look_at_kept(seen, self._place, load_gear(self.asked.gear))
        for warning in (*added.warnings, *warnings, *against):
            output.say(f"Warning: {warning}")
        return against


def from_flags(flags: Flags, declared: task.CheckOptions, place: Store | None = None) -> Inspection:
    """Let the judge of table rows judge the flags; a refusal names the flag. An id that was made
    is free in the store.
    """
    from mlg_troubleshoot.records import ReadOptions, admit, made_record_id

    gear = load_gear(declared.gear)
    options = ReadOptions.of(gear, declared)
    values = {TAIL_NO.name: flags.tail or "", SIDE.name: flags.side or ""}
    labels = {TAIL_NO.name: "--tail", SIDE.name: "--side"}
    for column, (pair, text) in named_cells(flags.values or (), gear, "--set ").items():
        if values.get(column):
            raise UsageError(f"{labels[column]} and --set {pair!r} say the same", "Give one.")
        values[column] = text
        labels[column] = f"--set {pair!r}"
    read = admit({RECORD_ID.name: "-", **values}, options, labels)
    if RECORD_ID.name in values:
        return read
    read = replace(read, record_id=made_record_id(read))
    if place is None:
        return read
    from mlg_troubleshoot.workflows.keep import under_a_free_id

    return under_a_free_id(read, place)


def named_cells(pairs: Sequence[str], gear: Gear, flag: str = "") -> dict[str, tuple[str, str]]:
    """COLUMN=VALUE and its VALUE, by the column that is named by its own or a short name."""
    from mlg_troubleshoot.cli.prompts.entry import OUTCOMES, meant_column
    from mlg_troubleshoot.records import ReadOptions, headers

    joints = ReadOptions.of(gear).joints
    values: dict[str, tuple[str, str]] = {}
    for pair in pairs:
        name, sign, text = pair.partition("=")
        if not sign or (flag and not text.strip()):
            raise UsageError(
                f"{flag}{pair!r} is not COLUMN=VALUE",
                f"Write for example {flag}3=0.013in or {flag}outcome=FAILED.",
            )
        column = headers.parse_target(name, joints, f"{flag}{pair!r}").name
        column = meant_column(column, text)
        if column == OUTCOME.name:
            text = OUTCOMES.get(text.lower(), text)
        if column in values:
            raise UsageError(f"{flag or 'amend '}gives {column} twice", "Give each column once.")
        values[column] = pair, text
    return values
