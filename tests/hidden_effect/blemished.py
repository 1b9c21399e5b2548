"""Fleets as they are really written down, diagnosed blind through the command; prints a table.

    python -m tests.hidden_effect.blemished --fleets 4 --first-seed 34000 --keep FILE.jsonl

Each fleet is written as a CSV, ``mlg diagnose FILE --json`` reads it, and an extension is judged on
rows of the same tails that it has not seen, through ``mlg check --extension``.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import sys
import tempfile
import time
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

from tests.hidden_effect import study

# The study sets one thread per worker before numpy is loaded.
import numpy as np  # isort: skip

from mlg_troubleshoot.cli import main as mlg
from tests.hidden_effect.simulator import (
    BLEMISHES,
    CATALOGUE,
    FORMS,
    Truth,
    blemished_fleet,
    write_rows,
)
from tests.hidden_effect.simulator.blemishes import PLUNGER, Rows

Record = dict[str, Any]
Task = tuple[str, str, int, str | None, int | None]

FIRST_SEED = 34_000


def tasks(
    cases: list[str], fleets: int, first_seed: int, beside: bool, rows: int | None = None
) -> list[tuple[int, Task]]:
    """Case, form, seed, further cause and rows of every fleet, each with a number."""
    causes = list(CATALOGUE)
    listed = []
    for case in cases:
        place = list(BLEMISHES).index(case)
        for i in range(fleets):
            for form in FORMS:
                cause = causes[(place + i) % len(causes)] if beside else None
                number = first_seed + 10_000 * (2 * place + FORMS.index(form)) + i
                listed.append((number + 5_000 * beside, (case, form, first_seed + i, cause, rows)))
    return listed


def command(*arguments: str) -> tuple[int, dict[str, Any]]:
    """Exit code and JSON of a command in this process."""
    screen = io.StringIO()
    code: object = 0
    before, sys.argv = sys.argv, ["mlg", *arguments, "--json", "--quiet"]
    try:
        with contextlib.redirect_stdout(screen), contextlib.redirect_stderr(io.StringIO()):
            mlg()
    except SystemExit as stop:
        code = stop.code
    finally:
        sys.argv = before
    text = screen.getvalue()
    return int(str(code or 0)), json.loads(text) if text.strip() else {}


def unseen_rms(rows: Rows, folder: Path, *options: str) -> float:
    """What is left of the unseen rows after a prediction [in]."""
    file = folder / "unseen.csv"
    write_rows(rows, file)
    _code, found = command("check", str(file), *options)
    predicted = {i["record_id"]: i["over_travel_in"] for i in found["inspections"]}
    left = [row[PLUNGER] - predicted[row["record_id"]] for row in rows]
    return float(np.sqrt(np.mean(np.square(left))))


def run(numbered: tuple[int, Task]) -> Record:
    """Draw a fleet, have its table diagnosed, and only then compare with what is true."""
    number, (case, form, seed, beside, count) = numbered
    rows, truth = blemished_fleet(case, form, seed, beside=beside, rows=count)
    with tempfile.TemporaryDirectory() as place:
        file, extension = Path(place) / "fleet.csv", Path(place) / "extension.toml"
        write_rows(rows, file)
        start = time.process_time()
        code, found = command("diagnose", str(file), "--write-extension", str(extension))
        seconds = time.process_time() - start
        left: tuple[float | None, float | None] = (None, None)
        if extension.exists():
            left = (
                unseen_rms(truth.unseen, Path(place)),
                unseen_rms(truth.unseen, Path(place), "--extension", str(extension)),
            )
    also = [*found.get("also_possible", []), *found.get("beside", [])]
    return {
        "seed": number,
        "case": case,
        "form": form,
        "beside": beside,
        "rows": len(rows),
        "code": code,
        "seconds": seconds,
        "unseen": left,
        "named": [(c["cause"], c["target"]) for c in found.get("causes", [])],
        "condition": sorted({c["kind"] for c in found.get("data_condition", [])}),
        "repaired": repaired(found.get("data_faults", []), truth),
        **judged(found.get("verdict"), found.get("causes", []), also, truth, beside),
    }


def repaired(faults: list[Record], truth: Truth) -> tuple[int, int, int]:
    """How many rows with a joint restored between the readings there are, how many of them are
    named so, and how many other rows.
    """
    named = {fault["record_id"] for fault in faults if fault["kind"] == "restored_joint"}
    true = set(truth.repaired)
    return len(true), len(named & true), len(named - true)


def judged(
    verdict: str | None,
    causes: list[Record],
    also: list[Record],
    truth: Truth,
    beside: str | None = None,
) -> dict[str, Any]:
    """What was said, against what is true; beside a blemish only the listed cause is asked for."""
    named = [(c["cause"], c["target"]) for c in causes]
    offered = [*named, *((c["cause"], c["target"]) for c in also)]
    due = truth.causes if beside is None else truth.causes[-1:]
    true = {t[0]: [u for u in due if u[0] == t[0]] for t in due}

    def hit(name: tuple[str, str | None]) -> bool:
        return any(study._same(name, t) for t in truth.causes)

    def met(said: list[tuple[str, str | None]]) -> bool:
        return all(any(study._same(s, t) for s in said for t in of) for of in true.values())

    return {
        "verdict": verdict or "NO ANSWER",
        "right": bool(true) and met(named) and all(map(hit, named)),
        "in_set": bool(true) and met(offered),
        "near": any(name in truth.near for name, _target in named),
        "wrong": any(not hit(n) and n[0] not in truth.near for n in named),
    }


def _worse(record: Record) -> bool:
    before, after = record["unseen"]
    return before is not None and after > before


def _said(record: Record) -> bool:
    """The condition of the data is said in a right word."""
    kinds = BLEMISHES[record["case"]].kinds
    return bool(set(kinds) & set(record["condition"]))


def summarise(records: list[Record]) -> dict[str, dict[str, float | int]]:
    """Rate of each line of what must be shown."""

    def rate(rows: list[Record], hit: Any) -> dict[str, float | int]:
        return study._rate(sum(map(hit, rows)), len(rows))

    alone = [r for r in records if r["beside"] is None]
    listed = ("hyst", "modification_col")
    mild = [r for r in alone if r["form"] == "mild"]
    strong = [r for r in alone if r["form"] == "strong" and r["case"] not in listed]
    worded = [r for r in alone if r["form"] == "strong" and BLEMISHES[r["case"]].kinds]
    both = [r for r in records if r["beside"] is not None]
    modified = [r for r in alone if r["case"] == "modification_col" and r["form"] == "strong"]
    return {
        "mild blemish: a cause named that is not there": rate(mild, lambda r: r["wrong"]),
        "mild blemish: any alarm": rate(
            mild, lambda r: r["verdict"] in ("NAMED", "AMBIGUOUS", "UNLISTED") and not r["in_set"]
        ),
        "strong blemish without a cause: a wrong name": rate(strong, lambda r: r["wrong"]),
        "strong blemish: said in words, of the right kind": rate(worded, _said),
        "strong blemish: no answer": rate(strong, lambda r: r["verdict"] == "NO ANSWER"),
        "blemish with a cause at S = 14: right or in the set": rate(both, lambda r: r["in_set"]),
        "blemish with a cause at S = 14: wrong": rate(both, lambda r: r["wrong"]),
        "an extension that makes unseen rows worse": rate(records, _worse),
        "modification in a column: right": rate(modified, lambda r: r["right"]),
        "modification in a column: wrong": rate(modified, lambda r: r["wrong"]),
    }


def show(records: list[Record]) -> None:
    """Print the lines that must be shown, and every case."""
    for line, rate in summarise(records).items():
        if rate["n"]:
            print(f"{line:55s} {100 * rate['rate']:5.1f} %  of {rate['n']}")
    for case in ("repair", "worn_repair"):
        due, hits, false = np.sum(
            [r["repaired"] for r in records if r["case"] == case] or [[0] * 3], 0
        )
        if due:
            print(f"{case}: {hits} of {due} rows named, {false} others")
    others = [r["repaired"][2] for r in records if not r["case"].endswith("repair")]
    print(
        f"rows named as repaired in other fleets: {sum(others)}, in {np.count_nonzero(others)} of"
        f" {len(others)}"
    )
    groups: dict[tuple[str, str], list[Record]] = defaultdict(list)
    for record in records:
        case = record["case"] + (" + cause" if record["beside"] else "")
        groups[case, record["form"]].append(record)
    print("\n| case | form | n | said | right | in set | near | wrong | kind | worse | s | names |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    for (case, form), rows in sorted(groups.items()):
        said = " ".join(f"{k} {n}" for k, n in Counter(r["verdict"] for r in rows).items())
        names = " ".join(
            f"{k} {n}" for k, n in Counter(n[0] for r in rows for n in r["named"]).items()
        )
        sums = [sum(r[key] for r in rows) for key in ("right", "in_set", "near", "wrong")]
        tail = [sum(map(_said, rows)), sum(map(_worse, rows))]
        seconds = f"{np.median([r['seconds'] for r in rows]):.1f}"
        cells = [case, form, len(rows), said, *sums, *tail, seconds, names]
        print("| " + " | ".join(map(str, cells)) + " |")


def main() -> None:
    """Run the fleets of some cases, or of all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fleets", type=int, default=4, help="fleets of a case and form")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--cases", default=",".join(BLEMISHES))
    parser.add_argument("--beside", action="store_true", help="with a listed cause at S = 14")
    parser.add_argument(
        "--rows", type=int, help="rows of every fleet, even; 60 to 400 if not given"
    )
    parser.add_argument("--keep", type=Path, help="file to keep records in, to go on after a stop")
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    listed = tasks(
        arguments.cases.split(","),
        arguments.fleets,
        arguments.first_seed,
        arguments.beside,
        arguments.rows,
    )
    numbered = [(number, (number, task)) for number, task in listed]
    show(study.mapped(run, numbered, arguments.workers, arguments.keep))


if __name__ == "__main__":
    main()
