"""Inspections made by hand, and their judgement."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mlg_troubleshoot.decision.assessment import Assessment
from mlg_troubleshoot.decision.belief import Inference, explain
from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.decision.judge_rows import assess
from mlg_troubleshoot.decision.prediction import Cases, Extension
from mlg_troubleshoot.gear.gear import Adjustment, Gear
from mlg_troubleshoot.indices.index_table import IndexTable
from mlg_troubleshoot.units import ClearanceConvention

Judge = Callable[..., Assessment]


def belief_of(cases: Cases) -> SimpleNamespace:
    """What is believed of the first gear."""
    found = Inference(cases, [0])
    return SimpleNamespace(
        chances=tuple(found.chances[0].tolist()),
        held=float(found.held[0]),
        worn=found.worn[0],
        second_repair=partial(found.second_repair, 0),
        explained=explain(found, 0),
    )


def inspected(clearance_in: Mapping[int, float], **more: Any) -> Inspection:
    """An inspection with these radial clearances."""
    values: dict[str, Any] = {
        "record_id": "R1",
        "tail_no": "258401",
        "side": Side.LH,
        "convention": ClearanceConvention.RADIAL,
        "clearance_in": clearance_in,
        "gauge_u_is_default": False,
    }
    return Inspection(**{**values, **more})


def every_joint(clearance_in: float, **others: float) -> dict[int, float]:
    """All ten joints at one clearance, some at another: ``every_joint(0.001, j3=0.013)``."""
    return dict.fromkeys(range(1, 11), clearance_in) | {
        int(name[1:]): value for name, value in others.items()
    }


@dataclass(frozen=True)
class Shifted:
    """An extension that shifts the plunger, whose residuals scatter by 1 thou and which needs the
    gauge.
    """

    shift_in: float = 0.004
    residual_u_in: float = 0.001
    approval: str = ""

    def adjust(self, inspections: Sequence[Inspection], clearance_in: np.ndarray) -> Adjustment:
        return Adjustment(clearance_in, offset_in=np.full(len(inspections), self.shift_in))

    def lacks(self, inspection: Inspection) -> tuple[str, ...]:
        return () if inspection.gauge_id else ("gauge_id",)

    def describe(self) -> str:
        return f"plunger shifted by {self.shift_in:g} in"


@pytest.fixture(scope="session")
def judge(gear: Gear, table: IndexTable) -> Judge:
    """Judge one inspection of the shipped gear; the same inspection is judged once, for judgements
    cannot change.
    """
    judged: dict[Any, Assessment] = {}

    def judge_one(
        clearance_in: Mapping[int, float],
        *,
        advice: bool = False,
        extension: Extension | None = None,
        **more: Any,
    ) -> Assessment:
        key = (frozenset(clearance_in.items()), advice, extension, frozenset(more.items()))
        if key not in judged:
            row = inspected(clearance_in, **more)
            (found,) = assess([row], gear, table, advice=advice, extension=extension)
            assert isinstance(found, Assessment)
            judged[key] = found
        return judged[key]

    return judge_one
