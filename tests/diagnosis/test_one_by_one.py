"""Several causes at once: what is added, what is left out again, and when it ends."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from mlg_troubleshoot.diagnosis import inference
from mlg_troubleshoot.diagnosis.bank import build_bank
from mlg_troubleshoot.diagnosis.causes import CATALOGUE
from mlg_troubleshoot.diagnosis.inference import SECOND_SHARE, Inference, _Together
from mlg_troubleshoot.diagnosis.scene import build_scene, effect_columns
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.misfit.one_by_one import one_by_one

from .conftest import Array, DiagnosisTable, fleet


@dataclass(frozen=True)
class Script:
    """Causes as a script adds them, and what it calls idle once it is there with another."""

    order: tuple[int, ...]
    idle: frozenset[tuple[int, int]] = frozenset()
    chosen: tuple[int, ...] = ()

    def further(self) -> Script | None:
        left = [k for k in self.order if k not in self.chosen]
        return replace(self, chosen=(*self.chosen, left[0])) if left else None

    def without_idle(self) -> Script | None:
        useless = [k for k in self.chosen if any((k, other) in self.idle for other in self.chosen)]
        return (
            replace(self, chosen=tuple(k for k in self.chosen if k != useless[0]))
            if useless
            else None
        )


def test_causes_are_added_until_none_earns_its_place() -> None:
    assert one_by_one(Script((2, 0, 1)), most=9).chosen == (2, 0, 1)


def test_no_more_causes_are_added_than_allowed() -> None:
    assert one_by_one(Script((2, 0, 1)), most=2).chosen == (2, 0)


def test_a_cause_that_others_make_idle_is_left_out_again() -> None:
    assert 5 not in one_by_one(Script((5, 0, 1), frozenset({(5, 1)})), most=3).chosen


def test_a_search_that_goes_in_a_circle_ends() -> None:
    assert one_by_one(Script((0, 1), frozenset({(0, 1), (1, 0)})), most=9).chosen in {(0,), (1,)}


def two_wrong(table: DiagnosisTable, _over: Array) -> Array:
    return np.where(table.factors["technician_id"] == "T-2", 0.007, 0.0) + np.where(
        table.factors["side"] == "RH", 0.006, 0.0
    )


def test_of_a_gears_causes_the_one_that_does_nothing_is_left_out(gear: Gear) -> None:
    table = fleet(gear.model, two_wrong, rows=200)
    scene, rows = build_scene(gear.model, table, gear.discrepancies)
    candidates = [
        next(c for c in cause.candidates(scene) if c.target in (None, "technician T-2"))
        for cause in CATALOGUE
        if cause.name in ("technician_bias", "side_difference", "thermal_growth")
    ]
    columns = effect_columns(scene, candidates)
    misfit, bank = table.measured_in - scene.over_in, build_bank(scene, columns)
    whole = Inference(misfit, rows, candidates, columns, bank, 199, np.random.default_rng(1))
    fewer = _Together(whole, (0, 1, 2), (0.0, 0.0, 0.0), SECOND_SHARE).without_idle()
    assert fewer is not None
    assert [candidates[k].cause.name for k in (0, 1, 2) if k not in fewer.chosen] == [
        "thermal_growth"
    ]


def sure(
    monkeypatch: pytest.MonkeyPatch,
    beside: dict[int, tuple[int, list[int]]] | None = None,
    chances: tuple[float, float] = (1e-6, 1e-6),
) -> tuple[int, ...]:
    """What is sure of the causes 0 and 1, of which 2 could stand in the place of 1; `beside` says
    what explains most in the place of 0 beside each of them, and its rivals.
    """
    told = beside or {1: (0, []), 2: (0, [])}
    whole = SimpleNamespace(
        candidates=[SimpleNamespace(key=k) for k in range(4)],
        rivals=lambda _k, others, **_: (*told[others[0]], {}),
    )
    monkeypatch.setattr(inference, "_Together", lambda *_: SimpleNamespace(chances=lambda: chances))
    return inference.Inference._sure(cast(Any, whole), (0, 1), ([], [2]))


def test_a_cause_without_rivals_is_sure_whatever_stands_beside_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert sure(monkeypatch) == (0,)


def test_a_cause_that_has_a_rival_beside_another_of_the_set_is_not_sure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert sure(monkeypatch, {1: (0, []), 2: (0, [3])}) == ()


def test_a_cause_that_another_beats_beside_another_of_the_set_is_not_sure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert sure(monkeypatch, {1: (0, []), 2: (3, [])}) == ()


def test_a_cause_that_stands_out_beside_the_others_no_more_than_by_chance_is_not_sure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert sure(monkeypatch, chances=(0.01, 1e-6)) == ()
