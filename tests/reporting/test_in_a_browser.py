"""The HTML in Chromium: as many printed pages as the PDF, and no accessibility violation that axe
can find.
"""

from __future__ import annotations

import io
import json
import re
import shutil
import subprocess
from html import unescape
from pathlib import Path

import pypdf
import pytest

from tests.cli.conftest import FLEET, mlg
from tests.store.places import table
from tests.store.test_history_commands import keep, visit

from .conftest import FAILURE, SOUND, WORN, Made, write_reports

pytestmark = pytest.mark.slow

FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
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

# Shows a document in a frame of a given width and compares the boxes of its texts, and of the
# shapes that are drawn over a text.
BOXES = """<!doctype html><meta charset="utf-8">
<iframe id="frame" style="border: 0; width: {width}px; height: 30000px"></iframe>
<script>
const frame = document.getElementById("frame");
frame.onload = () => {{
  const page = frame.contentDocument;
  const boxes = [];
  const add = (node, element, rectangles) => {{
    const clip = element.closest(".scroll")?.getBoundingClientRect();
    for (const each of rectangles) {{
      const left = Math.max(each.left, clip?.left ?? 0);
      const right = Math.min(each.right, clip?.right ?? Infinity);
      if (right > left) boxes.push([node, left, each.top, right, each.bottom]);
    }}
  }};
  const texts = page.createTreeWalker(page.body, NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {{
    const node = texts.currentNode;
    if (!node.data.trim() || !node.parentElement.checkVisibility()) continue;
    const range = page.createRange();
    range.selectNodeContents(node);
    add(node, node.parentElement, range.getClientRects());
  }}
  const count = boxes.length;
  for (const shape of page.querySelectorAll("svg circle, svg rect"))
    if (frame.contentWindow.getComputedStyle(shape).fill !== "none")
      add(shape, shape, [shape.getBoundingClientRect()]);
  const found = [];
  boxes.slice(0, count).forEach(([a, left, top, right, bottom], place) => {{
    for (const [b, left2, top2, right2, bottom2] of boxes.slice(place + 1)) {{
      const wide = Math.min(right, right2) - Math.max(left, left2);
      const high = Math.min(bottom, bottom2) - Math.max(top, top2);
      const drawnOver = b.nodeType === 3 || a.compareDocumentPosition(b) & 4;
      if (a !== b && drawnOver && wide > 1 && high > 0.3 * Math.min(bottom - top, bottom2 - top2))
        found.push([a.data, b.data ?? b.outerHTML]);
    }}
  }});
  const out = document.createElement("pre");
  out.id = "result";
  const states = [...page.querySelectorAll(".ranked .state")];
  const cut = states.filter(each => each.getBoundingClientRect().right > {width}).length;
  out.textContent = JSON.stringify({{found, count, cut, wide: page.documentElement.scrollWidth}});
  document.body.append(out);
}};
frame.srcdoc = {document};
</script>"""


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
    clearance, page, judge, make, tmp_path
):
    made = make(judge(clearance), page=page)
    (source,) = made.folder.glob("*.html")
    printed = tmp_path / "printed.pdf"
    chromium(tmp_path, "--no-pdf-header-footer", f"--print-to-pdf={printed}", source.as_uri())
    assert pages(printed.read_bytes()) == pages(made.pdf)


@pytest.mark.parametrize("width", [1200, 500])
def test_axe_finds_nothing_in_a_report(width: int, worn: Made, tmp_path: Path) -> None:
    assert violations(worn.html, tmp_path, width) == []


def test_axe_finds_nothing_in_the_report_of_an_invalid_row(rejected, make, tmp_path):
    assert violations(make(rejected, formats=("html",)).html, tmp_path) == []


def test_axe_finds_nothing_in_a_batch_summary(judge, rejected, gear, tmp_path):
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


def overlaps(html: str, folder: Path, width: int) -> list[list[str]]:
    """Texts that lie over one another, or under a shape, at a width of the window."""
    page = folder / "boxes.html"
    document = json.dumps(html).replace("</", "<\\/")
    page.write_text(BOXES.format(width=width, document=document), encoding="utf-8")
    dumped = chromium(folder, "--virtual-time-budget=20000", "--dump-dom", page.as_uri())
    result = json.loads(unescape(re.findall(r'<pre id="result">(.*?)</pre>', dumped, re.DOTALL)[0]))
    assert result["count"] > 20
    assert result["wide"] <= width
    # Whether a joint is over its limit is seen without scrolling.
    assert result["cut"] == 0
    return list(result["found"])


@pytest.fixture(scope="module")
def documents(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """A report with earlier inspections, a batch summary, a fleet page and the page of a life."""
    folder = tmp_path_factory.mktemp("documents")
    store = ("--store", str(folder / "store.sqlite"))
    earlier = [visit(n, 0.0010 + 0.0012 * n, tail="N123AB") for n in range(12)]
    keep(folder, *earlier, more=store)
    worn = {f"clearance_{n}_in": "0.009" for n in (2, 4, 5)}
    last = table(folder, visit(12, 0.013, tail="N123AB") | worn)
    out = ("--report", folder / "out", "--format", "html")
    mlg("check", last, *store, "--keep", *out)
    mlg("check", FLEET, *out)
    mlg("fleet", *store, "--report", folder / "out")
    named = [*(folder / "out").glob("mlg-N123AB*"), *(folder / "out").glob("*batch*")]
    named += [folder / "out" / "fleet.html", *(folder / "out").glob("mlg-life*")]
    return [file.read_text(encoding="utf-8") for file in named if file.suffix == ".html"]


@pytest.mark.parametrize("width", [390, 1000, 1600])
@pytest.mark.parametrize("place", range(4), ids=["report", "batch", "fleet", "life"])
def test_no_text_lies_over_another(place, width, documents, tmp_path):
    assert len(documents) == 4
    assert overlaps(documents[place], tmp_path, width) == []


@pytest.mark.parametrize(
    ("end", "cover"),
    [
        ("</h1>", '</h1><p style="margin-top: -1rem">covers</p>'),
        ("</text></svg>", '</text><rect width="900" height="900" fill="#123"></rect></svg>'),
    ],
    ids=["text", "shape"],
)
def test_what_covers_a_text_would_be_found(end, cover, worn, tmp_path):
    assert end in worn.html
    assert overlaps(worn.html.replace(end, cover, 1), tmp_path, 1000)
