"""Random scripts of typing errors: none is taken as a value, none leads to another question.

``python -m tests.prompts.test_typing_errors 300`` runs as many; a second number is the first seed.
"""

from __future__ import annotations

import random
import sys
import tempfile
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

import pytest

from mlg_troubleshoot.cli.prompts.ask import Asker
from mlg_troubleshoot.cli.prompts.entry import Entry
from mlg_troubleshoot.cli.prompts.saved import SavedEntries
from mlg_troubleshoot.gear.gear_file import load_gear
from tests.prompts.scripted import ScriptedTerminal

RIGHT = {
    **{"Tail": "N1", "Side": "LH", "Unit": "thou", "A cl": "play", "Did ": "f", "Plun": "46"},
    **{f"#{n} ": str(n + 4) for n in range(1, 11)},
}
# What is refused at each question; an Enter is an answer where the prompt says what it means.
WRONG = {
    "Tail": ("", "?!", "-", "n/a"),
    "Side": ("", "x", "both", "1", "LHS RH"),
    "Unit": ("", "x", "cm", "in mm x", "play", "1 thou"),
    "A cl": ("", "x", "thou", "r", "46", "rad x"),
    "Did ": ("", "x", "46", "yes", "f 4", "done"),
    "Plun": ("x", "0,041", "3/64", "900", "46 47", "4.6.", "1e9", "-", "f 3", "n 5 5"),
    "#": (
        *("x", "6,5", "-5", "1/64", "9 mm", "200", "3 cm", "#11 5", "1e5", "5 5", "p", "margin 0"),
        *("#99 5", "landings 3,412", "margin x", "date 99 Nov", "date 03/04/2026", "side x"),
        *("temperature 99", "1 4", "gauge 0.5", "gauge +/- 0.5 thou", "n"),
    ),
}


class Typist(ScriptedTerminal):
    """Answers each question, sometimes wrongly first; the first one types every error once."""

    def __init__(self, seed: int) -> None:
        super().__init__(())
        self.chance = random.Random(seed)
        self.left = {} if seed else {begin: [*words] for begin, words in WRONG.items()}
        self.asked: list[tuple[str, str]] = []

    def ask(self, prompt: str) -> str:
        word = next((text for begin, text in RIGHT.items() if prompt.startswith(begin)), "")
        begin = next((begin for begin in WRONG if prompt.startswith(begin)), "")
        if self.left.get(begin):
            word = self.left[begin].pop()
        elif begin and self.chance.random() < 0.4:
            word = self.chance.choice(WRONG[begin])
        self.asked.append((prompt.partition(" (")[0], word))
        assert len(self.asked) < 400
        return word


def _wrong_at(prompt: str) -> tuple[str, ...]:
    return next((wrong for begin, wrong in WRONG.items() if prompt.startswith(begin)), ())


def run_script(seed: int, folder: Path) -> None:
    """One gear, typed with errors before each answer."""
    gear = load_gear()
    typist = Typist(seed)
    with pytest.MonkeyPatch.context() as patch:
        # The order of the joints is not an error here, and a plan takes its time.
        patch.setattr("mlg_troubleshoot.cli.prompts.ask.reading_order", lambda *_: ())
        entry = Asker(gear, typist, SavedEntries(folder / f"{seed}.sqlite")).begin({})
    for (prompt, word), (following, _) in pairwise(typist.asked):
        assert word not in _wrong_at(prompt) or following == prompt, (seed, prompt, word)
    assert isinstance(entry, Entry)
    (found,) = entry.visits(gear)
    assert {n: str(x) for n, x in found.entered.items()} == {
        n: f"{n + 4} thou" for n in range(1, 11)
    }
    assert (found.outcome, found.readings_in) == ("FAILED", (0.046,))


@pytest.mark.parametrize(
    "seeds", [range(3), pytest.param(range(3, 300), marks=pytest.mark.slow)], ids=len
)
def test_no_typing_error_is_taken_or_leads_elsewhere(seeds: Iterable[int], tmp_path: Path) -> None:
    for seed in seeds:
        run_script(seed, tmp_path)


if __name__ == "__main__":
    count, first = (*map(int, sys.argv[1:]), 0)[:2]
    with tempfile.TemporaryDirectory() as place:
        for number in range(first, first + count):
            run_script(number, Path(place))
    print(f"{count} scripts: every error was refused at its own question")
