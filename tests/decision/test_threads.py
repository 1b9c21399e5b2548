"""How many threads a judgement uses."""

from __future__ import annotations

from typing import Any

from threadpoolctl import threadpool_info

from mlg_troubleshoot.decision import judge_rows
from tests.decision.conftest import inspected


def test_matrix_products_of_a_judgement_wait_for_no_other_threads(gear, table, monkeypatch):
    seen: list[int] = []
    judge = judge_rows._assess_valid

    def watched(*given: Any) -> Any:
        seen.extend(of["num_threads"] for of in threadpool_info() if of["user_api"] == "blas")
        return judge(*given)

    monkeypatch.setattr(judge_rows, "_assess_valid", watched)
    judge_rows.assess([inspected({3: 0.013})], gear, table)
    assert set(seen) == {1}
