"""Random scripts of typing errors: none is taken as a value, none leads to another question.

``python -m tests.prompts.test_typing_errors 300`` runs as many.
"""

from __future__ import annotations

import random
import sys
import tempfile
from itertools import pairwise
from pathlib import Path

import pytest

from mlg_troubleshoot.life.folding import life_of
from mlg_troubleshoot.store import Store
from tests.prompts import scripted
from tests.prompts.scripted import Sit, sitting

HEAD = ("N1", "LH", "thou", "play", "f", "46")
READINGS = {f"#{n} ": str(n + 4) for n in range(1, 11)}
# What is refused at each question; an Enter is an answer where the prompt says what it means.
WRONG = {
    "Tail": ("", "?!", "-", "n/a"),
    "Side": ("", "x", "both", "1", "LHS RH"),
    "Unit": ("", "x", "cm", "in mm x", "play"),
    "A cl": ("", "x", "thou", "r", "46"),
    "Did ": ("", "x", "46", "yes", "f 4", "done"),
    "Plun": ("x", "0,041", "3/64", "900", "46 47", "4.6.", "done", "1e9", "-"),
    "#": ("x", "6,5", "-5", "1/64", "9 mm", "200", "3 cm", "#11 5", "1e5", "5 5", "p", "margin 0"),
}


def script(seed: int, sit: Sit, store: Path) -> None:
    """One gear, typed with errors before each answer."""
    chance = random.Random(seed)
    asked: list[tuple[str, str]] = []
    typed: list[str] = []

    class Typist(list[str]):
        """Answers each question, sometimes wrongly first."""

        def pop(self, _at: int = 0) -> str:
            prompt = terminal.screen.rpartition("\n")[2]
            right = answer_to(prompt)
            key = next((k for k in WRONG if prompt.startswith(k)), "")
            word = chance.choice(WRONG[key]) if key and chance.random() < 0.4 else right
            asked.append((prompt, word))
            typed.append(word)
            return word

        def __bool__(self) -> bool:
            return len(typed) < 400

    def answer_to(prompt: str) -> str:
        if prompt.startswith("#"):
            return next(text for key, text in READINGS.items() if prompt.startswith(key))
        begins = ("Tail", "Side", "Unit", "A cl", "Did ", "Plun")
        return next((a for b, a in zip(begins, HEAD, strict=True) if prompt.startswith(b)), "")

    terminal = scripted.ScriptedTerminal(())
    terminal._typed = Typist()
    scripted_terminal = scripted.ScriptedTerminal
    scripted.ScriptedTerminal = lambda *_a: terminal
    try:
        sit()
    finally:
        scripted.ScriptedTerminal = scripted_terminal
    for (prompt, word), (following, _) in pairwise(asked):
        key = next((k for k in WRONG if prompt.startswith(k)), "")
        if key and word in WRONG[key]:
            assert following.partition(" (")[0] == prompt.partition(" (")[0], (prompt, word)
    found = life_of(Store(store), "N1", "LH").inspections[-1].inspection
    assert {n: str(x) for n, x in found.entered.items()} == {
        n: f"{n + 4} thou" for n in range(1, 11)
    }
    assert (found.outcome, found.readings_in) == ("FAILED", (0.046,))


@pytest.mark.parametrize(
    "seed", [pytest.param(s, marks=() if s < 3 else pytest.mark.slow) for s in range(30)]
)
def test_no_typing_error_is_taken_or_leads_elsewhere(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = tmp_path / "store.sqlite"
    script(seed, sitting(store, monkeypatch), store)


if __name__ == "__main__":
    for number in range(int(sys.argv[1])):
        with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
            place = Path(folder) / "store.sqlite"
            script(number, sitting(place, patch), place)
    print(f"{sys.argv[1]} scripts: every error was refused at its own question")
