"""The paper's total-order study in blocks, Fig. 5b."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.inputs import HeldDirections, Inputs
from mlg_troubleshoot.indices.tensor import TensorIndices
from mlg_troubleshoot.paper.blocks import BlockStudy, compute_block, total_order_study


@pytest.fixture
def study(gear: Gear, response: HeldDirections) -> BlockStudy:
    return BlockStudy(response, Inputs(gear.limits_in), gear.geometry_sha256, 5, 8, 120, 2)


def test_the_papers_study_has_a_thousand_million_solutions(
    gear: Gear, response: HeldDirections
) -> None:
    paper = BlockStudy(response, Inputs(gear.limits_in), gear.geometry_sha256, 0)
    assert paper.evaluations == 10 * 100 * 1000 * (100 * 10 + 1)


def test_total_order_indices_are_the_exact_ones(
    gear: Gear, response: HeldDirections, exact: TensorIndices
) -> None:
    study = BlockStudy(response, Inputs(gear.limits_in), gear.geometry_sha256, 0, 20, 300, 3)
    found = total_order_study(study)
    assert found.total_order == pytest.approx(exact.total_order, abs=0.01)
    assert found.evaluations == study.evaluations


def test_an_interrupted_study_resumes_to_the_same_bits(study: BlockStudy, tmp_path: Path) -> None:
    def stop(done: int, _total: int) -> None:
        if done == 4:
            raise KeyboardInterrupt

    state = tmp_path / "state.jsonl"
    part = total_order_study(study, state=state, progress=stop)
    assert (len(state.read_text().splitlines()), part.iterations) == (1 + 4, 1)
    assert np.all(np.isfinite(part.total_order))
    resumed = total_order_study(study, state=state)
    whole = total_order_study(study)
    assert np.array_equal(resumed.total_order, whole.total_order)
    assert resumed.evaluations == whole.evaluations == study.evaluations


def test_a_resumed_study_does_not_compute_finished_blocks_again(
    study: BlockStudy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = tmp_path / "state.jsonl"
    total_order_study(study, state=state)
    monkeypatch.setattr(
        "mlg_troubleshoot.paper.blocks.compute_block", lambda *_: pytest.fail("computed again")
    )
    assert total_order_study(study, state=state).iterations == study.iterations


def test_a_line_cut_off_by_an_interruption_costs_its_block_only(
    study: BlockStudy, tmp_path: Path
) -> None:
    state = tmp_path / "state.jsonl"
    whole = total_order_study(study, state=state)
    state.write_text(state.read_text()[:-40])
    again = total_order_study(study, state=state)
    assert np.array_equal(again.total_order, whole.total_order)
    assert len(state.read_text().splitlines()) == 1 + len(study.blocks)


def test_a_state_file_of_another_study_is_refused(
    gear: Gear, response: HeldDirections, study: BlockStudy, tmp_path: Path
) -> None:
    state = tmp_path / "state.jsonl"
    total_order_study(study, state=state)
    other = BlockStudy(response, Inputs(gear.limits_in), gear.geometry_sha256, 6, 8, 120, 2)
    with pytest.raises(UsageError, match="another study"):
        total_order_study(other, state=state)


def test_two_workers_give_the_same_bits_as_one(study: BlockStudy) -> None:
    assert np.array_equal(
        total_order_study(study, workers=2).total_order, total_order_study(study).total_order
    )


def test_solutions_that_do_not_close_are_counted(gear: Gear, response: HeldDirections) -> None:
    wide = Inputs(np.full(10, 0.08))
    found = total_order_study(BlockStudy(response, wide, gear.geometry_sha256, 0, 10, 60, 1))
    assert found.failed > 0
    assert np.any(np.isnan(found.total_order))
    assert "do not close" in found.note


def test_a_block_depends_on_nothing_but_its_study_and_number(study: BlockStudy) -> None:
    assert compute_block(study, study.blocks[1]) == compute_block(study, study.blocks[1])
    assert compute_block(study, study.blocks[1]) != compute_block(study, study.blocks[0])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_dask_cluster_of_two_processes_gives_the_same_bits(study: BlockStudy) -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster.scheduler_address) as client,
    ):
        assert len(client.scheduler_info()["workers"]) == 2
        found = total_order_study(study, scheduler=client)
    assert np.array_equal(found.total_order, total_order_study(study).total_order)


@pytest.mark.parametrize("line", ["nonsense\n", "[]\n", "[[0, 0], [1]]\n", '{"block": 1}\n'])
def test_a_damaged_state_file_is_refused_and_not_an_error_of_the_program(
    study: BlockStudy, tmp_path: Path, line: str
) -> None:
    state = tmp_path / "state.jsonl"
    small = replace(study, n2=2, iterations=1)
    total_order_study(small, state=state)
    state.write_text(state.read_text() + line)
    with pytest.raises(UsageError, match="damaged"):
        total_order_study(small, state=state)
