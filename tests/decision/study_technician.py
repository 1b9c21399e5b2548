"""The figures of the advice: ``python -m tests.decision.study_technician [--gears 200]``.

Each world is worked on from a seed of its own; nothing in the program was set on seeds from 5,000.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from tests.decision.technician import WORLDS, counted, replayed, say


def main() -> None:
    """Work on the gears of every world, and print what came of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gears", type=int, default=200)
    parser.add_argument("--seed", type=int, action="append", help="may repeat; default 7100")
    parser.add_argument("--world", help="the beginning of a world's name")
    parser.add_argument("--replay", action="store_true", help="rows left as before their repair")
    parser.add_argument("--known", type=int, default=0, help="gears of the fleet that are kept")
    parser.add_argument(
        "--accepted", type=float, default=0.02, help="chance of a second repair; default 0.02"
    )
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if chosen.replay:
            for seed in chosen.seed or [7100]:
                n, away, unasked = replayed(chosen.gears, seed, Path(folder))
                print(f"seed {seed}: {n} repaired, {away} sent elsewhere; {unasked} unasked")
            return
        for seed in chosen.seed or [7100]:
            for place, world in enumerate(WORLDS):
                if chosen.world is None or world.name.startswith(chosen.world):
                    found, _ = counted(
                        world,
                        chosen.gears,
                        seed + place,
                        Path(folder),
                        chosen.known,
                        chosen.accepted,
                    )
                    print(f"seed {seed + place}, {say(world.name, found)}", flush=True)


if __name__ == "__main__":
    main()
