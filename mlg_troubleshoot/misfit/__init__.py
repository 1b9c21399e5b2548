"""How likely each explanation of a misfit is, for any simulation: noise, evidence, held-out rows.
Knows no gear.
"""

from mlg_troubleshoot.misfit.search import diagnose_simulation
from mlg_troubleshoot.misfit.simulation_result import (
    HeldOutGain,
    SimulationDiagnosis,
    Suspect,
    SuspectFound,
)
from mlg_troubleshoot.misfit.verdict import MisfitVerdict

__all__ = [
    "HeldOutGain",
    "MisfitVerdict",
    "SimulationDiagnosis",
    "Suspect",
    "SuspectFound",
    "chance",
    "covariance",
    "diagnose_simulation",
    "held_out",
    "one_by_one",
    "rivals",
    "screen",
    "search",
    "verdict",
]
