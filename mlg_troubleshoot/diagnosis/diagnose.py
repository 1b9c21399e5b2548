"""The loop: data, misfit, cause, extension, gain, remainder."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.diagnosis.bank import build_bank
from mlg_troubleshoot.diagnosis.causes import CATALOGUE
from mlg_troubleshoot.diagnosis.causes.base import Candidate, Cause
from mlg_troubleshoot.diagnosis.extension import Term
from mlg_troubleshoot.diagnosis.faults import DataFault, screen_faults
from mlg_troubleshoot.diagnosis.gain import Gain, measure_gain
from mlg_troubleshoot.diagnosis.inference import Finding, Inference
from mlg_troubleshoot.diagnosis.noise import Rows, estimate_repeatability, measured_uncertainty, small_trends
from mlg_troubleshoot.diagnosis.scene import build_scene, effect_columns
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.errors import InconclusiveDataError
from mlg_troubleshoot.gear.directions import worst_case
from mlg_troubleshoot.gear.gear import Discrepancies
from mlg_troubleshoot.gear.model import LinkageModel

Array = NDArray[np.float64]

LEAST_ROWS = 20
LEAST_TAILS = 4
# Share of rows from which data faults are no slips of single cells. [1]
_MANY_FAULTS = 0.15
# Measured over predicted displacement: further from 1 than this, or negative, is no misfit. [1]
_MOST_RATIO = 4.0


@dataclass(frozen=True)
class NamedCause:
    """A cause that the data name, or cannot rule out.

    Parameters
    ----------
    candidate : Candidate
        Cause, target and setting.
    effect_rms_in : float
        Root mean square of its effect over the rows. [in]
    p_value : float or None
        Chance of as much if nothing is wrong. [1]
    value : float
        The fitted parameter. [unit of the cause's parameter]
    interval : tuple of float
        95 % interval of the parameter.
    effect_in : ndarray, shape (n_used,)
        Its effect in each row used. [in]
    """

    candidate: Candidate
    effect_rms_in: float
    p_value: float | None
    value: float
    interval: tuple[float, float]
    effect_in: Array

    @property
    def parameters(self) -> dict[str, float | str]:
        """The parameters as a person reads them, with the date of a change or the exponent of wear."""
        shown: dict[str, float | str] = dict(self.candidate.cause.shown(self.value))
        fixed = self.candidate.setting
        return shown | {name: fixed[name] for name in ("since", "wear_exponent") if fixed.get(name) is not None}

    @property
    def interval_shown(self) -> dict[str, tuple[float, float]]:
        """Intervals of the parameters as a person reads them."""
        low, high = (self.candidate.cause.shown(v) for v in self.interval)
        return {name: (min(low[name], high[name]), max(low[name], high[name])) for name in low}


@dataclass(frozen=True)
class Diagnosis:
    """What the measured data say about the model.

    Parameters
    ----------
    verdict : str
        NONE, NAMED, AMBIGUOUS or UNLISTED.
    causes : tuple of NamedCause
        Named causes by effect; empty unless NAMED.
    also_possible : tuple of NamedCause
        The whole set that the data cannot separate; empty unless AMBIGUOUS.
    unlisted_variables : tuple of str
        Columns that an effect outside the catalogue moves with.
    not_testable : tuple of (str, str)
        Causes and the column that each lacks.
    ruled_out : tuple of (str, str or None)
        Rivals that explain clearly less.
    faults : tuple of DataFault
        Data faults.
    rows_read, rows_used : int
        Rows of the table, and rows behind the verdict.
    mean_in, rms_in : float
        Misfit before anything is changed. [in]
    repeatability_in : float or None
        Standard deviation of one reading. [in]
    repeatability_source : str
        repeat readings, declared or unknown.
    smallest_rms_in : float
        Smallest effect that would have been found four times in five. [in]
    gain : Gain or None
        Gain of the extension on rows not used for the fit.
    terms : tuple of Term
        The extension; empty if the model is not extended.
    residual_u_in : float
        Scatter of what is left. [in]
    expected_scatter_in : float or None
        What reading and clearance gauges alone would leave. [in]
    remainder_p : float
        Chance of as much left if only noise is left. [1]
    remainder_is_noise : bool
        True if what is left looks like noise.
    used : DiagnosisTable
        The rows behind the verdict.
    predicted_in, misfit_in : ndarray, shape (n_used,)
        Prediction and misfit of these rows. [in]
    seed : int
        Seed.
    permutations : int
        Data sets drawn with nothing wrong.
    """

    verdict: str
    causes: tuple[NamedCause, ...]
    also_possible: tuple[NamedCause, ...]
    unlisted_variables: tuple[str, ...]
    not_testable: tuple[tuple[str, str], ...]
    ruled_out: tuple[tuple[str, str | None], ...]
    faults: tuple[DataFault, ...]
    rows_read: int
    rows_used: int
    mean_in: float
    rms_in: float
    repeatability_in: float | None
    repeatability_source: str
    smallest_rms_in: float
    gain: Gain | None
    terms: tuple[Term, ...]
    residual_u_in: float
    expected_scatter_in: float | None
    remainder_p: float
    remainder_is_noise: bool
    used: DiagnosisTable
    predicted_in: Array
    misfit_in: Array
    seed: int
    permutations: int


def diagnose(
    model: LinkageModel,
    table: DiagnosisTable,
    where: Discrepancies | None = None,
    *,
    own_causes: Sequence[Cause] = (),
    permutations: int = 999,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> Diagnosis:
    """Compare measured outputs with the model's predictions, and name what the model gets wrong.

    Works with any mechanism that has a calibrated model and any table of its measured output.

    Parameters
    ----------
    model : LinkageModel
        The model.
    table : DiagnosisTable
        Clearances, measured outputs and covariates.
    where : Discrepancies, optional
        Where inside the linkage causes act; without it only causes that need no place are tried.
    own_causes : sequence of Cause
        A user's own causes, beside the catalogue.
    permutations : int
        Data sets drawn with nothing wrong.
    seed : int
        Seed of all randomness.
    progress : callable, optional
        Called with the share that is done.

    Returns
    -------
    Diagnosis
        Verdict, causes, extension, gain and remainder.

    Raises
    ------
    InconclusiveDataError
        If the table cannot answer the question at all: what it lacks and what to record next time.
    """
    where = where or Discrepancies()
    read = len(table)
    table = _answerable(table)
    table, faults = _without_faults(model, table, where, None)
    catalogue = (*CATALOGUE, *own_causes)
    testable = [cause for cause in catalogue if set(cause.needs) <= set(table.columns)]
    blind = [cause for cause in catalogue if cause not in testable]
    not_testable = tuple((c.name, next(n for n in c.needs if n not in table.columns)) for c in blind)
    rng = np.random.default_rng(seed)
    case = _infer(model, table, where, (testable, blind), permutations, rng, progress)
    if case.finding.fit is not None:
        # A large effect hides slips of single cells: look again with what is named taken out.
        explained = case.columns[:, list(case.finding.chosen)] @ case.finding.fit.values
        again, more = _without_faults(model, table, where, explained)
        if more:
            table, faults = again, (*faults, *more)
            case = _infer(model, table, where, (testable, blind), permutations, rng, progress)
    return _report(model, table, read, faults, not_testable, case, seed, permutations, rng)


@dataclass(frozen=True)
class _Case:
    """Candidates with their effects, the misfit and what the inference makes of it."""

    candidates: Sequence[Candidate]
    columns: Array
    misfit: Array
    predicted: Array
    finding: Finding


def _without_faults(
    model: LinkageModel, table: DiagnosisTable, where: Discrepancies, explained: Array | None
) -> tuple[DiagnosisTable, tuple[DataFault, ...]]:
    """Repair or set aside rows with data faults, and rows whose linkage does not close."""
    read = len(table)
    table, faults, usable = screen_faults(model, table, explained)
    _single_slips(faults, read)
    table = table.take(usable & np.isfinite(table.measured_in))
    _enough(table)
    table = table.take(np.isfinite(build_scene(model, table, where).scene.over_in))
    _enough(table)
    return table, faults


def _infer(
    model: LinkageModel,
    table: DiagnosisTable,
    where: Discrepancies,
    causes: tuple[Sequence[Cause], Sequence[Cause]],
    permutations: int,
    rng: np.random.Generator,
    progress: Callable[[float], None] | None,
) -> _Case:
    plain = build_scene(model, table, where)
    scene = plain.scene
    testable, blind = causes
    candidates = [candidate for cause in testable for candidate in cause.candidates(scene)]
    candidates += [candidate for cause in blind for candidate in cause.stand_ins(scene)]
    columns = effect_columns(scene, plain.worst, candidates)
    moving = np.isfinite(columns).all(axis=0) & (np.abs(columns).max(axis=0) > 0.0)
    candidates = [c for c, keep in zip(candidates, moving, strict=True) if keep]
    columns = columns[:, moving]
    _comparable(table.measured_in, scene.over_in)
    misfit = table.measured_in - scene.over_in
    rows = Rows(
        scene.over_in,
        table.tails,
        table.gears,
        plain.u_filled_in,
        plain.u_shared_in,
        plain.u_read_in,
        measured_uncertainty(table),
        plain.drawn_in,
        *small_trends(table),
    )
    bank = build_bank(scene, columns)
    finding = Inference(misfit, rows, candidates, columns, bank, permutations, rng, progress).run()
    return _Case(candidates, columns, misfit, scene.over_in, finding)


def _answerable(table: DiagnosisTable) -> DiagnosisTable:
    """Keep the rows with a reading and at least one clearance; refuse a table without them."""
    measured = np.isfinite(table.measured_in)
    if not measured.any():
        raise InconclusiveDataError(
            "no row has a measured plunger displacement, so there is nothing to compare the prediction with",
            "Record plunger_displacement_in at mid-position, twice or three times, with every inspection.",
        )
    some = np.isfinite(table.clearance_in).any(axis=1)
    if not (measured & some).any():
        raise InconclusiveDataError(
            "no row with a measured displacement has a clearance, so nothing can be predicted",
            "Record the clearances of joints 1 to 5 at least, at the same inspection.",
        )
    return table.take(measured & some)


def _single_slips(faults: tuple[DataFault, ...], read: int) -> None:
    """Refuse a table in which so many rows look wrong that it is the table and no slip of the pen."""
    wrong = len({fault.place for fault in faults})
    if wrong > max(_MANY_FAULTS * read, 5):
        column = Counter(fault.column for fault in faults).most_common(1)[0][0]
        raise InconclusiveDataError(
            f"{wrong} of {read} rows look wrong, most often in {column}: these are no slips of single cells",
            "Check the unit and the convention of the clearances, and the unit of the displacements, column by column.",
        )


def _comparable(measured_in: Array, predicted_in: Array) -> None:
    """Refuse measured displacements that cannot be what the prediction is of: sign, unit, or a gauge that is stuck."""
    if np.ptp(measured_in) == 0.0:
        raise InconclusiveDataError(
            "every measured plunger displacement is the same, which no gauge that moves shows",
            "Check the gauge and the column; record what was read at each inspection.",
        )
    large = predicted_in >= np.median(predicted_in)
    ratio = float(np.median(measured_in[large] / np.maximum(predicted_in[large], 1e-9)))
    if 1.0 / _MOST_RATIO < ratio < _MOST_RATIO or not np.any(predicted_in > 0.0):
        return
    check = "Check the unit and the convention of the clearances, and that the gauge moves with the plunger."
    if ratio <= -1.0 / _MOST_RATIO:
        check = "Check the sign: over-travel is positive."
    elif ratio >= _MOST_RATIO:
        check = "Check the unit of the displacements."
    raise InconclusiveDataError(
        f"the measured displacements are {ratio:.2g} times the predicted ones: no cause on any list does that", check
    )


def _enough(table: DiagnosisTable) -> None:
    if len(table) < LEAST_ROWS:
        raise InconclusiveDataError(
            f"{len(table)} usable rows are too few: a cause would be a guess",
            f"Record at least {LEAST_ROWS} inspections with measured displacements; 100 and more are better.",
        )
    tails = len(np.unique(table.tails))
    if "tail_no" in table.factors and tails < LEAST_TAILS:
        raise InconclusiveDataError(
            f"all rows are of {tails} aircraft: what is wrong with the model cannot be told from what is theirs alone",
            f"Record inspections of at least {LEAST_TAILS} aircraft.",
        )
    if not np.nan_to_num(table.clearance_in).any():
        raise InconclusiveDataError(
            "every clearance is zero, so the prediction is the same everywhere",
            "Record clearances as measured; leave a joint blank that was not measured.",
        )


def _report(
    model: LinkageModel,
    table: DiagnosisTable,
    read: int,
    faults: tuple[DataFault, ...],
    not_testable: tuple[tuple[str, str], ...],
    case: _Case,
    seed: int,
    permutations: int,
    rng: np.random.Generator,
) -> Diagnosis:
    candidates, columns, misfit = case.candidates, case.columns, case.misfit
    predicted, finding = case.predicted, case.finding
    named = _named(candidates, columns, finding)
    raw = worst_case(model, np.nan_to_num(table.clearance_in)).over_in
    raw_misfit = table.measured_in - raw
    gain: Gain | None = None
    terms: tuple[Term, ...] = ()
    left = misfit
    if finding.verdict == "NAMED" and finding.fit is not None:
        held = columns[:, list(finding.chosen)]
        by_row = any(candidates[k].cause.name == "rigging_offset" for k in finding.chosen)
        gain = measure_gain(
            finding.noise, held, misfit, predicted, table.margin_in, table.record_id, table.tails, by_row, rng
        )
        left = misfit - held @ finding.fit.values
        terms = tuple(Term(n.candidate, n.value, n.interval) for n in named)
    repeatability, source = estimate_repeatability(table)
    return Diagnosis(
        verdict=finding.verdict,
        causes=named if finding.verdict == "NAMED" else (),
        also_possible=(*named, *_rivals(candidates, columns, finding)) if finding.verdict == "AMBIGUOUS" else (),
        unlisted_variables=finding.variables,
        not_testable=not_testable,
        ruled_out=finding.ruled_out,
        faults=faults,
        rows_read=read,
        rows_used=len(table),
        mean_in=float(np.mean(raw_misfit)),
        rms_in=float(np.sqrt(np.mean(raw_misfit**2))),
        repeatability_in=repeatability if np.isfinite(repeatability) else None,
        repeatability_source=source,
        smallest_rms_in=finding.smallest_rms_in,
        gain=gain,
        terms=terms,
        residual_u_in=float(np.std(left)),
        expected_scatter_in=_expected_scatter(model, table, repeatability),
        remainder_p=finding.remainder_p,
        # Where nothing stands out beyond chance, what is left is noise by the same test.
        remainder_is_noise=finding.verdict == "NONE" or (finding.verdict == "NAMED" and finding.remainder_p > 0.05),
        used=table,
        predicted_in=predicted,
        misfit_in=misfit,
        seed=seed,
        permutations=permutations,
    )


def _named(candidates: Sequence[Candidate], columns: Array, finding: Finding) -> tuple[NamedCause, ...]:
    if finding.fit is None:
        return ()
    found = []
    p_values = (*finding.p_values, *[None] * len(finding.chosen))
    for place, k in enumerate(finding.chosen):
        value, error = float(finding.fit.values[place]), float(finding.fit.errors[place])
        effect = columns[:, k] * value
        found.append(
            NamedCause(
                candidates[k],
                float(np.sqrt(np.mean(effect**2))),
                p_values[place],
                value,
                (value - 1.96 * error, value + 1.96 * error),
                effect,
            )
        )
    return tuple(sorted(found, key=lambda c: -c.effect_rms_in))


def _rivals(candidates: Sequence[Candidate], columns: Array, finding: Finding) -> tuple[NamedCause, ...]:
    empty = np.zeros(len(columns))
    return tuple(NamedCause(candidates[k], 0.0, None, 0.0, (0.0, 0.0), empty) for k in finding.rivals)


def _expected_scatter(model: LinkageModel, table: DiagnosisTable, repeatability: float) -> float | None:
    """Scatter that the gauges alone cause: readings, and clearances through the mechanism. [in]"""
    if not np.isfinite(repeatability):
        return None
    measured = np.isfinite(table.clearance_in)
    amplification = model.plunger_amplification()
    clearance = np.mean(table.gauge_u_in**2 * np.sum((measured * amplification) ** 2, axis=1))
    return float(np.sqrt(measured_uncertainty(table) ** 2 + clearance))
