"""The catalogue of causes. It is open: a user's own causes are appended to it."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from traceback import walk_tb

from mlg_troubleshoot.diagnosis.causes.base import Candidate, Cause, Scene
from mlg_troubleshoot.diagnosis.causes.linkage import (
    CalibrationRate,
    DirectionNotWorstCase,
    ElasticCompliance,
    JointContact,
    LoadDirections,
    OtherGeometry,
    OutOfPlaneTilt,
    OvalWear,
    ThermalGrowth,
    UnlistedWear,
)
from mlg_troubleshoot.diagnosis.causes.reading import (
    ApproachHysteresis,
    ConventionSlip,
    DateStep,
    GaugeBias,
    GaugeScale,
    GearScale,
    Modification,
    RiggingOffset,
    SideDifference,
    TechnicianBias,
)
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.results import Result


class Catalogue(Result, tuple[Cause, ...]):
    """Causes, with a table of what each one says."""

    json_names = "causes"

    @property
    def causes(self) -> tuple[Cause, ...]:
        """All of them."""
        return tuple(self)

    def __repr__(self) -> str:
        return f"Catalogue({', '.join(cause.name for cause in self)})"


CATALOGUE = Catalogue(
    (
        OutOfPlaneTilt(),
        ElasticCompliance(),
        ThermalGrowth(),
        DirectionNotWorstCase(),
        OvalWear(),
        UnlistedWear(),
        RiggingOffset(),
        DateStep(),
        GaugeBias(),
        GearScale(),
        GaugeScale(),
        TechnicianBias(),
        Modification(),
        SideDifference(),
        CalibrationRate(),
        ApproachHysteresis(),
        JointContact(),
        ConventionSlip(),
        LoadDirections(),
        OtherGeometry(),
    )
)


def with_own(own: Iterable[Cause]) -> tuple[Cause, ...]:
    """The catalogue with a user's own causes, none of which may bear a shipped name."""
    own = tuple(own)
    shipped = {cause.name for cause in CATALOGUE}
    for cause in own:
        if cause.name in shipped:
            raise UsageError(
                f"{type(cause).__name__}: {cause.name!r} is the name of a shipped cause",
                "Give your cause another name.",
            )
    return (*CATALOGUE, *own)


@contextmanager
def in_own_cause(own: Iterable[Cause], columns: Iterable[str]) -> Iterator[None]:
    """Say of an error in a user's cause where it stands, and which columns there are."""
    modules = {type(cause).__module__ for cause in own if cause not in CATALOGUE}
    try:
        yield
    except _BROKEN as error:
        places = [
            f"{Path(frame.f_code.co_filename)}, line {line}"
            for frame, line in walk_tb(error.__traceback__)
            if frame.f_globals.get("__name__") in modules
        ]
        if not places:
            raise
        raise UsageError(
            f"{places[-1]}: {type(error).__name__}: {error}",
            f"Correct the cause. The columns there are: {', '.join(sorted(columns))}.",
        ) from error


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


__all__ = ["CATALOGUE", "Candidate", "Cause", "Scene", "in_own_cause", "load_causes", "with_own"]
