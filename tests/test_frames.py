"""DataFrames in, tables and pictures out: what an analyst does in a notebook."""

from __future__ import annotations

import copy
import pickle
import random
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from io import BytesIO
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pandas as pd
import pytest

import mlg_troubleshoot as mlg
from mlg_troubleshoot.diagnosis import CATALOGUE
from mlg_troubleshoot.schemas import schema

ROOT = Path(__file__).parents[1]
DATA = ROOT / "inspection_data"
EXAMPLES = [
    pytest.param(file, marks=[pytest.mark.slow] * ("measured" in file.name), id=file.stem)
    for file in sorted(DATA.glob("*.csv"))
]
BAD = ("x", "-0.002", "0,007", "0.9", "<0.002x", "1/8", "#REF!")


def sheet(seed: int, *, bad: bool = True) -> pd.DataFrame:
    """A table of a fleet as people write it: some cells blank, some of them wrong."""
    draw = random.Random(seed)
    unit = draw.choice(("in", "thou", "mm"))
    per_inch = {"in": 1.0, "thou": 1000.0, "mm": 25.4}[unit]
    rows = []
    for number in range(draw.randint(1, 6)):
        row: dict[str, Any] = {
            "record_id": f"R{number}",
            "tail_no": f"N{draw.randint(100, 999)}",
            "side": draw.choice(("LH", "right", "L")),
            "clearance_convention": draw.choice(("RADIAL", "diametral", "total play")),
            "inspection_date": f"2024-{draw.randint(1, 12):02d}-{draw.randint(1, 28):02d}",
            "gear_landings": str(draw.randint(0, 4000)),
            "gauge_id": draw.choice(("G-1", "007", "")),
            "Bay": draw.choice(("north", "south", "")),
        }
        factor = 1.0 if row["clearance_convention"] == "RADIAL" else 2.0
        for joint in range(1, 11):
            value = draw.uniform(0.001, 0.009) * per_inch * factor
            row[f"clearance_{joint}_{unit}"] = "" if draw.random() < 0.2 else f"{value:.4f}"
        rows.append(row)
    frame = pd.DataFrame(rows)
    if bad:
        for _ in range(draw.randint(1, 4)):
            place = draw.randrange(len(frame)), draw.randrange(8, frame.shape[1])
            frame.iloc[place] = draw.choice(BAD)
        if draw.random() < 0.3:
            frame.loc[0, "side"] = "both"
    return frame


def as_csv(frame: pd.DataFrame) -> BytesIO:
    return BytesIO(frame.to_csv(index=False).encode())


def judged(source: Any) -> tuple[list[Any], list[Any]]:
    """Verdicts with their numbers, and problems without the name of the table."""
    found = mlg.check(source, advice=False)
    verdicts = [
        (row["verdict"], row["predicted_displacement_in"], row["next_action"]["text"])
        for row in found.to_dict()["inspections"]
    ]
    return verdicts, [(p.code, p.column, p.value, p.expected, p.remedy) for p in found.problems]


EVERY_DAY = 6


@pytest.mark.parametrize(
    "seed", [pytest.param(n, marks=() if n < EVERY_DAY else pytest.mark.slow) for n in range(200)]
)
def test_a_frame_has_the_verdicts_and_the_problems_of_its_file(seed: int) -> None:
    frame = sheet(seed)
    assert judged(frame) == judged(as_csv(frame))


def test_a_series_is_one_gear() -> None:
    frame = sheet(3, bad=False)
    assert judged(frame.iloc[0]) == judged(as_csv(frame.head(1)))


def test_a_problem_names_the_row_label_and_the_column() -> None:
    frame = sheet(5, bad=False)
    frame.index = pd.Index([f"gear {n}" for n in range(len(frame))])
    column = frame.columns[10]
    frame.loc["gear 1", column] = "x"
    (problem,) = mlg.check(frame).problems
    assert problem.place().startswith(f"DataFrame, cell loc['gear 1', {column!r}]")


def test_missing_values_of_a_frame_are_not_measured() -> None:
    frame = pd.DataFrame(
        {"tail_no": ["N1"], "side": ["LH"], "clearance_3_in": [0.004], "clearance_5_in": [np.nan]}
    )
    joints = mlg.check(frame, convention="RADIAL").to_frame("joints")
    assert joints["clearance_in"].notna().tolist() == [n == 3 for n in range(1, 11)]


def test_days_of_a_frame_are_days() -> None:
    frame = sheet(4, bad=False).assign(inspection_date=pd.Timestamp("2024-03-04"))
    found = mlg.read_inspections(frame)
    assert set(found["inspection_date"]) == {pd.Timestamp("2024-03-04")}


def test_a_column_of_days_that_is_only_carried_has_no_times() -> None:
    frame = sheet(4, bad=False).assign(bought=pd.Timestamp("2024-03-04"))
    assert set(mlg.read_inspections(frame)["bought"]) == {"2024-03-04"}


def test_an_empty_frame_is_a_problem() -> None:
    assert [p.code for p in mlg.check(pd.DataFrame()).problems] != []


def test_predict_takes_the_columns_of_a_frame_by_name() -> None:
    frame = pd.DataFrame({"clearance_5_thou": [7.0, 0.0], "clearance_3_in": [0.013, None]})
    assert mlg.predict(frame).over_in.tolist() == [
        mlg.predict({3: 0.013, 5: 0.007}).over_in[0],
        0.0,
    ]


def test_predict_halves_what_a_frame_calls_total_play() -> None:
    frame = pd.DataFrame({"clearance_3_in": [0.026], "clearance_convention": ["TOTAL_PLAY"]})
    assert mlg.predict(frame) == mlg.predict({3: 0.013})


def test_predict_names_the_wrong_cell_of_a_frame() -> None:
    frame = pd.DataFrame({"clearance_3_in": [0.013, -1.0]}, index=["a", "b"])
    with pytest.raises(mlg.TroubleshootError, match=r"loc\['b', 'clearance_3_in'\]"):
        mlg.predict(frame)


@pytest.mark.parametrize("file", EXAMPLES)
def test_read_inspections_loses_nothing_of_an_example(file: Path) -> None:
    read = mlg.read_inspections(file)
    wrong = {problem.row for problem in read.attrs["problems"]}
    first, again = judged(file)[0], judged(as_csv(read))[0]
    # A wrong cell is missing in the frame.
    assert [v for n, v in enumerate(first, 2) if n not in wrong] == [
        v for n, v in enumerate(again, 2) if n not in wrong
    ]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(500))
def test_read_inspections_loses_nothing_of_a_sheet(seed: int) -> None:
    frame = sheet(1000 + seed, bad=False)
    read = mlg.read_inspections(as_csv(frame))
    assert read.attrs["problems"] == ()
    verdicts, again = judged(as_csv(frame))[0], judged(as_csv(read))[0]
    assert [v[0] for v in again] == [v[0] for v in verdicts]
    assert [v[1] for v in again] == pytest.approx([v[1] for v in verdicts], abs=1e-15)
    # A column without a value is left out.
    bays = read["Bay"].fillna("") if "Bay" in read else frame["Bay"].where(frame["Bay"] == "")
    assert bays.tolist() == frame["Bay"].tolist()


def test_a_wrong_cell_is_missing_and_its_row_keeps_the_others() -> None:
    frame = sheet(7, bad=False)
    column = next(c for c in frame.columns[8:] if frame.loc[0, c])
    frame.loc[0, column] = "x"
    read = mlg.read_inspections(as_csv(frame))
    joint = column.split("_")[1]
    assert pd.isna(read.loc[0, f"clearance_{joint}_in"])
    assert read.loc[0, "gear_landings"] == float(frame.loc[0, "gear_landings"])
    assert [problem.column for problem in read.attrs["problems"]] == [column]


def test_read_inspections_has_nullable_numbers_dates_and_categories() -> None:
    read = mlg.read_inspections(DATA / "measured_pressure.csv")
    kinds = {"clearance_3_in": "Float64", "inspection_date": "datetime64[s]", "side": "category"}
    assert {name: str(read[name].dtype) for name in kinds} == kinds


def simulated() -> Any:
    force = np.linspace(1.0, 20.0, 40)
    measured = force / 8.0 + np.random.default_rng(1).normal(0.0, 0.02, 40)
    suspects = [mlg.Suspect("stiffness", 10.0, 0.5)]
    return mlg.diagnose_simulation(lambda p: force / p["stiffness"], measured, suspects)


# One of every result that a public function gives.
RESULTS: dict[str, Callable[[], Any]] = {
    "gear": mlg.load_gear,
    "worst": lambda: mlg.predict({3: 0.013}),
    "check": lambda: mlg.check_files([DATA / "fleet_batch.csv"]),
    "assessment": lambda: result("check").judgements[0],
    "inspection": lambda: result("assessment").inspection,
    "indices": lambda: mlg.load_index_table(mlg.load_gear()),
    "study": lambda: mlg.run_study(mlg.load_gear(), mlg.StudyOptions()),
    "diagnose": lambda: mlg.diagnose(DATA / "measured_pressure.csv"),
    "diagnosis": lambda: result("diagnose").diagnosis,
    "extension": lambda: result("diagnose").extension,
    "simulation": simulated,
    "survey": lambda: mlg.survey(str(FOUR_BAR_READINGS), str(FOUR_BAR)),
    "lives": lambda: mlg.forecast(DATA / "fleet_batch.csv"),
    "catalogue": lambda: CATALOGUE,
    "picture": lambda: result("gear").plot(),
}
NO_TABLE = ("inspection", "extension", "picture")
# The fit of a linkage takes seconds.
NAMES = [pytest.param(name, marks=[pytest.mark.slow] * (name == "survey")) for name in RESULTS]


@cache
def result(name: str) -> Any:
    return RESULTS[name]()


FOUR_BAR = ROOT / "tests" / "geometry" / "data" / "four-bar.toml"
FOUR_BAR_READINGS = ROOT / "docs" / "how-to" / "data" / "four-bar-readings.csv"
COPIES: dict[str, Callable[[Any], Any]] = {
    "pickle": lambda given: pickle.loads(pickle.dumps(given)),
    "deepcopy": copy.deepcopy,
    "copy": copy.copy,
}


@pytest.mark.parametrize("how", COPIES)
@pytest.mark.parametrize("name", NAMES)
def test_a_copy_of_a_result_is_equal_to_it(name: str, how: str) -> None:
    given = result(name)
    assert COPIES[how](given) == given
    assert mlg.predict({3: 0.013}) != mlg.predict({3: 0.012})


def same_again(given: Any) -> Any:
    return given


@pytest.mark.slow
def test_results_travel_to_two_processes_and_back() -> None:
    given = [result(name) for name in RESULTS]
    with ProcessPoolExecutor(2, get_context("spawn")) as two:
        assert list(two.map(same_again, given)) == given


@pytest.mark.parametrize("name", NAMES)
def test_a_result_says_itself_in_twenty_lines(name: str) -> None:
    text = repr(result(name))
    assert len(text.splitlines()) <= 20
    assert len(text) <= 4000


@pytest.mark.parametrize("name", [n for n in NAMES if n.values[0] not in NO_TABLE])
def test_a_result_is_a_table_of_which_a_notebook_keeps_two_kilobytes(name: str) -> None:
    assert not result(name).to_frame().empty
    shown = result(name)._repr_html_()
    assert "<table" in shown
    assert len(shown.encode()) <= 2048


@pytest.mark.parametrize(
    ("name", "command"),
    [*((name, name) for name in ("check", "diagnose", "study", "gear")), ("lives", "fleet")],
)
def test_the_dict_of_a_result_is_the_documented_json(name: str, command: str) -> None:
    jsonschema.validate(result(name).to_dict(), schema(command))


def test_the_catalogue_is_a_table_of_its_causes() -> None:
    table = CATALOGUE.to_frame().set_index("name")
    assert table.index.tolist() == [cause.name for cause in CATALOGUE]
    assert table.loc["elastic_compliance", "needs"] == ["hydraulic_pressure_psi"]
    assert table.loc["gauge_bias", "sentence"] == "Readings with … are shifted"


def test_a_table_has_a_row_per_gear_with_the_labels_of_the_frame() -> None:
    frame = sheet(11)
    frame.index = pd.Index([f"g{n}" for n in range(len(frame))])
    frame.loc["g0", "side"] = "both"
    found = mlg.check(frame).to_frame()
    assert found.index.tolist() == frame.index.tolist()
    assert found.loc["g0", "verdict"] == "INVALID"


def test_a_table_that_is_not_there_names_those_that_are() -> None:
    with pytest.raises(mlg.TroubleshootError) as caught:
        result("check").to_frame("joint")
    assert "joints" in caught.value.remedy


PICTURES = [
    ("check", {"row": 3, "unit": "mm"}),
    ("gear", {}),
    ("indices", {}),
    ("study", {}),
    ("diagnose", {}),
    ("diagnose", {"against": "hydraulic_pressure_psi"}),
    ("diagnose", {"against": "technician_id"}),
    ("simulation", {}),
    ("lives", {}),
]


@pytest.mark.parametrize(("name", "how"), PICTURES)
def test_a_result_draws_itself(name: str, how: dict[str, Any]) -> None:
    drawn = result(name).plot(**how)
    assert drawn._repr_svg_().startswith('<svg xmlns="http://www.w3.org/2000/svg"')


def test_a_picture_is_saved_as_svg_and_as_nothing_else(tmp_path: Path) -> None:
    picture = result("gear").plot()
    assert picture.save(tmp_path / "gear.svg").read_bytes().startswith(b"<svg")
    with pytest.raises(mlg.TroubleshootError, match=r"gear\.pdf"):
        picture.save(tmp_path / "gear.pdf")


def test_residuals_against_an_unknown_column_name_the_columns() -> None:
    with pytest.raises(mlg.TroubleshootError) as caught:
        result("diagnose").plot(against="colour")
    assert "hydraulic_pressure_psi" in caught.value.remedy


def test_a_store_gives_what_it_keeps_as_tables(tmp_path: Path) -> None:
    from mlg_troubleshoot.workflows.keep import keep, told_by

    store = mlg.Store(tmp_path / "store.sqlite")
    options = mlg.CheckOptions(advice=False)
    checked = mlg.check_files([DATA / "fleet_batch.csv"], options)
    keep(told_by(checked.judgements), store)
    kept = store.inspections()
    assert set(kept["record_id"]) == set(checked.to_frame()["record_id"])
    gears = checked.to_frame()[["tail_no", "side"]].drop_duplicates()
    assert len(store.lives()) == len(gears)


CAUSE = """
import numpy as np
from mlg_troubleshoot import Cause
from mlg_troubleshoot.diagnosis.causes.base import offset


class Hot(Cause):
    name, parameter, trial = "{name}", "offset_in", 0.001
    sentence, inspect, separates = "Hot oil", "the oil", "cold oil"

    def adjust(self, scene, candidate, value):
        return offset(scene, scene.table.quantities["{column}"], value)
"""


def cause_file(folder: Path, name: str, column: str) -> Path:
    file = folder / "hot.py"
    file.write_text(CAUSE.format(name=name, column=column), encoding="utf-8")
    return file


def test_an_error_in_a_cause_of_ones_own_names_file_line_and_columns(tmp_path: Path) -> None:
    file = cause_file(tmp_path, "hot_oil", "temperature")
    with pytest.raises(mlg.TroubleshootError) as caught:
        mlg.diagnose(DATA / "measured_pressure.csv", cause_files=(file,))
    assert caught.value.message == f"{file}, line 12: KeyError: 'temperature'"
    assert "temperature_c" in caught.value.remedy


def test_a_cause_with_a_shipped_name_is_refused(tmp_path: Path) -> None:
    file = cause_file(tmp_path, "gauge_bias", "temperature_c")
    with pytest.raises(mlg.TroubleshootError, match="'gauge_bias' is the name of a shipped cause"):
        mlg.diagnose(DATA / "measured_pressure.csv", cause_files=(file,))


def test_the_sentence_of_a_cause_stands_in_the_json() -> None:
    (cause,) = result("diagnose").to_dict()["causes"]
    (named,) = result("diagnose").diagnosis.causes
    assert cause["sentence"] == named.candidate.cause.sentence


@pytest.mark.slow
def test_a_gauge_that_is_wrong_in_all_rows_is_an_alias_of_the_calibration_rate():
    frame, share = mlg.read_inspections(DATA / "measured_nothing_wrong.csv"), 1.15
    readings = [name for name in frame.columns if name.startswith("plunger_displacement")]
    frame[readings] *= share
    found = mlg.diagnose(frame).to_dict()
    said = {each["cause"]: each["sentence"] for each in found["causes"] + found["also_possible"]}
    assert "the gauge of all rows reads too much" in said["calibration_rate"]


def test_a_name_that_a_simulation_does_not_get_is_noted_with_those_that_it_gets() -> None:
    suspects = [mlg.Suspect("mass", 1.0, 0.05)]
    with pytest.raises(KeyError) as caught:
        mlg.diagnose_simulation(lambda p: np.ones(9) * p["nope"], np.ones(9), suspects)
    assert caught.value.__notes__ == ["The simulation is given: mass."]


def test_a_suspect_of_text_is_refused_with_its_name() -> None:
    suspects = [mlg.Suspect("mass", "1", 0.05)]  # type: ignore[arg-type]
    with pytest.raises(mlg.TroubleshootError, match="mass"):
        mlg.diagnose_simulation(lambda p: np.ones(9) * p["mass"], np.ones(9), suspects)


PAGES = {"formats": ("html",), "unit": "mm"}


def test_every_file_may_be_given_by_its_name(tmp_path: Path) -> None:
    extension, cause = str(tmp_path / "extension.toml"), str(DATA / "own_cause.py")
    mlg.write_extension(result("diagnose").extension, extension)
    assert mlg.load_model_extension([extension], "hawker-800xp", [cause]) is not None
    (tmp_path / "beliefs.toml").write_text("schema = 1\n")
    options = {"cause_files": (cause,), "beliefs_file": str(tmp_path / "beliefs.toml")}
    few = (DATA / "measured_pressure.csv").read_text(encoding="utf-8").splitlines()[:61]
    (tmp_path / "few.csv").write_text("\n".join(few), encoding="utf-8")
    assert mlg.diagnose(str(tmp_path / "few.csv"), **options).diagnosis is not None
    found = mlg.check(str(DATA / "failure_case.csv"))
    (report,) = mlg.write_reports(found, mlg.CheckOptions(), str(tmp_path / "pages"), **PAGES)
    assert report.html is not None and report.html.parent == tmp_path / "pages"
