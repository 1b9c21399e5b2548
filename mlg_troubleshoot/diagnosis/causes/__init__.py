"""The catalogue of causes. It is open: a user's own causes are appended to it."""

from __future__ import annotations

import importlib.util
from pathlib import Path

from mlg_troubleshoot.diagnosis.causes.base import Candidate, Cause, Scene
from mlg_troubleshoot.diagnosis.causes.convention import ConventionSlip
from mlg_troubleshoot.diagnosis.causes.joint import DirectionNotWorstCase, JointContact, OvalWear
from mlg_troubleshoot.diagnosis.causes.linkage import (
    CalibrationRate,
    ElasticCompliance,
    OutOfPlaneTilt,
    ThermalGrowth,
    UnlistedWear,
)
from mlg_troubleshoot.diagnosis.causes.reading import (
    ApproachHysteresis,
    DateStep,
    GaugeBias,
    RiggingOffset,
    SideDifference,
    TechnicianBias,
)
from mlg_troubleshoot.diagnosis.causes.together import LoadDirections, OtherGeometry
from mlg_troubleshoot.errors import UsageError

CATALOGUE: tuple[Cause, ...] = (
    OutOfPlaneTilt(),
    ElasticCompliance(),
    ThermalGrowth(),
    DirectionNotWorstCase(),
    OvalWear(),
    UnlistedWear(),
    RiggingOffset(),
    DateStep(),
    GaugeBias(),
    TechnicianBias(),
    SideDifference(),
    CalibrationRate(),
    ApproachHysteresis(),
    JointContact(),
    ConventionSlip(),
    LoadDirections(),
    OtherGeometry(),
)


# What running a user's file may raise.
_BROKEN = (
    SyntaxError,
    ImportError,
    NameError,
    AttributeError,
    TypeError,
    ValueError,
    LookupError,
    ArithmeticError,
    AssertionError,
    OSError,
    RuntimeError,
)


def load_causes(file: Path) -> tuple[Cause, ...]:
    """Load a user's own causes from a Python file.

    Parameters
    ----------
    file : Path
        A file that defines classes derived from `Cause`.

    Returns
    -------
    tuple of Cause
        One of each class, in the order of the file.

    Raises
    ------
    UsageError
        If the file cannot be loaded or defines no cause.
    """
    spec = importlib.util.spec_from_file_location(f"mlg_own_causes_{file.stem}", file)
    if spec is None or spec.loader is None or not file.is_file():
        raise UsageError(
            f"{file} is not a Python file with causes", "Give a .py file that derives from Cause."
        )
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except _BROKEN as error:
        raise UsageError(
            f"{file} cannot be loaded: {error}", "Correct the file and run again."
        ) from error
    found = [
        value()
        for value in vars(module).values()
        if isinstance(value, type)
        and issubclass(value, Cause)
        and value.__module__ == module.__name__
    ]
    if not found:
        raise UsageError(
            f"{file} defines no cause", "Derive a class from mlg_troubleshoot.diagnosis.Cause."
        )
    return tuple(found)


__all__ = ["CATALOGUE", "Candidate", "Cause", "Scene", "load_causes"]
