"""Commands and options that 0.2.0 had and this version has not, and what to use instead."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, takewhile

from mlg_troubleshoot.errors import UsageError

# A command as it is typed after `mlg`, an option after the command that had it or, if several had
# it, alone; then what completes "… is gone since 0.2.0: ".
_INSTEAD = """
check --record-id | --set record_id=ID
check --outcome | --set outcome=FAILED
check --measured | --set plunger=0.041in
check --margin | --set margin=0.028in
check --date | --set date=2026-03-04
check --landings | --set landings=4000
check --restored | --set restored=3,5
check --repair-date | --set repair_date=2026-03-04
check --plunger-date | --set plunger_date=2026-03-04
check --outcome-date | --set outcome_date=2026-03-04
check --rigging-checked | --set rigging_checked=yes
check --measured-again | --set measured_again=3
check --cannot-reach | --set cannot_reach=4
check --no-spare | --set no_spare=3
doctor | mlg gear verify tries the model, and a report that cannot be written says why
check --scheduler | CheckOptions(executor=client.get_executor()) judges on a Dask cluster
study --scheduler | StudyOptions(executor=client.get_executor()) computes on a Dask cluster
study --state | the paper's whole design takes minutes; --workers shortens it
check --resume | mlg check continues an unfinished entry
check --tails | case, blanks, dashes and O for 0 make no other aircraft
check --workers | more than 512 rows are judged on all cores
diagnose --sure | DiagnoseOptions(sure=…) sets it in Python
diagnose --beliefs | --causes FILE.toml takes the file
check --all | --csv or --json lists every inspection
fleet --tail | mlg history TAIL shows the gears of an aircraft
--small-readings-true | say yes in the column of that name, or --set small_readings_true=yes
--install-completion | the names of commands and options stand in mlg --help
--show-completion | the names of commands and options stand in mlg --help
--page | MLG_PAGE=Letter in the environment sets the paper
fleet --show | MLG_SHOW sets the unit
fleet --only | --failed, --since DATE, or the table of --csv
fleet --sort | the most urgent stands first; the table of --csv can be sorted
fleet --xlsx | --csv OUT.csv writes the gears, --report DIR their pages
check --open | NEXT is one step with its minutes; stop when the time is over
check --minutes | NEXT is one step with its minutes; stop when the time is over
check --seed | the probability is that of JCGM 106, without random draws
study --report | --figure OUT.svg draws the indices, --csv and --json list them
study --show | indices have no unit of length
study --quiet | progress is shown at a terminal only
study --accuracy | the default design is exact
study --most | the number of points of a design is fixed; --size sets that of the paper's
study --directions | a study takes the worst directions, which bound the displacement
study --fixed | a study takes the worst directions, which bound the displacement
study --distribution | clearances are uniform between 0 and their limits, as in the paper
study --limit | StudyOptions(limits_in=…) takes one limit per joint in Python
study --beyond-margin | mlg check gives the probability that the margin is exceeded
study --statements | mlg gear verify checks the statements of the paper
study --given | mlg diagnose compares measured with predicted displacements
study --n1 | --size N1,N2,ITERATIONS sets the size of a paper design
study --n2 | --size N1,N2,ITERATIONS sets the size of a paper design
study --iterations | --size N1,N2,ITERATIONS sets the size of a paper design
history outcome | repairs, readings and outcomes are kept as they are found
history correct | mlg history amend RECORD COLUMN=VALUE, or --keep --amend with the table
history rerig | rigging corrected at the prompts, or the column rigging_checked
gear survey | survey(readings, gear) in Python: docs/how-to/measured-gear.md
gear separable | a diagnosis says what would split its set of causes (mlg diagnose)
gear new | write the gear file: docs/how-to/own-gear.md shows a short one
gear draw | load_gear(…).plot() draws a gear in Python
gear reconstruct | mlg gear verify compares the linkage with the numbers of the paper
study --bound | mlg check gives the worst case, which a test compares with a global search
--remember | set MLG_SHOW and MLG_PAGE, and keep headers in a file for --map FILE.toml
"""
GONE = dict(line.split(" | ") for line in _INSTEAD.strip().splitlines())


def refuse_gone(given: Sequence[str]) -> None:
    """Refuse a command line with a command or an option that is gone."""
    words = [
        word
        for before, word in pairwise(("", *given))
        if not word.startswith("-") and before != "--gear"
    ]
    flags = [w.partition("=")[0] for w in takewhile("--".__ne__, given) if w.startswith("--")]
    command = "".join(words[:1])
    own = [f"{command} {flag}" for flag in flags]
    for name in (command, " ".join(words[:2]), *own, *flags):
        if name in GONE:
            raise UsageError(f"mlg {name} is gone since 0.2.0: {GONE[name]}.")
