"""Batches on several cores and on a Dask cluster: what is found stays the same."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from mlg_troubleshoot.decision.assessment import Judgement
from mlg_troubleshoot.parallel import Blocks, Processes, spread
from mlg_troubleshoot.reporting.json_form import inspection_lines
from mlg_troubleshoot.workflows import check as task
from mlg_troubleshoot.workflows.check import BlockOutput, CheckOptions, check_files

BATCH = Path(__file__).parents[2] / "inspection_data" / "fleet_batch.csv"


@pytest.fixture
def many_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """The 46 rows of the batch are judged as a long file is: in three parts."""
    monkeypatch.setattr(task, "AT_ONCE", 20)


def written(options: CheckOptions) -> str:
    found = check_files([BATCH], options)
    return inspection_lines(found.gear, found.judgements)


def places_of(judgements: Sequence[Judgement]) -> list[int | None]:
    return [judgement.row.source.row for judgement in judgements]


def process_and_rows(judgements: Sequence[Judgement]) -> tuple[int, int]:
    return os.getpid(), len(judgements)


def process_of(_part: int) -> int:
    return os.getpid()


def a_failure(part: int) -> int:
    return 1 // part


@pytest.mark.usefixtures("many_parts")
def test_what_is_found_does_not_depend_on_the_number_of_workers() -> None:
    assert written(CheckOptions(workers=2)) == written(CheckOptions())


@pytest.mark.usefixtures("many_parts")
def test_progress_counts_rows_whoever_judges_them() -> None:
    said: list[tuple[int, int]] = []
    options = CheckOptions(workers=2)
    check_files([BATCH], options, on_judged=lambda done, total: said.append((done, total)))
    assert len(said) == 3
    assert sorted(said)[-1] == (46, 46)


@pytest.mark.usefixtures("many_parts")
def test_outputs_receive_the_rows_in_their_order_and_the_result_holds_none() -> None:
    rows: list[int | None] = []
    found = check_files(
        [BATCH], CheckOptions(workers=2), outputs=lambda *_: [BlockOutput(places_of, rows.extend)]
    )
    assert rows == list(range(2, 48))
    assert found.judgements == ()


@pytest.mark.usefixtures("many_parts")
def test_what_is_written_of_a_block_is_made_where_it_is_judged() -> None:
    made: list[tuple[int, int]] = []
    check_files(
        [BATCH],
        CheckOptions(workers=2),
        outputs=lambda *_: [BlockOutput(process_and_rows, made.append)],
    )
    assert [count for _process, count in made] == [20, 20, 6]
    assert os.getpid() not in dict(made)


def test_processes_start_while_a_long_table_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    header, *rows = BATCH.read_text(encoding="utf-8").splitlines()
    long = tmp_path / "long.csv"
    long.write_text("\n".join([header, *(rows * 14)]), encoding="utf-8")
    started: list[int] = []
    monkeypatch.setattr(Processes, "start", lambda _self, count, _module: started.append(count))
    check_files([long], CheckOptions(workers=2), on_judged=lambda *_: started.append(0))
    assert started == [2, 0, 0]


@pytest.mark.usefixtures("many_parts")
def test_outputs_are_asked_for_once_with_the_number_of_rows() -> None:
    asked: list[int] = []
    check_files([BATCH], outputs=lambda _read, total: (asked.append(total), ())[1])
    assert asked == [46]


def slower_the_earlier(part: int) -> int:
    time.sleep(0.1 * (3 - part))
    return part


def test_results_come_in_the_order_of_the_parts_whoever_is_first() -> None:
    assert list(spread(slower_the_earlier, range(4), workers=4)) == [0, 1, 2, 3]


def test_a_list_in_blocks_gives_its_items_again_each_time() -> None:
    blocks = Blocks[int]()
    blocks.extend([1, 2])
    blocks.extend([3])
    assert (list(blocks), list(blocks), len(blocks)) == ([1, 2, 3], [1, 2, 3], 3)


def test_no_more_parts_are_taken_than_the_processes_can_soon_compute() -> None:
    taken: list[int] = []
    parts = (taken.append(part) or part for part in range(40))
    found = spread(process_of, parts, workers=2)
    next(found)
    assert len(taken) <= 6


def test_parts_are_computed_by_other_processes() -> None:
    assert os.getpid() not in set(spread(process_of, range(4), workers=2))


def test_a_single_part_is_computed_here() -> None:
    assert list(spread(process_of, [0], workers=2)) == [os.getpid()]


def test_an_error_of_a_part_reaches_the_caller() -> None:
    with pytest.raises(ZeroDivisionError):
        list(spread(a_failure, [0, 1], workers=2))


@pytest.fixture
def cluster() -> Iterator[object]:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as local,
        distributed.Client(local.scheduler_address) as client,
    ):
        yield client


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.usefixtures("many_parts")
def test_a_dask_cluster_of_two_processes_finds_the_same(cluster: object) -> None:
    alone = CheckOptions()
    assert written(replace(alone, scheduler=cluster)) == written(alone)
