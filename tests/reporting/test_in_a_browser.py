"""The HTML in Chromium: as many printed pages as the PDF, and no accessibility violation that axe
can find.
"""

from __future__ import annotations

import io
import json
import re
import shutil
import subprocess
from collections.abc import Callable
from html import unescape
from pathlib import Path

import pypdf
import pytest

from mlg_troubleshoot.decision.assessment import Rejected
from mlg_troubleshoot.gear.gear import Gear
from tests.cli.conftest import mlg
from tests.store.test_history_commands import keep, visit

from .conftest import FAILURE, SOUND, WORN, Judge, Made, write_reports

pytestmark = pytest.mark.slow

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
)
AXE = """
<script>{axe}</script>
<script>
axe.run(document, {{resultTypes: ["violations"]}}).then(result => {{
  const found = result.violations.map(v => [v.id, v.help, v.nodes.map(n => n.html)]);
  const out = document.createElement("pre");
  out.id = "axe-result";
  out.textContent = JSON.stringify({{violations: found, passes: result.passes.length}});
  document.body.append(out);
}});
</script>
</body>"""


def chromium(profile: Path, *arguments: str) -> str:
    program = (
        shutil.which("chromium")
        or shutil.which("chromium-browser")
        or shutil.which("google-chrome")
    )
    assert program, "install the Debian package chromium"
    run = [program, *FLAGS, f"--user-data-dir={profile / 'profile'}", *arguments]
    return subprocess.run(run, capture_output=True, text=True, timeout=120, check=True).stdout


def axe_core() -> str:
    npm = shutil.which("npm")
    assert npm, "install the Debian package npm"
    root = subprocess.run(
        [npm, "root", "-g"], capture_output=True, text=True, check=True
    ).stdout.strip()
    script = Path(root, "axe-core", "axe.min.js")
    assert script.is_file(), "install axe-core: npm install -g axe-core"
    return script.read_text(encoding="utf-8")


def violations(html: str, folder: Path, width: int = 1200) -> list[list[object]]:
    """What axe finds in a document, whose own policy would not let axe run."""
    opened = re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", html)
    assert opened != html
    page = folder / "page.html"
    page.write_text(opened.replace("</body>", AXE.format(axe=axe_core())), encoding="utf-8")
    size = f"--window-size={width},900"
    dumped = chromium(folder, size, "--virtual-time-budget=20000", "--dump-dom", page.as_uri())
    found = re.search(r'<pre id="axe-result">(.*?)</pre>', dumped, re.DOTALL)
    assert found, "axe gave no result"
    result = json.loads(unescape(found[1]))
    assert result["passes"] > 10
    return list(result["violations"])


def pages(pdf: bytes) -> int:
    return len(pypdf.PdfReader(io.BytesIO(pdf)).pages)


@pytest.mark.parametrize("page", ["A4", "Letter"])
@pytest.mark.parametrize(
    "clearance", [FAILURE, WORN, SOUND, {1: 0.001}], ids=["failure", "worn", "sound", "incomplete"]
)
def test_chromium_prints_the_html_on_as_many_pages_as_the_pdf_has(
    clearance: dict[int, float], page: str, judge: Judge, make: Callable[..., Made], tmp_path: Path
) -> None:
    made = make(judge(clearance), page=page)
    (source,) = made.folder.glob("*.html")
    printed = tmp_path / "printed.pdf"
    chromium(tmp_path, "--no-pdf-header-footer", f"--print-to-pdf={printed}", source.as_uri())
    assert pages(printed.read_bytes()) == pages(made.pdf)


@pytest.mark.parametrize("width", [1200, 500])
def test_axe_finds_nothing_in_a_report(width: int, worn: Made, tmp_path: Path) -> None:
    assert violations(worn.html, tmp_path, width) == []


def test_axe_finds_nothing_in_the_report_of_an_invalid_row(
    rejected: Rejected, make: Callable[..., Made], tmp_path: Path
) -> None:
    assert violations(make(rejected, formats=("html",)).html, tmp_path) == []


def test_axe_finds_nothing_in_a_batch_summary(
    judge: Judge, rejected: Rejected, gear: Gear, tmp_path: Path
) -> None:
    written = write_reports([judge(FAILURE), rejected], gear, tmp_path)
    assert written[0].html is not None
    assert violations(written[0].html.read_text(encoding="utf-8"), tmp_path) == []


def test_axe_would_find_a_missing_language(worn: Made, tmp_path: Path) -> None:
    spoiled = worn.html.replace('lang="en"', "", 1)
    assert [found[0] for found in violations(spoiled, tmp_path)] == ["html-has-lang"]


def test_axe_finds_nothing_in_the_pages_of_a_fleet_and_of_a_life(tmp_path: Path) -> None:
    store = ("--store", tmp_path / "store.sqlite", "-q", "--no-forecast")
    rows = [visit(n, 0.0010 + 0.0004 * n) for n in range(3)]
    keep(tmp_path, *rows, more=("--store", str(tmp_path / "store.sqlite")))
    mlg("fleet", *store, "--report", tmp_path / "out")
    for file in (tmp_path / "out").glob("*.html"):
        assert violations(file.read_text(encoding="utf-8"), tmp_path) == []
