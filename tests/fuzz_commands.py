"""Commands fed with damaged and hostile files and asked to write where something stands already.

``python -m tests.fuzz_commands --cases 20000`` runs each case in a child of this process,
``--commands`` as a command of its own; ``--seed S --only N`` runs one case again, in ``--folder``
to look at. Every case must end with an exit code of the contract, within 10 s of processor time and
500 MB, and no file may change that was not asked for.
"""

from __future__ import annotations

import argparse
import random
import shlex
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from tests.fuzz import inputs, stores
from tests.fuzz.case import Case, Ended, preload, run
from tests.fuzz.desk import Desk, Shelf
from tests.fuzz.outputs import outputs

# How often each kind comes in a round.
ROUND: tuple[Callable[[Desk], Case], ...] = (
    *(*inputs.INPUTS, *stores.STORES * 3, *(outputs,) * 5) * 3,
    inputs.targets,
    stores.large,
)


@dataclass(frozen=True)
class Asked:
    """Which cases are run, and how."""

    seed: int
    folder: Path
    kinds: frozenset[str] = frozenset()
    commands: bool = False
    slower: float = 1.0


@dataclass
class Found:
    """What was found so far: how often each kind ended how, the worst figures, and each case that
    is wrong.
    """

    codes: Counter[tuple[str, int]]
    classes: Counter[tuple[str, str]]
    slowest: float = 0.0
    largest: float = 0.0
    wrong: int = 0


def one(asked: Asked, shelf: Shelf, number: int) -> tuple[Case, Ended] | None:
    """Run the case of this number; None if its kind is not asked for."""
    make = ROUND[number % len(ROUND)]
    if asked.kinds and make.__name__ not in asked.kinds:
        return None
    folder = asked.folder / "case"
    shutil.rmtree(folder, ignore_errors=True)
    case = make(Desk(folder, shelf, random.Random(f"{asked.seed} {number}")))
    if asked.commands and case.action is not None:
        return None
    return case, run(case, folder, commands=asked.commands)


def cases(asked: Asked, numbers: Iterable[int]) -> Found:
    """Run the cases of these numbers and say each that is wrong, with how to repeat it."""
    preload()
    shelf = Shelf(asked.folder / "shelf")
    found = Found(Counter(), Counter())
    for number in numbers:
        done = one(asked, shelf, number)
        if done is None:
            continue
        case, ended = done
        found.codes[case.kind, ended.code] += 1
        found.slowest = max(found.slowest, ended.seconds)
        found.largest = max(found.largest, ended.megabytes)
        wrong = ended.wrong(case, asked.slower)
        if wrong:
            found.wrong += 1
            found.classes.update((case.kind, each) for each in wrong)
            lines = "; ".join(shlex.join(("mlg", *line)) for line in case.lines)
            print(
                f"{case.kind}: {', '.join(wrong)}: {lines[:400]!r} {dict(case.environment)}\n   "
                f" {ended.seconds:.1f} s, {ended.megabytes:.0f} MB:"
                f" {ended.output.strip()[-400:]!r}\n    again: python -m tests.fuzz_commands --seed"
                f" {asked.seed} --only {number} --folder DIR" + " --commands" * asked.commands,
                file=sys.stderr,
                flush=True,
            )
    return found


def main() -> int:
    """Run the cases and say what each kind ended with."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="the number of the first case")
    parser.add_argument("--only", type=int, help="the number of one case")
    parser.add_argument("--kinds", default="", help="names of kinds, with commas")
    parser.add_argument(
        "--commands", action="store_true", help="start the command anew for each case"
    )
    parser.add_argument(
        "--slower", type=float, default=1.0, help="how much slower this machine may be"
    )
    parser.add_argument("--folder", type=Path, help="a new folder to work in, which stays")
    given = parser.parse_args()
    numbers = range(given.first, given.first + given.cases) if given.only is None else [given.only]
    with tempfile.TemporaryDirectory() as scratch:
        asked = Asked(
            given.seed,
            (given.folder or Path(scratch)).resolve(),
            frozenset(given.kinds.split(",")) - {""},
            given.commands,
            given.slower,
        )
        found = cases(asked, numbers)
    for (kind, code), count in sorted(found.codes.items()):
        print(f"{kind:10} exit {code}: {count}")
    for (kind, wrong), count in sorted(found.classes.items()):
        print(f"WRONG {kind:10} {wrong}: {count}")
    print(
        f"{found.codes.total()} cases, {found.wrong} not as documented, slowest {found.slowest:.2f}"
        f" s, {found.largest:.0f} MB at most"
    )
    return int(found.wrong > 0)


if __name__ == "__main__":
    raise SystemExit(main())
