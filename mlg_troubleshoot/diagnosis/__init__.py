"""Measured against predicted: what the model gets wrong, the cause by name, the extension and its
gain.
"""

from mlg_troubleshoot.diagnosis.causes import CATALOGUE, Candidate, Cause, Scene, load_causes
from mlg_troubleshoot.diagnosis.diagnose import Diagnosis, NamedCause, diagnose
from mlg_troubleshoot.diagnosis.explain import WeighedCause
from mlg_troubleshoot.diagnosis.extension import (
    ModelExtension,
    Term,
    load_extension,
    write_extension,
)
from mlg_troubleshoot.diagnosis.faults import DataCondition, data_condition, doubt_of
from mlg_troubleshoot.diagnosis.table import DiagnosisTable, table_from_inspections
from mlg_troubleshoot.misfit.simulation import diagnose_simulation
from mlg_troubleshoot.misfit.simulation_result import (
    HeldOutGain,
    SimulationDiagnosis,
    Suspect,
    SuspectFound,
)
from mlg_troubleshoot.misfit.simulation_result import MisfitVerdict as Verdict

__all__ = [
    "CATALOGUE",
    "Candidate",
    "Cause",
    "DataCondition",
    "Diagnosis",
    "DiagnosisTable",
    "HeldOutGain",
    "ModelExtension",
    "NamedCause",
    "Scene",
    "SimulationDiagnosis",
    "Suspect",
    "SuspectFound",
    "Term",
    "Verdict",
    "WeighedCause",
    "causes",
    "data_condition",
    "diagnose",
    "diagnose_simulation",
    "doubt_of",
    "extension",
    "faults",
    "load_causes",
    "load_extension",
    "noise",
    "table",
    "table_from_inspections",
    "write_extension",
]
