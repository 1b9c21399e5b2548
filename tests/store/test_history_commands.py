"""``mlg check --keep``, ``mlg history …`` and ``mlg fleet``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import date, timedelta
from pathlib import Path

import pypdf
import pytest

from mlg_troubleshoot.decision.inspection import EnteredClearance, Inspection, Side
from mlg_troubleshoot.life.folding import life_of
from mlg_troubleshoot.reporting.html import environment
from mlg_troubleshoot.store import Store, inspection_record
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit
from tests.cli.conftest import Run, mlg, row
from tests.gear.own import own_gear

from .places import table

RADIAL = ClearanceConvention.RADIAL


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("MLG_STORE", str(tmp_path / "store.sqlite"))
    return tmp_path / "store.sqlite"


def visit(
    n: int, worn_in: float, tail: str = "N123", side: str = "LH", **more: str
) -> dict[str, str]:
    """The n-th visit of a gear whose joint 3 reads so; 400 landings and 90 days between visits."""
    day = date(2024, 1, 10) + timedelta(days=90 * n)
    seen = {
        "inspection_date": day.isoformat(),
        "gear_landings": str(400 * n),
        "clearance_3_in": f"{worn_in:.4f}",
    }
    return row(record_id=f"{tail}-{side}-{n}", tail_no=tail, side=side, **seen, **more)


def keep(folder: Path, *rows: Mapping[str, str], more: tuple[str, ...] = ()) -> Run:
    return mlg("check", table(folder, *rows), "--keep", *more)


def seeded(*visits: tuple[int, float]) -> None:
    """Keep visits of N123 LH as a check would, without one."""
    found = []
    for n, worn_in in visits:
        day = date(2024, 1, 10) + timedelta(days=90 * n)
        when = {"inspection_date": day, "gear_landings": 400.0 * n}
        found.append(Inspection(f"N123-LH-{n}", "N123", Side.LH, RADIAL, {3: worn_in}, **when))
    Store().add([inspection_record(seen) for seen in found])


def life(*more: str) -> dict[str, object]:
    run = mlg("history", "N123", "LH", "--json", *(more or ("--no-forecast",)))
    assert run.code == 0, run.err
    found: dict[str, object] = run.json
    return found


def joint_3(told: dict[str, object]) -> dict[str, object]:
    joints = told["joints"]
    assert isinstance(joints, list)
    found: dict[str, object] = joints[2]
    return found


def repair(day: str, landings: int) -> None:
    """Enter that joint 3 of N123 LH was restored."""
    joint = ("history", "repair", "N123", "LH", "--joint", "3")
    assert mlg(*joint, "--date", day, "--landings", str(landings)).code == 0


def test_a_check_keeps_only_when_asked(tmp_path: Path, place: Path) -> None:
    mlg("check", table(tmp_path, visit(1, 0.001)))
    assert not place.exists()


def test_keeping_does_not_change_what_a_check_says(tmp_path: Path, place: Path) -> None:
    file = table(tmp_path, visit(1, 0.001), visit(2, 0.013))
    plain, kept = mlg("check", file, "--json"), mlg("check", file, "--json", "--keep")
    assert (plain.code, plain.out) == (kept.code, kept.out)


def test_a_tail_in_another_spelling_is_not_merged_in_silence(tmp_path: Path, place: Path) -> None:
    keep(tmp_path, visit(1, 0.001))
    other = visit(2, 0.002, tail="n-123")
    assert "n-123 is kept as N123" in keep(tmp_path, other).err
    assert Store(place).gears() == [("N123", "LH")]


def test_a_repair_starts_the_wear_of_its_joints_again(tmp_path: Path, place: Path) -> None:
    seeded((1, 0.003), (2, 0.006))
    repair("2024-08-01", 810)
    seeded((3, 0.0008))
    told = life()
    assert joint_3(told)["readings"] == [[1200.0, 0.0008]]
    assert [event["kind"] for event in told["events"]].count("restored") == 1  # type: ignore[attr-defined, index]


@pytest.mark.slow
def test_landings_left_grow_by_a_repair(tmp_path: Path, place: Path) -> None:
    keep(tmp_path, visit(0, 0.0005), visit(1, 0.0025), visit(2, 0.0045))
    before = joint_3(life("--gear", "hawker-800xp"))["landings_to_limit"]
    repair("2024-08-01", 801)
    after = joint_3(life("--gear", "hawker-800xp"))["landings_to_limit"]
    assert isinstance(before, dict)
    assert isinstance(after, dict)
    assert 100.0 < before["p50"] < 1500.0
    assert before["p05"] < before["p50"] < before["p95"]
    assert after["p50"] > before["p50"]


def test_a_correction_counts_and_what_it_corrects_does_not(tmp_path: Path, place: Path) -> None:
    seeded((1, 0.001), (2, 0.02))
    shown = life()["events"][-1]["hash"][:10]
    for value in ("3=0.003in", "3=0.002in"):
        assert mlg("history", "amend", shown, value).code == 0
    assert joint_3(life())["readings"] == [[400.0, 0.001], [800.0, 0.002]]
    assert Store(place).verify()[1] is None
    correction = Store(place).all()[-1].digest[:10]
    assert mlg("history", "void", correction, "--why", "another aircraft").code == 0
    assert "See the records, and which are void" in mlg("history", "void", shown, "--why", "x").err
    assert joint_3(life())["readings"] == [[400.0, 0.001]]


def test_the_log_shows_what_was_corrected_and_voided_and_the_fact_as_it_is_now(
    tmp_path: Path,
) -> None:
    seeded((2, 0.02))
    for values in (("3=0.002in", "outcome=FAILED"), ("plunger=0.046in",), ("plunger=0.012in",)):
        assert mlg("history", "amend", "N123-LH-2", *values).code == 0
    events = life()["events"]
    said = [(each["kind"], each["text"]) for each in events if each["kind"] != "verdict"]
    assert ("correction", "correction: #3 0.02 in → 0.002 in") in said
    assert ("correction", "correction: outcome blank → FAILED") in said
    plunger = "correction: plunger displacement 0.046 in → 0.012 in"
    assert ("correction", plunger) in said
    assert [kind for kind, _text in said if kind in ("FAILED", "reading")] == ["FAILED", "reading"]
    assert mlg("history", "void", "N123-LH-2", "--why", "of another gear").code == 0
    (void,) = [each["text"] for each in life()["events"] if each["kind"] == "void"]
    assert void == "void: FAILED, plunger +0.012 in, #3 0.002in: of another gear"


@pytest.mark.parametrize(
    ("values", "field", "value"),
    [
        (["landings=4000"], "gear_landings", 4000.0),
        (["3="], "clearance_in", {}),
        (["plunger=41thou", "outcome=FAILED"], "readings_in", (0.041,)),
        (["convention=TOTAL_PLAY"], "clearance_in", {3: 0.0005}),
        (["3=1.2thou"], "entered", {3: EnteredClearance("1.2thou", LengthUnit.THOU)}),
        (["remarks=oil seen"], "carried", {"remarks": "oil seen"}),
        (["date=2024-01-31"], "inspection_date", date(2024, 1, 31)),
    ],
)
def test_an_amended_value_is_that_of_its_column(tmp_path, place, values, field, value):
    blank = {n: "" for n in visit(1, 0.001) if re.match(r"clearance_\d", n)}
    keep(tmp_path, visit(1, 0.001) | blank | {"clearance_3_in": "0.001", "outcome": "RETRACTED"})
    before = life_of(Store(place), "N123", "LH").inspections[0]
    assert mlg("history", "amend", "N123-LH-1", *values).code == 0
    (after,) = life_of(Store(place), "N123", "LH").inspections
    found = getattr(after.inspection, field)
    assert found == (pytest.approx(value) if field == "clearance_in" else value)
    assert getattr(before.inspection, field) != found


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (["3=many"], "clearance_3"),
        (["3=0.013"], "unit"),
        (["tail=N7"], "mlg history move"),
        (["outcom=FAILED"], "not a column"),
        (["landings"], "is not COLUMN=VALUE"),
        (["outcome=FAILED", "outcome=RETRACTED"], "outcome twice"),
        (["landings=400"], "says that already"),
    ],
)
def test_what_cannot_be_amended_is_refused(tmp_path, place, values, said):
    keep(tmp_path, visit(1, 0.001))
    run = mlg("history", "amend", "N123-LH-1", *values)
    assert (run.code, len(Store(place).all())) == (2, 1)
    assert said in " ".join(run.err.split())


def test_no_worst_case_is_stated_of_a_visit_on_which_no_joint_was_read(tmp_path, place):
    seen = visit(1, 0.0, outcome="FAILED", plunger_displacement_in="0.041")
    keep(tmp_path, {n: "" if re.match(r"clearance_\d", n) else text for n, text in seen.items()})
    shown = mlg("history", "N123", "LH", "--no-forecast").out
    assert "OUTSIDE MARGIN" in shown
    assert "worst case" not in shown


def test_a_life_is_shown_in_the_unit_that_the_user_reads(place, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    seeded((1, 0.0100))
    shown = mlg("history", "N123", "LH", "--no-forecast", "--show", "mm").out
    assert "400: 0.254" in shown
    assert re.search(r"worst case 0\.\d+ mm", shown)


def test_a_re_rigging_is_an_event_of_a_life_and_the_joints_wear_on(tmp_path, place):
    seeded((1, 0.001), (3, 0.002))
    done = ("rigging_checked=corrected", "date=2024-07-15", "repair_date=2024-07-15")
    flags = ("--tail", "N123", "--side", "LH", "--convention", "RADIAL", "--keep")
    mlg("check", *flags, *(f"--set={each}" for each in done), "--set", "landings=800")
    told = life()
    assert "rigging corrected" in [event["text"] for event in told["events"]]
    assert joint_3(told)["readings"] == [[400.0, 0.001], [1200.0, 0.002]]
    mlg("history", "N123", "LH", "--no-forecast", "--report", tmp_path)
    assert "rigging corrected" in next(tmp_path.glob("mlg-life-*.html")).read_text(encoding="utf-8")


def test_a_quiet_history_writes_its_page_and_says_nothing(tmp_path: Path, place: Path) -> None:
    seeded((1, 0.004))
    run = mlg("history", "N123", "LH", "--no-forecast", "--report", tmp_path / "out", "--quiet")
    assert (run.err, len(list((tmp_path / "out").glob("mlg-life-*.html")))) == ("", 1)


def test_the_fleet_page_is_printed_on_the_paper_that_was_asked_for(tmp_path, place, monkeypatch):
    seeded((1, 0.001))
    monkeypatch.setenv("MLG_PAGE", "Letter")
    mlg("fleet", "--no-forecast", "--report", tmp_path)
    page = pypdf.PdfReader(tmp_path / "fleet.pdf").pages[0]
    assert sorted(map(float, page.mediabox[2:])) == [612.0, 792.0]


@pytest.mark.parametrize("line", ["[" * 5000 + "]" * 5000, "9" * 5000, "[]", "{", "\x00"])
def test_what_is_not_an_exported_record_is_refused_with_its_line(tmp_path: Path, line: str) -> None:
    (tmp_path / "chain.jsonl").write_text(line + "\n", encoding="utf-8")
    run = mlg("history", "import", tmp_path / "chain.jsonl", "--store", tmp_path / "other.sqlite")
    assert run.code == 5
    assert "chain.jsonl, line 1 is not an exported record" in run.err


@pytest.mark.parametrize(
    "command",
    [
        ("history", "N9", "LH"),
        ("history", "N123", "XX"),
        ("history", "void", "unknown", "--why", "x"),
        ("history", "repair", "N123", "LH", "--joint", "33", "--date", "2024-08-01"),
        ("history", "repair", "N123", "LH", "--joint", "3", "--date", "yesterday"),
        ("history", "import", "not-there.jsonl"),
    ],
)
def test_what_cannot_be_meant_is_refused_as_usage(tmp_path, place, command):
    seeded((1, 0.001))
    run = mlg(*command)
    assert run.code == 2
    assert "What to do:" in run.err


def test_a_fleet_without_landings_has_no_forecast_and_says_null(tmp_path, place):
    keep(tmp_path, {k: v for k, v in visit(1, 0.001).items() if k != "gear_landings"})
    assert mlg("fleet", "--no-forecast").out.startswith("The most urgent gear first.")
    (gear,) = mlg("fleet", "--json").json["gears"]
    assert gear["landings_to_limit"] is None
    assert gear["next_inspection_landings"] is None


@pytest.mark.slow
def test_a_gear_that_wears_faster_is_due_earlier(tmp_path: Path, place: Path) -> None:
    slow = [visit(n, 0.0005 + 0.0004 * n) for n in range(4)]
    fast = [visit(n, 0.0005 + 0.0014 * n, side="RH") for n in range(4)]
    keep(tmp_path, *slow, *fast)
    gears = {g["side"]: g for g in mlg("fleet", "--json").json["gears"]}
    assert gears["RH"]["next_inspection_landings"] < gears["LH"]["next_inspection_landings"]
    assert gears["RH"]["landings_to_limit"]["p50"] < gears["LH"]["landings_to_limit"]["p50"]


def test_the_fleet_page_has_a_line_a_gear_that_links_to_its_life(tmp_path, place):
    seeded((1, 0.001), (2, 0.012))
    assert mlg("fleet", "--no-forecast", "--report", tmp_path / "out").code == 0
    page = (tmp_path / "out" / "fleet.html").read_text(encoding="utf-8")
    (linked,) = re.findall(r'href="([^"#]+\.html)"', page)
    assert (tmp_path / "out" / "fleet.pdf").exists()
    assert "0.0120" in (tmp_path / "out" / linked).read_text(encoding="utf-8")


def test_the_page_of_a_life_is_a_log_book_in_the_order_of_time(tmp_path: Path, place: Path) -> None:
    seeded((1, 0.0101))
    repair("2024-05-01", 500)
    seeded((2, 0.0007))
    assert mlg("history", "N123", "LH", "--no-forecast", "--report", tmp_path).code == 0
    (file,) = tmp_path.glob("*life*.html")
    page = re.sub(r"<[^>]+>", " ", file.read_text(encoding="utf-8")).replace("\u00a0", " ")
    lines = (r"#3 0\.0101 in \(limit 0\.0075\)", "restored #3", r"#3 0\.0007 in, radial")
    assert re.search(".*".join(lines), page, re.DOTALL)


def test_landings_left_are_drawn_with_an_arrow_beyond_the_horizon() -> None:
    interval_bar = environment().get_template("bars.html.j2").module.interval_bar
    near = interval_bar({"p05": 100.0, "p50": 400.0, "p95": 900.0}, 20_000)
    far = interval_bar({"p05": 100.0, "p50": 400.0, "p95": None}, 20_000)
    assert "<polygon" not in near
    assert "<polygon" in far
    assert "100, 400, beyond" in far


def test_a_forecast_beyond_the_horizon_of_the_gear_file_is_null(place, tmp_path):
    seeded((1, 0.001), (2, 0.0012), (3, 0.0014))
    far = joint_3(life("--gear", "hawker-800xp"))["landings_to_limit"]
    short = own_gear(tmp_path, ("horizon_landings = 20000", "horizon_landings = 50"))
    near = joint_3(life("--gear", str(short)))["landings_to_limit"]
    assert far["p05"] > 50
    assert near["p95"] is None


def test_who_accepts_a_larger_chance_inspects_later(place, tmp_path):
    seeded((1, 0.001), (2, 0.0012), (3, 0.0014))
    (usual,) = mlg("fleet", "--json").json["gears"]
    bold = own_gear(tmp_path, ("accepted_chance = 0.05", "accepted_chance = 0.3"))
    (later,) = mlg("fleet", "--json", "--gear", bold).json["gears"]
    assert later["next_inspection_landings"] > usual["next_inspection_landings"]
