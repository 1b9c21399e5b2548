"""``mlg study``. Nothing heavy is imported before it runs."""

from __future__ import annotations

from mlg_troubleshoot.cli import options
from mlg_troubleshoot.cli.flags import StudyFlags

EPILOG = (
    "Example: [b]mlg study[/b] · the paper's design: [b]mlg study --design lhs[/b] · its"
    " statements: [b]mlg study --statements[/b] · the table that mlg check uses: [b]mlg study"
    " --design tensor --write-table[/b]"
)


@options.flat
def study(flags: StudyFlags, _version: options.Version = False) -> None:
    """Recompute the sensitivity and amplification indices of every joint."""
    from mlg_troubleshoot.cli import study_run
    from mlg_troubleshoot.cli.claims import WRITE_TABLE
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.indices.index_table import INDEX_TABLE
    from mlg_troubleshoot.outputs import CONTINUED, OutputFile
    from mlg_troubleshoot.workflows.study import STUDY_CSV

    outputs = [
        OutputFile("--csv", flags.csv, STUDY_CSV),
        OutputFile("--state", flags.state, CONTINUED),
    ]
    if flags.write_table:
        outputs.append(OutputFile(WRITE_TABLE, load_gear(flags.gear).indices_file, INDEX_TABLE))
    shown = flags.begin(flags.gear, [flags.given], outputs)
    with study_run.asked(flags) as (known, wanted):
        study_run.run(known, wanted, flags, shown)
