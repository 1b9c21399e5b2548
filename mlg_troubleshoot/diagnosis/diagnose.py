"""The loop: data, misfit, cause, extension, gain, remainder.

What an extension gains on rows that it was not fitted to (M10): in displacement and in
decisions.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from mlg_troubleshoot.arrays import Array, Mask, Probability, Size, Wholes, rms
from mlg_troubleshoot.diagnosis.causes import with_own
from mlg_troubleshoot.diagnosis.causes.base import Candidate, Cause, Scene, offered
from mlg_troubleshoot.diagnosis.causes.linkage import Block, JointFactors
from mlg_troubleshoot.diagnosis.causes.reading import ConventionSlip, as_meant
from mlg_troubleshoot.diagnosis.explain import (
    DetectableEffect,
    Finding,
    MisfitProblem,
    WeighedCause,
    build_bank,
    explain,
    p_value_of,
)
from mlg_troubleshoot.diagnosis.extension import Term, build_scene, effects_of
from mlg_troubleshoot.diagnosis.faults import (
    BY_CHANCE,
    DataCondition,
    DataFault,
    first_few,
    restored_joints,
    screen_faults,
)
from mlg_troubleshoot.diagnosis.noise import (
    Rows,
    estimate_repeatability,
    less_expected,
    measured_uncertainty,
)
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.diagnosis.wear import visits
from mlg_troubleshoot.errors import InconclusiveDataError
from mlg_troubleshoot.gear.gear import Discrepancies
from mlg_troubleshoot.gear.linkage import LinkageModel, worst_of_sense
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.misfit.columns import (
    EffectColumns,
    NoiseModel,
    folds_of,
    held_out_part,
    likelier,
    shrunk,
)
from mlg_troubleshoot.misfit.posterior import Context, Key
from mlg_troubleshoot.misfit.simulation_result import MisfitVerdict as Verdict
from mlg_troubleshoot.results import JsonOutput
from mlg_troubleshoot.units import MM_PER_IN

# With fewer tails none can be held out.
LEAST_TAILS = 4


@dataclass(frozen=True, slots=True)
class Gain:
    """Held-out misfit and decisions before and after.

    Attributes
    ----------
    rms_before_in, rms_after_in : float
        Root mean square misfit of held-out rows. [in]
    share_interval : tuple of float
        95 % interval of the share of the mean square misfit that is removed, over tails. [1]
    false_within_before, false_within_after : int
        Rows predicted within whose measured displacement is outside.
    false_outside_before, false_outside_after : int
        Rows predicted outside whose measured displacement is within.
    verdicts_changed : tuple of str
        Records whose predicted side of the margin changes.
    held_out_by : str or None
        What was held out together: ``tail`` or ``row``.
    better : bool
        True if held-out rows are likelier with the extension than without, and their misfit is
        smaller.
    worse : bool
        True if they are less likely, and their misfit is larger.
    """

    json_names = """
        held_out_rms_before_in=rms_before_in held_out_rms_after_in=rms_after_in
        share_removed_interval_95=share_interval held_out_by false_within_before false_within_after
        false_outside_before false_outside_after verdicts_changed
    """
    rms_before_in: Size
    rms_after_in: Size
    false_within_before: int
    false_within_after: int
    false_outside_before: int
    false_outside_after: int
    verdicts_changed: tuple[str, ...]
    share_interval: tuple[float, float] = (0.0, 0.0)
    held_out_by: str | None = None
    better: bool = False
    worse: bool = False

    @classmethod
    def of(
        cls, table: DiagnosisTable, measured: Array, before: Array, after: Array, **held_out: Any
    ) -> Gain:
        """Count the decisions of two predictions, shape (n,) each. [in]"""
        outside = np.abs(measured) > table.margin_in
        said_before = np.abs(before) <= table.margin_in
        said_after = np.abs(after) <= table.margin_in
        return cls(
            rms_before_in=rms(measured - before),
            rms_after_in=rms(measured - after),
            false_within_before=int(np.sum(said_before & outside)),
            false_within_after=int(np.sum(said_after & outside)),
            false_outside_before=int(np.sum(~said_before & ~outside)),
            false_outside_after=int(np.sum(~said_after & ~outside)),
            verdicts_changed=tuple(
                table.record_id[int(i)] for i in np.flatnonzero(said_before != said_after)
            ),
            **held_out,
        )


def measure_gain(
    noise: NoiseModel,
    columns: Array,
    misfit: Array,
    predicted: Array,
    as_read: Array,
    table: DiagnosisTable,
    block: Context | None = None,
) -> Gain:
    """Cross-validate an extension; rows of one tail are never on both sides, unless the others
    cannot teach it. It is fitted to the misfit of the likeliest clearances, and its gain is that of
    a check, which predicts from clearances as they were read.
    """
    rows = np.arange(len(misfit))
    tails = noise.tails if noise.tails.max() + 1 >= LEAST_TAILS else None
    fold, held_out_by = folds_of(rows, tails, columns, rows)
    expected = less_expected(misfit, predicted)
    known = None if block is None else (block.shared_in, block.covariance)
    correction = held_out_part(noise, columns, expected, fold, known)
    measured = predicted + misfit
    before = measured - as_read
    after = before - correction
    smaller = bool(rms(after) < rms(before))
    more_likely = likelier(noise, expected, expected - correction, fold)
    return Gain.of(
        table,
        measured,
        as_read,
        as_read + correction,
        share_interval=_interval_of_gain(before, after, rows if tails is None else tails),
        held_out_by="tail" if held_out_by == "group" else "row",
        better=smaller and more_likely,
        worse=not (smaller or more_likely),
    )


def _interval_of_gain(before: Array, after: Array, groups: Wholes) -> tuple[float, float]:
    """95 % interval over tails of the share of mean square misfit removed, of a ratio's error."""
    square_before = np.bincount(groups, before**2)
    square_after = np.bincount(groups, after**2)
    whole = max(float(square_before.sum()), 1e-30)
    left = float(square_after.sum()) / whole
    reach = 1.96 * float(np.linalg.norm(square_after - left * square_before)) / whole
    return 1.0 - left - reach, 1.0 - left + reach


class NotTestable(NamedTuple):
    """A cause that the table cannot show, for want of a column."""

    cause: str
    missing_column: str


class RuledOut(NamedTuple):
    """A cause that would explain something alone, but hardly acts."""

    cause: str
    target: str | None


class RowFarOff(NamedTuple):
    """A row far off, and what nothing explains of it. [in]"""

    record_id: str
    residual_in: float


LEAST_ROWS = 20
# Times the rows of a table beyond which further ones are not counted. [1]
_MOST_TIMES = 20
# Share of rows from which data faults are not errors in single cells. [1]
_MANY_FAULTS = 0.15
# Measured over predicted displacement: further from 1 than this, or negative, is not a misfit. [1]
_MOST_RATIO = 4.0
# Above this ratio readings against the prediction are not an error of the sign, which gives -0.9 to
# -1.1 (20 simulated tables with one cause or none), nor of a unit: that the clearances tell of them
# beyond chance is enough. [1]
_SIGN_SLIP = -0.75
# Else: where one scale leaves more than this of the variance, a slip of the sign or the unit is not
# what is wrong (of 60 tables with one cause, S = 10 and 25, seeds 8,700,000 and on, at most 0.25 in
# 57). [1]
_NO_SCALE = 0.3


@dataclass(frozen=True, repr=False, eq=False)
class NamedCause(Term):
    """A cause that the data name, or cannot rule out: a term of the extension with what speaks for
    it.

    Parameters
    ----------
    candidate, value, interval
        As in a term.
    effect_in : ndarray, shape (n_used,)
        Its effect in each row used. [in]
    probability : float
        Probability that something of its name acts. [1]
    class_probability : float
        Probability that it acts, or something that these rows cannot tell from it. [1]
    """

    json_names = """
        cause=candidate.cause.name target=candidate.target sentence=candidate.sentence effect_rms_in
        probability class_probability parameters interval_95=interval_shown
        separating_reading=candidate.separates
    """
    effect_in: Array
    probability: Probability
    class_probability: Probability

    @property
    def effect_rms_in(self) -> float:
        """Root mean square of its effect over the rows. [in]"""
        return rms(self.effect_in)

    @property
    def rows_acting(self) -> int:
        """Number of rows in which it acts. [1]"""
        return int(np.count_nonzero(self.effect_in))

    @property
    def acting_rms_in(self) -> float:
        """Root mean square of its effect over the rows in which it acts. [in]"""
        return float(np.linalg.norm(self.effect_in) / np.sqrt(max(self.rows_acting, 1)))

    @property
    def predicts(self) -> bool:
        """True if the model can be extended by it: it is about the gear, some joint's share of it
        is known, and its size is plausible.
        """
        factors = self.candidate.setting.get("factors", True)
        return self.candidate.cause.extends and bool(factors) and self.is_plausible

    @property
    def is_plausible(self) -> bool:
        """True if an extension may have its size."""
        return self.candidate.cause.is_plausible(self.candidate, self.value, ())

    @property
    def parameters(self) -> dict[str, float | str]:
        """The parameters as a person reads them, with the date of a change or the exponent of
        wear.
        """
        fixed = self.candidate.setting
        return self._shown("factors", self.value) | {
            name: fixed[name]
            for name in ("since", "until", "wear_exponent")
            if fixed.get(name) is not None
        }

    @property
    def interval_shown(self) -> dict[str, tuple[float, float]]:
        """Intervals of the parameters as a person reads them."""
        low, high = map(self._shown, ("low", "high"), self.interval)
        return {name: (min(low[name], high[name]), max(low[name], high[name])) for name in low}

    def _shown(self, of_factors: str, value: float) -> dict[str, Any]:
        """A value of the parameter as a person reads it; of all-joint effects each factor."""
        factors = self.candidate.setting.get(of_factors)
        if factors is None:
            return self.candidate.cause.shown(value)
        return {f"factor_{joint}": factor for joint, factor in factors.items()}


@dataclass(frozen=True, slots=True)
class FurtherInspections:
    """What would split the likeliest causes that the data cannot separate.

    Parameters
    ----------
    between : tuple of Candidate
        The two causes that it splits, or the one that it distinguishes from nothing.
    gear : str
        Gear in which the two differ most at its latest inspection.
    apart_in : float
        How far they differ there. [in]
    inspections : int or None
        Further inspections like these after which one of the two leads by as much as a name needs;
        None if no number would do.
    power : float
        Chance that it does, whichever acts. [1]
    """

    between: tuple[Candidate, ...]
    gear: str
    apart_in: float
    inspections: int | None
    power: float = 0.8


@dataclass(frozen=True, repr=False, eq=False)
class Diagnosis(JsonOutput):
    """What the measured data say about the model.

    Parameters
    ----------
    verdict : Verdict
        NONE, NAMED, AMBIGUOUS or UNLISTED.
    causes : tuple of NamedCause
        Named causes by effect; empty unless NAMED.
    also_possible : tuple of NamedCause
        The whole set that the data cannot separate; empty unless AMBIGUOUS.
    beside : tuple of NamedCause
        The set of which something acts in addition to what is named; empty unless NAMED.
    further : FurtherInspections or None
        What would split the likeliest of such a set, all-joint effects left out; None if none is
        open.
    unlisted_variables : tuple of str
        Columns that an effect outside the catalogue moves with.
    not_testable : tuple of (str, str)
        Causes and the column that each lacks.
    unsaid : tuple of str
        Statements that so few rows or gears cannot carry.
    unlisted_rms_in : float
        Root mean square of that effect. [in]
    unlisted_tails : tuple of str
        One of two groups of aircraft that differ, if it is that.
    probabilities : mapping of (str, str or None) to float
        Probability that each cause acts, by its name and target. [1]
    weighed : tuple of WeighedCause
        What Bayes' rule makes of every name: how often it is expected, what the rows say of it
        alone, how likely it is; the one with the highest odds first.
    p_nothing, p_unlisted : float
        Probability that nothing is wrong, and that something is that no list has. [1]
    p_left : float
        Probability that something else acts in addition to what is named. [1]
    remainder_p : float
        p-value of the residual: of the shape of the bank that stands out most, as one of all of
        them (Bonferroni). [1]
    ruled_out : tuple of (str, str or None)
        Rivals that would explain something alone, but hardly act.
    faults, corrected : tuple of DataFault
        Data faults, and clearances that a named convention slip says were meant otherwise.
    rows_read, rows_used : int
        Rows of the table, and rows behind the verdict.
    unread : tuple of int
        Joints that no row has a clearance of: they count as worn with landings like the others of
        their gear.
    unread_in, unread_u_in : float
        What they add to the prediction on average, and how far the fleet may lie off that. [in]
    mean_in, rms_in : float
        Misfit before anything is changed, clearances that were not read as expected. [in]
    repeatability_in : float or None
        Standard deviation of one reading. [in]
    repeatability_source : str
        repeat readings, declared or unknown.
    detectable : tuple of (str, float)
        Root mean square from which an effect of each listed cause is detected with 80 % power, the
        easiest form first. [in]
    gain : Gain or None
        Gain of the extension on held-out rows.
    terms : tuple of Term
        The extension; empty if the model is not extended.
    residual_u_in : float
        Scatter of the residual. [in]
    expected_scatter_in : float or None
        What reading and clearance gauges alone would leave. [in]
    remainder_is_noise : bool
        True if the residual is noise, more likely than not.
    far_off_in : mapping of int to float
        Places of rows that lie too far off for scatter and that nothing explains, and their
        residuals. [in]
    used : DiagnosisTable
        The rows behind the verdict.
    predicted_in, misfit_in : ndarray, shape (n_used,)
        Prediction and misfit of these rows. [in]
    beliefs : Beliefs
        What was believed beforehand.
    condition : tuple of DataCondition
        How the readings were written down, where it bears on the answer; empty for a table alone.
    """

    json_names = """
        schema_version rows.read=rows_read rows.used=rows_used rows.set_aside=rows_set_aside
        data_faults=faults misfit.mean_in=mean_in misfit.rms_in=rms_in
        misfit.repeatability_in=repeatability_in misfit.repeatability_source=repeatability_source
        verdict causes also_possible beside p_nothing p_unlisted sure=beliefs.sure
        unlisted_variables unlisted_tails unlisted_rms_in not_testable cannot_say=unsaid ruled_out
        columns_used=used.columns columns_left_out=used.left_out smallest_detectable_rms_in
        detectable gain=decisions data_condition=condition remainder.p_value=remainder_p
        remainder.p_something_else=p_left remainder.looks_like_noise=remainder_is_noise
        remainder.rms_in=residual_u_in remainder.expected_from_gauges_in=expected_scatter_in
        remainder.rows_far_off=rows_far_off
    """
    verdict: Verdict
    causes: tuple[NamedCause, ...]
    also_possible: tuple[NamedCause, ...]
    beside: tuple[NamedCause, ...]
    further: FurtherInspections | None
    unlisted_variables: tuple[str, ...]
    unlisted_rms_in: float
    unlisted_tails: tuple[str, ...]
    probabilities: Mapping[Key, float]
    weighed: tuple[WeighedCause, ...]
    p_nothing: Probability
    p_unlisted: Probability
    p_left: Probability
    remainder_p: Probability
    not_testable: tuple[NotTestable, ...]
    unsaid: tuple[str, ...]
    ruled_out: tuple[RuledOut, ...]
    faults: tuple[DataFault, ...]
    corrected: tuple[DataFault, ...]
    rows_read: int
    rows_used: int
    unread: tuple[int, ...]
    unread_in: float
    unread_u_in: float
    mean_in: float
    rms_in: float
    repeatability_in: float | None
    repeatability_source: str
    detectable: tuple[DetectableEffect, ...]
    gain: Gain | None
    terms: tuple[Term, ...]
    residual_u_in: float
    expected_scatter_in: float | None
    remainder_is_noise: bool
    far_off_in: Mapping[int, float]
    used: DiagnosisTable
    predicted_in: Array
    misfit_in: Array
    beliefs: Beliefs
    condition: tuple[DataCondition, ...] = ()

    @property
    def rows_set_aside(self) -> int:
        """Rows that the verdict does not rest on."""
        return self.rows_read - self.rows_used

    @property
    def smallest_detectable_rms_in(self) -> float | None:
        """Of the cause that is detected most easily. [in]"""
        return self.detectable[0].rms_in if self.detectable else None

    @property
    def decisions(self) -> Gain:
        """The gain; where the model is not extended, everything after is as before."""
        same = self.predicted_in
        return self.gain or Gain.of(self.used, self.used.measured_in, same, same)

    @property
    def rows_far_off(self) -> list[RowFarOff]:
        """Rows that lie too far off for scatter and that nothing explains."""
        return [RowFarOff(self.used.record_id[n], left) for n, left in self.far_off_in.items()]


def diagnose(
    model: LinkageModel,
    table: DiagnosisTable,
    where: Discrepancies | None = None,
    *,
    own_causes: Sequence[Cause] = (),
    ensemble: Sequence[LinkageModel] = (),
    beliefs: Beliefs | None = None,
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
        A user's own causes, in addition to the catalogue.
    ensemble : sequence of LinkageModel
        Other linkages that the true one may be instead, from which the cause `geometry` is made.
    beliefs : Beliefs, optional
        What is believed beforehand, and from which probability something is said.
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
    # The matrices are small: threads that wait for each other cost several times what they save.
    with threadpool_limits(1, "blas"):
        where = where or Discrepancies()
        report_progress = progress or (lambda _share: None)
        read = len(table)
        table = _answerable(table)
        screened = screen_faults(model, table)
        faults = screened[1]
        plain = _scene_of(model, screened, where)
        catalogue = with_own(own_causes)
        # What never varies cannot be distinguished from a linkage of other dimensions.
        columns = plain[0].table.varying
        not_testable = tuple(
            NotTestable(cause.name, column)
            for cause in catalogue
            if (column := cause.lacks(columns))
        )
        believed = beliefs or Beliefs()

        def explained(plain: tuple[Scene, Rows]) -> _Case:
            return _explained(*plain, catalogue, columns, ensemble, believed)

        case = explained(plain)
        report_progress(0.6)
        if case.acts:
            # A large effect hides slips of single cells: look again with what is likely taken out.
            screened = screen_faults(model, case.scene.table, case.explained)
            if screened[1]:
                faults = (*faults, *screened[1])
                case = explained(_scene_of(model, screened, where))
        if not table.doubt:
            # Rows that are taken for a cause hide others: look again.
            for _ in range(2):
                repaired, more = restored_joints(case.scene, case.accounts, believed)
                if not more:
                    break
                faults = (*faults, *more)
                case = explained(build_scene(model, repaired, where))
        report_progress(1.0)
        return _report(model, case.scene.table, read, faults, not_testable, case)


@dataclass(frozen=True)
class _Case(Finding):
    """What the posterior says, and what is reported fitted: effects of which candidates and block,
    of which size.
    """

    scene: Scene
    chosen: tuple[int, ...]
    block: Block | None
    values: Array
    covariance: Array

    @property
    def acts(self) -> bool:
        """True if some listed cause is likely to act."""
        return self.follows.verdict in {Verdict.NAMED, Verdict.AMBIGUOUS}

    @property
    def columns(self) -> Array:
        """Effects of what is reported to act, the all-joint ones last. [in / unit]"""
        held = self.problem.columns.take(self.chosen)
        return held if self.block is None else np.hstack([held, self.block.shared_in])

    @property
    def explained(self) -> Array:
        """What is likely to act does to each row. [in]"""
        return self.columns @ self.values

    @property
    def accounts(self) -> list[tuple[Array, float]]:
        """The misfit with nothing taken out, and without what is likely to act; the
        logarithmic prior of each, every value that is fitted counted (Schwarz's criterion).
        """
        whole = (self.problem.misfit, 0.0)
        if not self.acts:
            return [whole]
        found = self.posterior
        prior = found.effects.log_prior[list(self.chosen)].sum()
        prior += found.contexts[self.best.context].log_prior
        fitted = self.columns.shape[1] * np.log(len(self.problem.misfit))
        return [whole, (self.problem.misfit - self.explained, float(prior - 0.5 * fitted))]

    @property
    def effects_in(self) -> Array:
        """What each that is reported does to each row, shape (n, k). [in]"""
        return self.columns * self.values


def _scene_of(
    model: LinkageModel,
    screened: tuple[DiagnosisTable, tuple[DataFault, ...], Mask],
    where: Discrepancies,
) -> tuple[Scene, Rows]:
    """Predict the rows, those with data faults repaired or set aside, without rows whose linkage
    does not close.
    """
    table, faults, usable = screened
    _single_slips(faults, len(table))
    kept = usable & np.isfinite(table.measured_in)
    while True:
        table = table.take(kept)
        _enough(table)
        plain = build_scene(model, table, where)
        # With all its clearances, and without any one of them: what each adds must be known.
        moved = np.column_stack([plain[0].over_in, plain[0].contribution_in])
        kept = np.asarray(np.isfinite(moved).all(axis=1))
        if kept.all():
            return plain


def _explained(
    scene: Scene,
    rows: Rows,
    causes: Sequence[Cause],
    columns: Collection[str],
    ensemble: Sequence[LinkageModel],
    beliefs: Beliefs,
) -> _Case:
    """Say what may explain the rows, and fit the likeliest explanation of what is said."""
    table = scene.table
    _comparable(table.measured_in, scene.over_in, scene.contribution_in)
    candidates = list(offered(causes, scene, columns))
    if table.doubt:
        candidates = [replace(c, stands_in=not c.cause.is_distinct()) for c in candidates]
    moving: list[Candidate] = []

    def moved() -> Iterator[Array]:
        for candidate, column in zip(candidates, effects_of(scene, candidates), strict=True):
            if np.isfinite(column).all() and column.any():
                moving.append(candidate)
                yield column

    effects = EffectColumns.made(len(table), moved())
    blocks = [
        block
        for cause in causes
        if isinstance(cause, JointFactors)
        for block in cause.blocks(scene, ensemble)
    ]

    problem = MisfitProblem(
        table.measured_in - scene.over_in,
        rows,
        moving,
        effects,
        build_bank(scene, effects),
        blocks,
        causes,
        beliefs,
        bool(table.doubt),
    )
    finding = explain(problem)
    best = finding.best
    every = finding.posterior.effects
    chosen = tuple(k for k in best.members if k < len(moving))
    others = [k for k in best.members if k >= len(moving)]
    context = finding.posterior.contexts[best.context]
    block = context if isinstance(context, Block) else None
    noise = context.behind(finding.noise)
    noise = noise.with_effects(every.kept.take(others) * every.size[others])
    known = context.shared_in, context.covariance
    values, covariance = shrunk(noise, effects.take(chosen), *known, problem.expected)
    count = len(chosen) + (0 if block is None else block.shared_in.shape[1])
    fitted = values[:count], covariance[:count, :count]
    return _Case(problem, finding.follows, finding.noise, scene, chosen, block, *fitted)


def _answerable(table: DiagnosisTable) -> DiagnosisTable:
    """Keep the rows with a reading and at least one clearance; refuse a table without them."""
    measured = np.isfinite(table.measured_in)
    if not measured.any():
        raise InconclusiveDataError(
            "no row has a measured plunger displacement, so there is nothing to compare the"
            " prediction with",
            "Record plunger_displacement_in at mid-position, twice or three times, with every"
            " inspection.",
        )
    some = np.isfinite(table.clearance_in).any(axis=1)
    if not (measured & some).any():
        raise InconclusiveDataError(
            "no row with a measured displacement has a clearance, so nothing can be predicted",
            "Record the clearances of joints 1 to 5 at least, at the same inspection.",
        )
    return table.take(measured & some).in_order()


def _single_slips(faults: tuple[DataFault, ...], read: int) -> None:
    """Refuse a table in which so many rows look wrong that the whole table is wrong, not single
    cells.
    """
    rows = [str(row) for _place, row in sorted({(fault.place, fault.row) for fault in faults})]
    if len(rows) > max(_MANY_FAULTS * read, 5):
        column = Counter(fault.column for fault in faults).most_common(1)[0][0]
        raise InconclusiveDataError(
            f"{len(rows)} of {read} rows look wrong, most often in {column} (rows"
            f" {first_few(rows)}): these are not errors in single cells",
            "Check the unit and the convention of the clearances, and the unit of the"
            " displacements, in these rows: did one technician, base or gauge write them?",
        )


def _comparable(measured_in: Array, predicted_in: Array, contribution_in: Array) -> None:
    """Refuse measured displacements that cannot be what the prediction is of: sign, unit, or a
    gauge that is stuck.
    """
    if np.ptp(measured_in) == 0.0:
        raise InconclusiveDataError(
            "every measured plunger displacement is the same, but a working gauge would vary",
            "Check the gauge and the column; record what was read at each inspection.",
        )
    large = predicted_in >= np.median(predicted_in)
    ratio = float(np.median(measured_in[large] / np.maximum(predicted_in[large], 1e-9)))
    if 1.0 / _MOST_RATIO < ratio < _MOST_RATIO or not np.any(predicted_in > 0.0):
        return
    no_slip = _SIGN_SLIP < ratio < 0.0
    if _explained_by_clearances(measured_in, predicted_in, contribution_in, no_slip):
        return
    check = (
        "Check the unit and the convention of the clearances, and that the gauge moves with the"
        " plunger."
    )
    if ratio <= -1.0 / _MOST_RATIO:
        check = "Check the sign: over-travel is positive."
    elif ratio >= _MOST_RATIO:
        check = "Check the unit of the displacements."
    raise InconclusiveDataError(
        f"the measured displacements are {ratio:.2g} times the predicted ones: no known cause does"
        " that",
        check,
    )


def _explained_by_clearances(
    measured_in: Array, predicted_in: Array, contribution_in: Array, no_sign_slip: bool
) -> bool:
    """Say whether factors of −1 to 1 for each joint explain the readings better than chance, than
    one scale of the prediction and than a joint that was written in millimetres; where no sign is
    wrong, also better than a constant.
    """
    from scipy.optimize import lsq_linear
    from scipy.special import chdtri

    factors = lsq_linear(contribution_in, measured_in, (-1.0, 1.0)).x
    in_mm = predicted_in[:, None] - (1.0 - 1.0 / MM_PER_IN) * contribution_in
    simple = np.column_stack([predicted_in, in_mm])
    one = measured_in[:, None] - simple * (measured_in @ simple / np.sum(simple**2, axis=0))
    constant = np.var(measured_in)
    alone = constant if no_sign_slip else np.mean(one**2, axis=0).min()
    left = np.mean((measured_in - contribution_in @ factors) ** 2)
    surely = len(one) * np.log(min(alone, constant) / left)
    beyond_chance = surely > chdtri(contribution_in.shape[1], BY_CHANCE)
    return bool(beyond_chance and alone > _NO_SCALE * constant)


def _unsaid(table: DiagnosisTable) -> tuple[str, ...]:
    """What a table cannot say, though it is not refused."""
    found = [table.doubt] if table.doubt else []
    if len(np.unique(table.tails)) < LEAST_TAILS:
        found.append(
            f"With fewer than {LEAST_TAILS} aircraft it cannot be said whether other gears do the"
            " same, nor where this plunger rod should be rigged; the gain is measured on rows of"
            " the same gears."
        )
    if len(table) < LEAST_ROWS:
        found.append(
            f"With fewer than {LEAST_ROWS} rows small effects stay unseen, and scatter is a rough"
            " guess."
        )
    return tuple(found)


def _enough(table: DiagnosisTable) -> None:
    if len(table) < LEAST_ROWS:
        raise InconclusiveDataError(
            f"{len(table)} usable row{' is' if len(table) == 1 else 's are'} too few: a cause would"
            " be a guess",
            f"Record at least {LEAST_ROWS} inspections with measured displacements; 100 and more"
            " are better.",
        )
    tails = len(np.unique(table.tails))
    if "tail_no" in table.factors and tails < LEAST_TAILS:
        raise InconclusiveDataError(
            f"all rows are of {tails} aircraft: model errors cannot be distinguished from effects"
            " of single aircraft",
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
    rows_read: int,
    faults: tuple[DataFault, ...],
    not_testable: tuple[NotTestable, ...],
    case: _Case,
) -> Diagnosis:
    misfit = case.problem.misfit
    causes, open_ = _told(case)
    variables, unlisted_in = case.unlisted
    apart = table.tails[unlisted_in != 0.0] if variables == ("tail_no",) else ()
    read = np.isfinite(table.clearance_in)
    seen = np.asarray(read.any(axis=0))
    as_read = np.where(read, table.clearance_in, case.scene.clearance_in)
    raw = worst_of_sense(model, as_read)[0]
    raw_misfit = table.measured_in - raw
    verdict = case.follows.verdict
    gain = _gain(case, raw) if verdict is Verdict.NAMED else None
    if gain is not None and gain.worse:
        verdict = Verdict.AMBIGUOUS
        open_ = (*causes, *open_)
        causes = ()
        gain = None
    left = misfit - np.sum([cause.effect_in for cause in causes], axis=0)
    repeatability, source = estimate_repeatability(table)
    residual = float(np.std(left))
    expected = _expected_scatter(model, table, repeatability)
    far = case.far_off(left, expected or case.noise.scale_in)
    chances = case.posterior
    return Diagnosis(
        verdict=verdict,
        causes=causes,
        also_possible=() if causes else open_,
        beside=open_ if causes else (),
        further=_further(case, open_),
        unlisted_variables=variables,
        unlisted_rms_in=rms(unlisted_in),
        unlisted_tails=tuple(map(str, np.unique(apart))),
        probabilities=case.follows.listed,
        weighed=case.weighed,
        p_nothing=chances.nothing,
        p_unlisted=chances.unlisted,
        p_left=case.left,
        remainder_p=p_value_of(
            case.problem, left - case.problem.misfit + case.problem.expected, case.noise
        ),
        not_testable=not_testable,
        unsaid=_unsaid(table),
        ruled_out=tuple(RuledOut(*name) for name in case.ruled_out),
        faults=faults,
        corrected=_corrected(model, table, causes),
        rows_read=rows_read,
        rows_used=len(set(table.record_id)),
        unread=tuple(n for n, some in zip(model.joint_numbers, seen, strict=True) if not some),
        unread_in=float(np.mean(case.scene.contribution_in[:, ~seen].sum(axis=1))),
        unread_u_in=float(np.sqrt(np.mean(np.sum(case.problem.rows.unread_in**2, axis=1)))),
        mean_in=float(np.mean(raw_misfit)),
        rms_in=rms(raw_misfit),
        repeatability_in=repeatability if np.isfinite(repeatability) else None,
        repeatability_source=source,
        detectable=case.detectable,
        gain=gain,
        # What predicts aircraft that it was not fitted to no better is not written.
        terms=(
            tuple(Term(c.candidate, c.value, c.interval) for c in causes if c.predicts)
            if gain is not None and gain.better
            else ()
        ),
        residual_u_in=residual,
        expected_scatter_in=expected,
        # What the gauges alone leave is noise, however it lies.
        remainder_is_noise=case.left < 0.5 or (expected is not None and residual <= expected),
        far_off_in={place: float(left[place]) for place in far.tolist()},
        used=table,
        predicted_in=case.scene.over_in,
        misfit_in=misfit,
        beliefs=case.problem.beliefs,
    )


def _gain(case: _Case, as_read: Array) -> Gain:
    """What the extension gains on tails that it was not fitted to, on rows if it is about one tail.

    What else acts, being one of a set, is noise of the size that it was found with.
    """
    block = case.block
    said = case.follows.said
    keys = [case.problem.candidates[k].key for k in case.chosen]
    firm = [place for place, key in enumerate(keys) if key in said]
    others = [place for place in range(len(keys)) if place not in firm]
    context = case.posterior.contexts[case.best.context]
    noise = case.noise
    if context.name not in said:
        noise = context.within(noise)
        block = None
    if others:
        noise = noise.with_effects(case.effects_in[:, others])
    return measure_gain(
        noise,
        case.columns[:, firm],
        case.problem.misfit,
        case.scene.over_in,
        as_read,
        case.scene.table,
        block,
    )


def _corrected(
    model: LinkageModel, table: DiagnosisTable, named: Sequence[NamedCause]
) -> tuple[DataFault, ...]:
    """Each clearance that a named slip of convention concerns: what was entered, and what it is in
    the analysis.
    """
    cells: list[DataFault] = []
    for candidate in (c.candidate for c in named if isinstance(c.candidate.cause, ConventionSlip)):
        meant = as_meant(table, candidate.setting).clearance_in
        for place, j in np.argwhere(np.isfinite(meant) & (meant != table.clearance_in)).tolist():
            column = f"clearance_{model.joint_numbers[j]}_in"
            entered, right = (f"{values[place, j]:.4g}" for values in (table.clearance_in, meant))
            cells.append(DataFault.at(table, place, column, "other_convention", entered, right))
    return tuple(cells)


def _told(case: _Case) -> tuple[tuple[NamedCause, ...], tuple[NamedCause, ...]]:
    """The causes that are named, by effect, and those of which something acts, the likeliest
    first.
    """
    follows = case.follows
    fitted: dict[Key, tuple[Candidate, float, tuple[float, float], Array]] = {}
    errors = np.sqrt(np.diag(case.covariance))
    for place, k in enumerate(case.chosen):
        candidate = case.problem.candidates[k]
        value = float(case.values[place])
        interval = _interval(value, float(errors[place]))
        fitted[candidate.key] = candidate, value, interval, case.effects_in[:, place]
    if case.block is not None:
        k = len(case.chosen)
        change = case.values[k:]
        candidate = case.block.candidate(change, case.covariance[k:, k:])
        fitted[candidate.key] = candidate, 1.0, (1.0, 1.0), case.block.shared_in @ change
    rivals = {block.name: Candidate(block.cause) for block in case.problem.blocks}

    def found(key: Key) -> NamedCause:
        if key not in fitted:
            rival = rivals.get(key) or case.problem.likeliest(key, case.posterior)[1]
            fitted[key] = rival, 0.0, (0.0, 0.0), np.zeros(len(case.problem.misfit))
        return NamedCause(*fitted[key], follows.probability(key), follows.class_probability(key))

    named = sorted((found(key) for key in follows.said), key=lambda cause: -cause.effect_rms_in)
    return tuple(named), tuple(found(key) for key in case.open)


def _further(case: _Case, open_: tuple[NamedCause, ...]) -> FurtherInspections | None:
    """Where the likeliest of a set differs most from its likeliest rival, another one or nothing,
    and how many further inspections like these distinguish them.
    """
    problem = case.problem
    table = case.scene.table
    single = {c.key for c in problem.candidates}
    rivals = [cause.candidate for cause in open_ if cause.candidate.key in single][:2]
    if not rivals:
        return None
    chances = [case.follows.probability(rival.key) for rival in rivals]
    if case.posterior.nothing > min(chances[1:], default=0.0):
        rivals = rivals[:1]
        chances = [chances[0], case.posterior.nothing]
    noise = case.noise
    apart = np.zeros(len(table))
    none = np.empty((len(table), 0))
    for rival, sign in zip(rivals, (1.0, -1.0), strict=False):
        column = problem.columns.take([problem.likeliest(rival.key, case.posterior)[0]])
        value = shrunk(noise, column, none, np.empty((0, 0)), problem.expected)[0]
        apart += sign * (column @ value)
    latest = np.array([rows[-1] for rows in visits(table).values()])
    place = int(latest[np.argmax(np.abs(apart[latest]))])
    squared = noise.products(apart[:, None]).item() / noise.scale_in**2
    second = max(chances[1], np.finfo(float).tiny)
    lead = abs(float(np.log(chances[0]) - np.log(second)))
    times = problem.beliefs.further(float(np.sqrt(squared)), lead)
    count = int(np.ceil(times * len(table))) if times <= _MOST_TIMES else None
    gear = str(table.gears[place])
    apart_in = float(abs(apart[place]))
    return FurtherInspections(tuple(rivals), gear, apart_in, count)


def _interval(value: float, error: float) -> tuple[float, float]:
    return value - 1.96 * error, value + 1.96 * error


def _expected_scatter(
    model: LinkageModel, table: DiagnosisTable, repeatability: float
) -> float | None:
    """Scatter that the gauges alone cause: readings, and clearances through the mechanism. [in]"""
    if not np.isfinite(repeatability):
        return None
    measured = np.isfinite(table.clearance_in)
    amplification = model.plunger_amplification()
    clearance = np.mean(table.gauge_u_in**2 * np.sum((measured * amplification) ** 2, axis=1))
    return float(np.sqrt(measured_uncertainty(table) ** 2 + clearance))
