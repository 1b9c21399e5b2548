"""What the report of a study must say, read from the HTML."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.paper.statements import check_statements
from mlg_troubleshoot.paper.study import (
    Directions,
    StudyFindings,
    StudyOptions,
    compare_designs,
    run_study,
)
from mlg_troubleshoot.reporting.provenance import ReportProvenance
from mlg_troubleshoot.reporting.publish import publish
from mlg_troubleshoot.reporting.study_report import study_document

from .conftest import readable


@pytest.fixture(scope="module")
def findings(gear: Gear) -> StudyFindings:
    """A study with small designs."""
    options = StudyOptions(seed=5, n1=20, n2=100, iterations=2)
    return StudyFindings(
        gear,
        options,
        run_study(gear, options),
        compare_designs(gear, options),
        check_statements(gear),
    )


@pytest.fixture(scope="module")
def report(
    findings: StudyFindings, provenance: ReportProvenance, tmp_path_factory: pytest.TempPathFactory
) -> str:
    """Its report, as a reader of the HTML reads it."""
    return written(findings, provenance, tmp_path_factory)


def written(
    findings: StudyFindings, provenance: ReportProvenance, folders: pytest.TempPathFactory
) -> str:
    made = publish(study_document(findings, provenance), folders.mktemp("study"), formats=("html",))
    assert made.html is not None
    return (
        readable(made.html.read_text(encoding="utf-8")).replace("\u00a0", " ").replace("\u200b", "")
    )


@pytest.mark.parametrize("figure", ["12", "13a", "13b", "13c"])
def test_every_figure_of_the_paper_has_its_counterpart(figure: str, report: str) -> None:
    assert f"Counterpart of Fig. {figure} " in report


def test_every_joint_has_its_indices(findings: StudyFindings, report: str) -> None:
    for joint, entry in zip(findings.gear.joints, findings.result.table.joints, strict=True):
        assert re.search(
            rf"{re.escape(joint.label)} {entry.first_order:.4f} .*?{entry.total_order:.4f}", report
        )


def test_every_statement_has_a_paragraph_with_its_numbers(
    findings: StudyFindings, report: str
) -> None:
    assert len(findings.statements) == 10
    for statement in findings.statements:
        assert f"4.3 {statement.claim} " in report
        assert f"{statement.claim} ({statement.outcome})" in report
        assert statement.numbers in report


def test_the_front_counts_the_statements_that_hold(report: str) -> None:
    assert "7 of 10 hold 2 only in part or under a reading, 1 not at all." in report


def test_the_reason_for_the_locking_pin_stands_beside_the_methods(report: str) -> None:
    assert "Its stage index is 1.488 at Down Lock, but 1.313 at mid-position" in report
    assert "Section 4.3 supposes that minute curves treated as lines are the reason." in report


def test_the_bias_of_the_papers_designs_is_said(report: str) -> None:
    assert "A plain index exceeds the true one by (1 − S)/n1" in report


@pytest.mark.parametrize(
    "words", ["not drawing data", "seed 5", "10 geometries, sha256 ", "Geometry sha256 "]
)
def test_the_report_says_where_it_comes_from(words: str, report: str) -> None:
    assert words in report


def test_an_interrupted_study_says_so(
    findings: StudyFindings, provenance: ReportProvenance, tmp_path_factory: pytest.TempPathFactory
) -> None:
    half = StudyFindings(findings.gear, findings.options, replace(findings.result, finished=False))
    assert "The study was interrupted" in written(half, provenance, tmp_path_factory)


def test_random_directions_have_no_design_of_the_paper(gear: Gear) -> None:
    assert compare_designs(gear, StudyOptions(directions=Directions.RANDOM)) == ()


def test_failed_samples_are_counted_in_the_report(
    gear: Gear, provenance: ReportProvenance, tmp_path_factory: pytest.TempPathFactory
) -> None:
    options = StudyOptions(limits_in=np.full(10, 0.06), n1=4, n2=20, iterations=1)
    failed = StudyFindings(gear, options, run_study(gear, options), compare_designs(gear, options))
    assert "They are counted, not dropped" in written(failed, provenance, tmp_path_factory)
