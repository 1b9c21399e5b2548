"""Maintenance troubleshooting decision support for the joints of a landing gear.

From a notebook or a script, everything that ``mlg`` does, without a terminal:

>>> from mlg_troubleshoot import ClearanceConvention, Inspection, Side, check, load_gear, predict
>>> gear = load_gear()
>>> worst = predict({3: 0.013, 5: 0.007}, gear)
>>> print(f"{worst.over_in[0]:+.4f} in, {worst.under_in[0]:+.4f} in")
+0.0472 in, -0.0429 in
>>> worn = {3: 0.013, 5: 0.007}
>>> row = Inspection("R1", "N123", Side.LH, ClearanceConvention.RADIAL, clearance_in=worn)
>>> found = check(row, gear)
>>> print(found.verdict, [joint.joint for joint in found.ranked][:2])
OUTSIDE_MARGIN [3, 5]

Clearances inside are radial, in inches: :func:`parse_length` reads them as people write them, and a
reading taken as bore minus pin or as total play is divided by ``ClearanceConvention.per_radial``.

=======================  ==============================================================
load_gear, Gear          a shipped gear, or a gear file of your own
predict                  worst displacement of the plunger, for one gear or a batch
Inspection, check        one inspection or a DataFrame, and what the decision rule says about it
read_inspections         a table as the reader of files understands it, as a DataFrame
check_files              whole tables: CSV, xlsx, xls
write_reports            printable reports of a checked table
diagnose, diagnose_files measured against predicted: cause, extension, gain
diagnose_simulation      the same question for a simulation of yours
survey                   a geometry from readings of a real gear
forecast, Store          landings that gears have left; the records that are kept
write_extension          the extension of a diagnosis, for `load_model_extension`
load_index_table         precomputed sensitivity and amplification indices of a gear
run_study                the same computed again, by the design and for the clearances you choose
schema                   JSON Schema of what a command writes with ``--json``
=======================  ==============================================================

Names are imported when they are first used, so that importing the package stays fast.
"""

from importlib import import_module

# Neither __future__ nor typing is imported: python -m has the current folder on its path until
# __main__ takes it off.
TYPE_CHECKING = False

if TYPE_CHECKING:
    from mlg_troubleshoot.decision.assessment import Assessment, Verdict
    from mlg_troubleshoot.decision.inspection import Inspection, Outcome, Side
    from mlg_troubleshoot.diagnosis.causes.base import Cause
    from mlg_troubleshoot.diagnosis.extension import write_extension
    from mlg_troubleshoot.errors import Problem, TroubleshootError
    from mlg_troubleshoot.gear.gear import Gear
    from mlg_troubleshoot.gear.gear_file import load_gear, shipped_gears
    from mlg_troubleshoot.gear.linkage import WorstCase
    from mlg_troubleshoot.indices.index_table import IndexTable
    from mlg_troubleshoot.misfit.simulation import diagnose_simulation
    from mlg_troubleshoot.misfit.simulation_result import SimulationDiagnosis, Suspect
    from mlg_troubleshoot.paper.study import StudyFindings, StudyOptions
    from mlg_troubleshoot.reporting.publish import Picture
    from mlg_troubleshoot.schemas import schema
    from mlg_troubleshoot.store.database import Store
    from mlg_troubleshoot.surveying import SurveyResult, survey
    from mlg_troubleshoot.units import ClearanceConvention, LengthUnit, parse_length
    from mlg_troubleshoot.workflows.check import (
        CheckOptions,
        CheckResult,
        check,
        check_files,
        load_index_table,
        predict,
        read_inspections,
        write_reports,
    )
    from mlg_troubleshoot.workflows.diagnose import (
        DiagnoseOptions,
        DiagnoseResult,
        diagnose,
        diagnose_files,
        load_model_extension,
    )
    from mlg_troubleshoot.workflows.history import Lives, forecast
    from mlg_troubleshoot.workflows.study import run_study

_HOME = {
    "decision.assessment": "Assessment Verdict",
    "decision.inspection": "Inspection Outcome Side",
    "diagnosis.causes.base": "Cause",
    "diagnosis.extension": "write_extension",
    "errors": "Problem TroubleshootError",
    "gear.gear": "Gear",
    "gear.linkage": "WorstCase",
    "gear.gear_file": "load_gear shipped_gears",
    "indices.index_table": "IndexTable",
    "misfit.simulation": "diagnose_simulation",
    "misfit.simulation_result": "SimulationDiagnosis Suspect",
    "paper.study": "StudyFindings StudyOptions",
    "reporting.publish": "Picture",
    "schemas": "schema",
    "store.database": "Store",
    "surveying": "SurveyResult survey",
    "units": "ClearanceConvention LengthUnit parse_length",
    "workflows.check": (
        "CheckOptions CheckResult check check_files load_index_table predict "
        "read_inspections write_reports"
    ),
    "workflows.diagnose": (
        "DiagnoseOptions DiagnoseResult diagnose diagnose_files load_model_extension"
    ),
    "workflows.history": "Lives forecast",
    "workflows.study": "run_study",
}
_MODULES = {name: module for module, names in _HOME.items() for name in names.split()}

__all__ = [
    "Assessment",
    "Cause",
    "CheckOptions",
    "CheckResult",
    "ClearanceConvention",
    "DiagnoseOptions",
    "DiagnoseResult",
    "Gear",
    "IndexTable",
    "Inspection",
    "LengthUnit",
    "Lives",
    "Outcome",
    "Picture",
    "Problem",
    "Side",
    "SimulationDiagnosis",
    "Store",
    "StudyFindings",
    "StudyOptions",
    "SurveyResult",
    "Suspect",
    "TroubleshootError",
    "Verdict",
    "WorstCase",
    "check",
    "check_files",
    "diagnose",
    "diagnose_files",
    "diagnose_simulation",
    "forecast",
    "load_gear",
    "load_index_table",
    "load_model_extension",
    "parse_length",
    "predict",
    "read_inspections",
    "run_study",
    "schema",
    "shipped_gears",
    "survey",
    "write_extension",
    "write_reports",
]


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
