"""``mlg study``. Nothing heavy is imported before it runs."""

from __future__ import annotations

from mlg_troubleshoot.cli import options
from mlg_troubleshoot.cli.flags import StudyFlags

EPILOG = (
    "Example: [b]mlg study[/b] · the paper's design: [b]mlg study --design lhs[/b] · its statements: "
    "[b]mlg study --statements[/b] · the table that mlg check uses: [b]mlg study --design tensor --write-table[/b]"
)


@options.flat
def study(flags: StudyFlags, _version: options.Version = False) -> None:
    """Recompute the sensitivity and amplification indices of every joint."""
    from mlg_troubleshoot.cli import study_run
    from mlg_troubleshoot.cli.remembered import settings

    shown = settings(flags.show, flags.page, {}, keep=False, quiet=flags.quiet)
    outputs = [("--csv", flags.csv), ("--state", flags.state)]
    options.keep_inputs(flags.gear, [flags.given], outputs, flags.report, writes_table=flags.write_table)
    with study_run.asked(flags) as (known, wanted):
        study_run.run(known, wanted, flags, shown)
