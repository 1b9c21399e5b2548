"""Batches on several cores and on a Dask cluster: what is found stays the same."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from threadpoolctl import threadpool_info

from mlg_troubleshoot.decision import judge_rows
from mlg_troubleshoot.decision.assessment import Judgement
from mlg_troubleshoot.parallel import map_blocks
from mlg_troubleshoot.workers import WorkerProcesses
from mlg_troubleshoot.workflows import check as task
from mlg_troubleshoot.workflows.check import BlockOutput, CheckOptions, check_files
from tests.cli.conftest import mlg
from tests.decision.conftest import inspected

ROOT = Path(__file__).parents[2]
BATCH = ROOT / "inspection_data" / "fleet_batch.csv"
PAGE = ROOT / "docs" / "how-to" / "cluster.md"


def places_of(judgements: Sequence[Judgement]) -> list[int | None]:
    return [judgement.row.source.row for judgement in judgements]


def process_and_rows(judgements: Sequence[Judgement]) -> tuple[int, int]:
    return os.getpid(), len(judgements)


@dataclass
class Told:
    """What a check of two blocks on two workers told while it ran."""

    rows: list[int | None] = field(default_factory=list)
    made: list[tuple[int, int]] = field(default_factory=list)
    judgements: list[Judgement] = field(default_factory=list)
    counts: list[tuple[int, int]] = field(default_factory=list)
    asked: list[int] = field(default_factory=list)


@pytest.fixture(scope="module")
def told() -> Told:
    told = Told()

    def outputs(_read: object, total: int) -> list[BlockOutput]:
        told.asked.append(total)
        return [
            BlockOutput(places_of, told.rows.extend),
            BlockOutput(process_and_rows, told.made.append),
            BlockOutput(list, told.judgements.extend, sets=True),
        ]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(task, "AT_ONCE", 40)
        found = check_files(
            [BATCH],
            CheckOptions(workers=2),
            on_judged=lambda done, total: told.counts.append((done, total)),
            outputs=outputs,
        )
    assert found.judgements == ()
    return told


def test_what_is_found_does_not_depend_on_the_number_of_workers(told: Told) -> None:
    alone = check_files([BATCH], CheckOptions())
    assert task.json_lines(told.judgements) == task.json_lines(alone.judgements)


def test_the_json_of_the_command_is_that_of_python() -> None:
    alone = check_files([BATCH], CheckOptions()).to_dict()
    assert mlg("check", BATCH, "--json").json["inspections"] == alone["inspections"]


def test_any_executor_finds_the_same(told: Told, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(task, "AT_ONCE", 20)
    with ThreadPoolExecutor(2) as executor:
        found = check_files([BATCH], CheckOptions(executor=executor))
    assert task.json_lines(found.judgements) == task.json_lines(told.judgements)


def test_progress_counts_rows_whoever_judges_them(told: Told) -> None:
    assert told.counts == [(40, 46), (46, 46)]


def test_outputs_are_asked_for_once_and_receive_the_rows_in_their_order(told: Told) -> None:
    assert (told.asked, told.rows) == ([46], list(range(2, 48)))


def test_what_is_written_of_a_block_is_made_where_it_is_judged(told: Told) -> None:
    assert [count for _process, count in told.made] == [40, 6]
    assert os.getpid() not in dict(told.made)


def slower_the_earlier(block: int) -> int:
    time.sleep(0.1 * (3 - block))
    return block


def test_results_come_in_the_order_of_the_blocks_whoever_is_first() -> None:
    with ThreadPoolExecutor(4) as executor:
        assert list(map_blocks(slower_the_earlier, range(4), executor)) == [0, 1, 2, 3]


def test_blocks_are_taken_as_the_executor_needs_them() -> None:
    taken: list[int] = []
    blocks = (taken.append(block) or block for block in range(100))
    with ThreadPoolExecutor(2) as executor:
        next(map_blocks(abs, map(len, map(str, blocks)), executor))
    assert len(taken) < 40


def inverse(block: int) -> int:
    return 1 // block


def test_an_error_in_a_block_reaches_the_caller() -> None:
    with WorkerProcesses(1) as executor, pytest.raises(ZeroDivisionError):
        list(map_blocks(inverse, [0, 1], executor))


def wait_long(block: int) -> int:
    time.sleep(60 * block)
    return block


def test_an_interruption_ends_what_is_being_computed() -> None:
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt), WorkerProcesses(1) as executor:
        for _ in map_blocks(wait_long, [0, *[1] * 40], executor):
            raise KeyboardInterrupt
    assert time.monotonic() - start < 30


_KILLED = """
import os, sys, time
from mlg_troubleshoot.workers import WorkerProcesses

def at_work(_block):
    print(os.getpid(), flush=True)
    time.sleep(60)

if __name__ == "__main__":
    pool = WorkerProcesses(2)
    pool.submit(at_work, 0), pool.submit(at_work, 1)
    time.sleep(60)
"""


def test_workers_end_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    script = tmp_path / "killed.py"
    script.write_text(_KILLED, encoding="utf-8")
    command = [sys.executable, str(script)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        workers = {int(parent.stdout.readline()) for _ in range(2)}
        parent.kill()
        # The pipe ends when no process holds it any more: no worker, nor what they started.
        rest, _ = parent.communicate(timeout=30)
    assert (len(workers), rest) == (2, "")


@pytest.fixture
def cluster() -> Iterator[str]:
    """The address of a Dask scheduler with two processes."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as local:
        yield local.scheduler_address


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_the_page_on_clusters_finds_the_same_on_two_dask_workers(cluster, tmp_path, monkeypatch):
    header, *rows = BATCH.read_text(encoding="utf-8").splitlines()
    table = tmp_path / "inspections.csv"
    table.write_text("\n".join([header, *(f"{k}{row}" for k in range(12) for row in rows)]))
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(code.replace("tcp://host:8786", cluster), names)
    found = names["result"]
    alone = check_files([table.name])
    assert len(found.judgements) == 552
    assert task.json_lines(found.judgements) == task.json_lines(alone.judgements)


def test_matrix_products_of_a_judgement_wait_for_no_other_threads(gear, table, monkeypatch):
    seen: list[int] = []
    judge = judge_rows._assess_valid

    def watched(*given: Any, **more: Any) -> Any:
        seen.extend(of["num_threads"] for of in threadpool_info() if of["user_api"] == "blas")
        return judge(*given, **more)

    monkeypatch.setattr(judge_rows, "_assess_valid", watched)
    judge_rows.assess([inspected({3: 0.013})], gear, table)
    assert set(seen) == {1}
