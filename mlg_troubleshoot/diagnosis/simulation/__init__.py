"""Which parameters of any simulation are wrong, from measured data."""

from mlg_troubleshoot.diagnosis.evidence.verdict import Verdict
from mlg_troubleshoot.diagnosis.simulation.result import HeldOutGain, SimulationDiagnosis, Suspect, SuspectFound
from mlg_troubleshoot.diagnosis.simulation.search import diagnose_simulation

__all__ = ["HeldOutGain", "SimulationDiagnosis", "Suspect", "SuspectFound", "Verdict", "diagnose_simulation"]
