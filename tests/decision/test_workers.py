"""Batches on several cores and on a Dask cluster: what is found stays the same."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from mlg_troubleshoot.decision import judge_rows
from mlg_troubleshoot.parallel import spread
from mlg_troubleshoot.reporting.json_form import check_json_pieces
from mlg_troubleshoot.workflows.check import CheckOptions, check_files

BATCH = Path(__file__).parents[2] / "inspection_data" / "fleet_batch.csv"


@pytest.fixture
def many_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """The 46 rows of the batch are judged as a long file is: in three parts."""
    monkeypatch.setattr(judge_rows, "_CHUNK", 20)


def written(options: CheckOptions) -> str:
    found = check_files([BATCH], options)
    said = (found.gear, found.judgements, found.problems, found.notes, found.seed)
    return "".join(map(str, check_json_pieces(*said)))


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


def test_parts_are_computed_by_other_processes() -> None:
    assert os.getpid() not in dict(spread(process_of, range(4), workers=2)).values()


def test_a_single_part_is_computed_here() -> None:
    assert dict(spread(process_of, [0], workers=2)) == {0: os.getpid()}


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
