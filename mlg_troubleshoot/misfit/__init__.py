"""How likely each explanation of a misfit is, for any simulation: noise, evidence, held-out rows.
Knows no gear.

Its modules are its doors: a check needs the beliefs of a diagnosis, and not scipy.
"""

__all__ = [
    "beliefs",
    "columns",
    "posterior",
    "simulation",
    "simulation_result",
]
