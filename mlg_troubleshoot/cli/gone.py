"""Commands and options that 0.2.0 had and this version has not, and what to use instead."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, takewhile

from mlg_troubleshoot.errors import UsageError

# A command as it is typed after `mlg`, an option after the command that had it or, if several had
# it, alone. What follows completes "… is gone since 0.2.0: ".
GONE = {
    "doctor": "mlg gear verify tries the model, and a report that cannot be written says why",
    "check --scheduler": "CheckOptions(executor=client.get_executor()) judges on a Dask cluster",
    "study --scheduler": "StudyOptions(executor=client.get_executor()) computes on a Dask cluster",
    "study --state": "the paper's whole design takes minutes; --workers shortens it",
    "fleet --xlsx": "--csv OUT.csv writes the gears, --report DIR their pages",
    "check --open": "NEXT is one step with its minutes; stop when the time is over",
    "check --minutes": "NEXT is one step with its minutes; stop when the time is over",
    "check --seed": "the probability is that of JCGM 106, without random draws",
    "gear separable": "a diagnosis says what would split its set of causes (mlg diagnose)",
    "gear new": "write the gear file: docs/how-to/own-gear.md shows a short one",
    "gear draw": "load_gear(…).plot() draws a gear in Python",
    "gear reconstruct": "mlg gear verify compares the linkage with the numbers of the paper",
    "study --bound": "mlg check gives the worst case, which a test compares with a global search",
    "--remember": "set MLG_SHOW and MLG_PAGE, and keep headers in a file for --map FILE.toml",
}


def refuse_gone(given: Sequence[str]) -> None:
    """Refuse a command line with a command or an option that is gone."""
    words = [
        word
        for before, word in pairwise(("", *given))
        if not word.startswith("-") and before != "--gear"
    ]
    flags = [word.partition("=")[0] for word in takewhile("--".__ne__, given)]
    flags = [flag for flag in flags if flag.startswith("--")]
    command = "".join(words[:1])
    own = [f"{command} {flag}" for flag in flags]
    for name in (command, " ".join(words[:2]), *own, *flags):
        if name in GONE:
            raise UsageError(f"mlg {name} is gone since 0.2.0: {GONE[name]}.")
