"""Whether what is said at 90 % is right nine times in ten: a mixture of fleets of both studies.

    python -m tests.hidden_effect.calibration --fleets 300
    python -m tests.hidden_effect.calibration --half-unlisted

The fleets are mixed, so that the first of them are as good a sample as all. Their seeds, 71,000,000
and following, were used for no constant of the program.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

from tests.hidden_effect import departures, study, unforeseen

# The studies set one thread per worker before numpy is loaded.
import numpy as np  # isort: skip

from tests.hidden_effect import simulator

FIRST_SEED = 71_000_000
RESULT = Path(__file__).with_name("calibration_result.json")
AIMS = study.AIMS | {name: aim for name, (*_which, aim) in departures.LINES.items()}
OF_STUDY = {
    **{f"null:{name}": 10 for name in simulator.NULLS},
    "single:10": 140,
    "single:15": 112,
    "off_catalogue": 40,
    "double": 40,
    "triple": 24,
    "aliased": 10,
    "missing_column": 12,
}
OF_DEPARTURES = {
    "loads:40": 24,
    "loads:90": 20,
    "loads:180": 16,
    "loads and gauge_bias": 10,
    "linkage, nothing hidden": 36,
    "linkage, one cause": 42,
    "read #2-#5, nothing hidden": 20,
    "read #2-#5, one cause": 18,
    "blank 50 %": 20,
    "convention": 10,
    "one group": 18,
}
# Half of the effects are on no list, and a fifth of the fleets have rough data and nothing wrong.
HALF_UNLISTED = {
    **{f"null:{name}": 6 for name in simulator.NULLS},
    "single:10": 56,
    "single:15": 56,
    "double": 24,
    "off_catalogue": 96,
}
UNLISTED = ("off_catalogue", "one group", "humidity", "elevation", "overhaul_date", "two_lots")
ROUGH = ("gears_scatter", "coarse_dial", "bad_gauge", "rounding_shop")
OF_UNFORESEEN = {
    **dict.fromkeys(("station", "bent_link", "slightly_bent_link", "dial"), 8),
    **dict.fromkeys(("humidity", "elevation", "overhaul_date", "two_lots"), 16),
    **dict.fromkeys((*ROUGH, "nothing"), 24),
}
# Other fleets than those that are drawn: how much oftener each occurs, by what is wrong in it.
_LISTED = {*simulator.CATALOGUE, "load_directions", "convention_slip", "geometry"}
_EVERY_SECOND = tuple(simulator.CATALOGUE)[::2]
MIXTURES: dict[str, Callable[[list[str]], float]] = {
    "as drawn": lambda _wrong: 1.0,
    "nothing wrong three times as often": lambda wrong: 1.0 if wrong else 3.0,
    "nothing wrong a third as often": lambda wrong: 1.0 if wrong else 1.0 / 3.0,
    "unlisted three times as often": lambda wrong: 3.0 if set(wrong) - _LISTED else 1.0,
    "every second cause three times as often, the others a third": lambda wrong: float(
        np.prod(
            [3.0 if c in _EVERY_SECOND else 1.0 / 3.0 for c in wrong if c in simulator.CATALOGUE]
        )
    ),
    "every second cause a third as often, the others three times": lambda wrong: float(
        np.prod(
            [1.0 / 3.0 if c in _EVERY_SECOND else 3.0 for c in wrong if c in simulator.CATALOGUE]
        )
    ),
}
EDGES = (0.05, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.99, 1.0)


def tasks(first_seed: int = FIRST_SEED) -> list[tuple[int, Any]]:
    """Fleets of both studies in mixed order, each with its seed."""
    listed: list[tuple[int, Any]] = [(t["seed"], t) for t in study.tasks(OF_STUDY, first_seed)]
    listed += [(t[2], t) for t in departures.tasks(OF_DEPARTURES, first_seed + 500_000)]
    return [listed[int(k)] for k in np.random.default_rng(first_seed).permutation(len(listed))]


def half_unlisted(first_seed: int) -> list[tuple[int, Any]]:
    """Fleets of which half of the effects are on no list, each with its seed."""
    listed: list[tuple[int, Any]] = [(t["seed"], t) for t in study.tasks(HALF_UNLISTED, first_seed)]
    listed += [(t[2], t) for t in departures.tasks({"one group": 32}, first_seed + 500_000)]
    own = [(kind, k) for kind, count in OF_UNFORESEEN.items() for k in range(count)]
    return listed + [
        (first_seed + 600_000 + n, (first_seed + 600_000 + n, kind))
        for n, (kind, _k) in enumerate(own)
    ]


def run(task: Any) -> dict[str, Any]:
    """Simulate and diagnose one fleet, then compare."""
    if isinstance(task, dict):
        return study.run(task)
    return departures.run(task) if len(task) == 3 else unforeseen.run(task)


def false_names(records: list[dict[str, Any]]) -> str:
    """Fleets with a name that is not there: of rough data, and of an effect that is on no list."""
    told = []
    for words, groups in (
        ("rough data", ROUGH),
        ("nothing wrong", ("nothing", *(f"null:{name}" for name in simulator.NULLS))),
        ("on no list", UNLISTED),
    ):
        own = [r for r in records if r["group"] in groups]
        false = [r for r in own if r["named"]]
        told.append(f"{words}: {len(false)} of {len(own)}")
        told += [f"    {r['seed']} {r['group']} {r['named']}" for r in false]
    return "\n".join(told)


def _wrong(record: dict[str, Any]) -> list[tuple[str, str | None]]:
    """All that is wrong in a fleet, its linkage included."""
    other = [("geometry", None)] if record.get("linkage", "A") != "A" else []
    return [*map(tuple, record["truth"]), *other]


def bins(
    records: list[dict[str, Any]], oftener: Callable[[list[str]], float] = MIXTURES["as drawn"]
) -> list[tuple[float, float, int, float, float]]:
    """Of each bin in which something was stated: its edges, how many causes were stated in it,
    their mean, and the share of them that acts, as if fleets with something wrong were so much
    oftener.

    Another linkage is a cause like any other. Without its fleets the others would be right too
    often: what is stated of it, beside them, would count against them, and where it acts would not.
    """
    said = np.array(
        [
            (
                float(p),
                any(study._same((cause, target), t) for t in _wrong(r)),
                oftener([str(name) for name, _target in _wrong(r)]),
            )
            for r in records
            for cause, target, p in r.get("probabilities", ())
        ]
    ).reshape(-1, 3)
    found = []
    for low, high in pairwise(EDGES):
        own = said[(said[:, 0] >= low) & ((said[:, 0] < high) | (high == 1.0))]
        if len(own):
            stated, acts = np.average(own[:, :2], axis=0, weights=own[:, 2])
            found.append((low, high, len(own), float(stated), float(acts)))
    return found


def result_of(records: list[dict[str, Any]], first_seed: int) -> dict[str, Any]:
    """What is committed: how many fleets, the rates of both studies, the bins, and how far each is
    off in other mixtures of fleets, in points.
    """
    of_study = [r for r in records if "strengths" in r]
    of_departures = [r for r in records if "strengths" not in r]
    rates = study.summarise(of_study) | departures.summarise(of_departures)
    return {
        "fleets": len(records),
        "first_seed": first_seed,
        "rates": {name: rates[name] for name in AIMS if name in rates and rates[name]["n"]},
        "bins": bins(records),
        "off": {
            name: [round(100.0 * (acts - mean)) for *_bin, mean, acts in bins(records, oftener)]
            for name, oftener in MIXTURES.items()
        },
    }


def stated(found: list[tuple[float, float, int, float, float]]) -> str:
    """Return the table of bins."""
    lines = ["| stated | causes | mean stated | act |", "|---|---|---|---|"]
    for low, high, count, mean, acts in found:
        rate = study._rate(round(acts * count), count)
        band = f"{rate['low']:.2f}–{rate['high']:.2f}"
        lines.append(f"| {low:.2f}–{high:.2f} | {count} | {mean:.3f} | {acts:.3f} ({band}) |")
    return "\n".join(lines)


def markdown(result: dict[str, Any]) -> tuple[str, str, str]:
    """Return the tables of a result: rates, bins, and how far they are off elsewhere."""
    # Of fewer fleets an interval says next to nothing; the result has them.
    rates = [
        study.rate_line(name, AIMS[name], rate)
        for name, rate in result["rates"].items()
        if rate["n"] >= 10
    ]
    edges = " | ".join(f"{low:.2f}–{high:.2f}" for low, high, *_bin in result["bins"])
    off = [f"| act less stated, points | {edges} |", f"|---|{'---|' * len(result['bins'])}"]
    off += [
        f"| {name} | {' | '.join(f'{points:+d}' for points in row)} |"
        for name, row in result["off"].items()
    ]
    return "\n".join((*study.HEAD, *rates)), stated(result["bins"]), "\n".join(off)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--fleets", type=int, default=300, help="how many of the mixed fleets")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--keep", type=Path, help="file to keep records in, to go on after a stop")
    parser.add_argument("--write", action="store_true", help=f"write {RESULT.name}")
    parser.add_argument("--half-unlisted", action="store_true", help="half of the effects unlisted")
    given = parser.parse_args()
    if given.half_unlisted:
        listed = half_unlisted(given.first_seed)
        records = study.mapped(run, listed, given.workers, given.keep)
        named = [
            r | {"probabilities": [p for p in r.get("probabilities", ()) if p[:2] in r["named"]]}
            for r in records
        ]
        for told in (records, named):
            print(stated(bins(told)), end="\n\n")
        print(false_names(records))
        return
    listed = tasks(given.first_seed)[: given.fleets]
    records = study.mapped(run, listed, given.workers, given.keep)
    result = result_of(records, given.first_seed)
    print(*markdown(result), sep="\n\n")
    if given.write:
        RESULT.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
