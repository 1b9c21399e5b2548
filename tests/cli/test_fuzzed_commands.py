"""Damaged and hostile files, stores and places of every kind end as documented and change nothing
else.
"""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

from tests.cli.conftest import ROOT
from tests.machine import SLOWER

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="needs processes, pipes and limits of POSIX"
)


def fuzzed(cases: int, seed: int) -> str:
    """Run so many cases in a process of their own, which holds no thread of this one; what it
    counted.
    """
    arguments = ("--cases", str(cases), "--seed", str(seed), "--slower", str(SLOWER))
    done = subprocess.run(
        [sys.executable, "-m", "tests.fuzz_commands", *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_few_cases_of_every_kind_end_as_documented_and_change_nothing_else() -> None:
    fuzzed(30, seed=1)


@pytest.mark.slow
def test_no_case_ends_in_an_internal_error_late_large_or_with_another_file_changed() -> None:
    counted = fuzzed(1200, seed=2)
    reached = set(re.findall(r"^(\w+) +exit [01]:", counted, re.MULTILINE))
    assert reached >= {
        *("table", "gear", "beside", "extension", "draft", "headers", "store", "import", "outputs")
    }
