"""Which parameters of a simulation its measured data show to be wrong."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc, stdtrit
from threadpoolctl import threadpool_limits

from mlg_troubleshoot.arrays import Array, Wholes, rms
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.misfit.covariance import FAR
from mlg_troubleshoot.misfit.fitting import blocks_of, folds_of
from mlg_troubleshoot.misfit.linearised import FittedPoint, JudgedPoint, Study, key_of
from mlg_troubleshoot.misfit.runner import Runner, held_out, least_squares
from mlg_troubleshoot.misfit.simulation_inputs import checked, followed
from mlg_troubleshoot.misfit.simulation_result import (
    HeldOutGain,
    SimulationDiagnosis,
    Suspect,
    SuspectFound,
)
from mlg_troubleshoot.misfit.verdict import MisfitVerdict as Verdict

# Difference of two equal calls, over the smallest effect, from which derivatives are off.
_DRAWN = 0.01


def diagnose_simulation(  # noqa: PLR0913 - what is measured, what may be wrong, how rows belong together
    predict: Callable[[Mapping[str, float]], Any],
    measured: ArrayLike | Mapping[str, ArrayLike],
    suspects: Sequence[Suspect],
    nuisance: Sequence[Suspect] = (),
    groups: ArrayLike | None = None,
    reading_u: ArrayLike | None = None,
    beliefs: Beliefs | None = None,
    *,
    series: ArrayLike | None = None,
    time: ArrayLike | None = None,
    most_calls: int = 400,
    progress: Callable[[int, int], object] | None = None,
    workers: int | Callable[..., Iterable[Any]] = 1,
) -> SimulationDiagnosis:
    """Find which parameters of a simulation its measured data show to be wrong.

    What no data of these rows could tell is stated first, from the sensitivities alone: classes of
    suspects that are one to these rows, and suspects that the nuisance parameters absorb. Then the
    probability of every set of suspects follows from Bayes' rule, each as a change of unknown size,
    against nothing at all and against smooth discrepancies that no suspect makes. The simulation is
    linearised where the likeliest set fits best. What is named is sure, and makes the misfit of
    held-out rows smaller. Linear algebra runs on one thread meanwhile, in the simulation as well.

    Parameters
    ----------
    predict : callable
        Takes the parameters by name, returns the prediction of all rows and outputs, shape (n, m),
        or a mapping or DataFrame of channels by name. Where it raises an ArithmeticError, a
        ValueError or a RuntimeError, or returns NaN, the values are avoided, counted and reported;
        other exceptions are passed on.
    measured : array_like, shape (n, m) or (n,), or mapping or DataFrame of channels, each (n,)
        Readings, NaN where not read.
    suspects : sequence of Suspect
        Parameters that may be wrong.
    nuisance : sequence of Suspect, optional
        Parameters that are unknown anyway: always fitted, never named.
    groups : array_like, shape (n,), optional
        Labels of rows that share a session, a tail or a place. Scatter between groups is noise;
        whole groups are held out for the gain.
    reading_u : array_like, shape (m,) or (n, m), optional
        Standard uncertainty of a reading by which readings are weighed; without it each output's is
        estimated. [unit of the readings]
    beliefs : Beliefs, optional
        What is believed before a measured value is looked at, and from which probability a cause is
        named.
    series : array_like, shape (n,), optional
        Labels of rows that follow each other: their scatter is correlated, the more the nearer they
        stand, by an amount that is estimated. Stretches of rows are held out for the gain.
    time : array_like, shape (n,), optional
        When each row of a series was read, numbers or dates; without it steps are equal, in the
        order given.
    most_calls : int, optional
        Calls of the simulation up to which the gain is measured by fitting it again without each
        fold; what needs more is taken for linear there. The search itself is not cut off.
    progress : callable, optional
        Called with the number of calls so far and `most_calls` after each round of calls.
    workers : int or callable, optional
        Threads that call the simulation at once, or a function like ``map`` (of a process pool):
        the result is the same.

    Returns
    -------
    SimulationDiagnosis
        The verdict, the causes, the gain, and the parameters to predict with.

    Raises
    ------
    UsageError
        If the arrays do not fit together, a name stands twice, a trial is 0, or the simulation
        gives no number.
    """
    data, channels, declared, group = checked(measured, suspects, nuisance, groups, reading_u)
    follows = followed(series, time, len(data))

    def diagnosed(call: Callable[..., Iterable[Any]]) -> SimulationDiagnosis:
        runner = Runner(predict, data, [*suspects, *nuisance], channels, call)
        if progress is not None:
            runner.progress = lambda: progress(runner.calls, most_calls)
        # The matrices are small: threads that wait for each other cost several times what they
        # save.
        with threadpool_limits(1, "blas"):
            study = Study(runner, len(suspects), declared, group, beliefs or Beliefs(), follows)
            return _diagnosed(study, most_calls)

    if callable(workers):
        return diagnosed(workers)
    if workers < 1:
        raise UsageError(f"workers is {workers}", "give at least one thread")
    if workers == 1:
        return diagnosed(map)
    with ThreadPoolExecutor(workers) as pool:
        return diagnosed(pool.map)


def _diagnosed(study: Study, most_calls: int) -> SimulationDiagnosis:
    """Say what is wrong, what may be, what that gains, and the residual."""
    runner = study.runner
    names = study.runner.names
    start = study.start()
    at = study.judged(start)
    causes = _causes(study, at)
    final = study.fitted(at, causes, 0)
    moved = [k for k in causes if final.values[k] != runner.nominal[k]]
    if moved != causes:
        # What would only move beyond its bound is not a cause.
        causes = moved
        final = study.fitted(at, moved, 0)
    report = _Report(study, at, final, tuple(causes))
    open_ = study.chosen(at.follows.open_beside([key_of(names[k]) for k in causes]))
    verdict = at.follows.verdict
    found = at.follows.posterior
    if verdict is Verdict.NAMED and not causes:
        # Held-out rows veto what these rows name.
        verdict = Verdict.AMBIGUOUS
        open_ = study.chosen(at.follows.sure)
    often = study.often
    n = len(at.unit)
    in_sequence = report.in_sequence()
    # With rivals no single set predicts best: each counts by how likely it is.
    rivals = verdict is at.follows.verdict is Verdict.AMBIGUOUS
    values = study.expected(at) if rivals else final.values
    smallest = study.beliefs.seen_from(often, n) * float(np.sqrt(np.mean(at.unit**2) / n))
    described = [report.describe(k) for k in causes]
    gain = report.gain(start, most_calls)
    untestable = report.untestable({*causes, *open_})
    return SimulationDiagnosis(
        verdict=verdict,
        causes=tuple(sorted(described, key=lambda c: -c.effect_rms)),
        also_possible=tuple(report.describe(k) for k in open_ if k not in causes),
        aliases=tuple(
            tuple(names[k] for k in members) for members in study.design.classes if len(members) > 1
        ),
        untestable=tuple(untestable),
        why_untestable=untestable,
        p_nothing=found.nothing,
        p_unlisted=min(found.unlisted, 1.0),
        gain=gain,
        parameters=dict(zip(names, values.tolist(), strict=True)),
        remainder_p=report.remainder_p(),
        smallest_detectable_rms=smallest,
        noise=tuple(
            float(np.median(at.weight[own])) if np.any(own := runner.output == k) else float("nan")
            for k in range(runner.shape[1])
        ),
        correlation=at.noise.correlation,
        in_sequence=in_sequence,
        notes=report.notes(in_sequence),
        calls=runner.calls,
        failed=runner.failed,
        arrived=final.arrived,
        condition=final.condition,
    )


def _causes(study: Study, at: JudgedPoint) -> list[int]:
    """Suspects that are sure, and given a discrepancy also those that take away most of the misfit
    where they act; without those that make held-out rows worse, and those whose interval
    contains the nominal value.
    """
    causes = study.chosen(at.follows.sure)
    first = [members[0] for members in study.design.classes]
    while at.follows.verdict is Verdict.UNLISTED:
        shares = {k: _share(at, causes, k) for k in first if k not in causes}
        most = max(shares, key=shares.__getitem__, default=-1)
        # A cause is added that takes away most of the squared misfit that is left.
        if shares.get(most, 0.0) <= 0.5:
            break
        causes.append(most)
    for k in causes[::-1]:
        others = [j for j in causes if j != k]
        before, after = (
            _held_out(study, at, at.point, fitted, causes, whole=False)[0]
            for fitted in (others, causes)
        )
        change = abs(float(at.linear([k, *others], 0).values[0]))
        if after @ after >= before @ before or change < _reach(study, at, k, others):
            causes = others
    return causes


def _reach(study: Study, at: JudgedPoint, k: int, others: Sequence[int]) -> float:
    """Half the 95 % interval of a suspect's change, what looks like a discrepancy being one.
    [trials]
    """
    context = at.follows.reported([key_of(study.runner.names[k])]).context
    degrees = max(at.noise.worth - at.noise.absorbed - len(others) - 1, 1.0)
    return float(stdtrit(degrees, 0.975) * at.linear([k, *others], context).errors[0])


def _share(at: JudgedPoint, others: Sequence[int], k: int) -> float:
    """Share of the squared misfit where a suspect acts that it takes away from what others leave.
    [1]
    """
    noise = at.settled([*others, k], 0)
    acts = at.point.columns[:, k] != 0.0
    square = []
    for chosen in ([*others], [*others, k]):
        left = at.point.whole / at.unit - at.columns[:, chosen] @ at.linear(chosen, 0).values
        own, _spare = noise.own_part(left)
        square.append(float(np.sum((own[acts] / noise.relative[acts]) ** 2)))
    return 1.0 - square[1] / max(square[0], 1e-300)


def _held_out(
    study: Study,
    at: JudgedPoint,
    point: FittedPoint,
    fitted: Sequence[int],
    acting: Sequence[int],
    whole: bool = True,
) -> tuple[Array, str, Wholes]:
    """Misfit of rows held out over their scatter, some causes fitted to the others, or what of it
    is new in each row; rows are held out by group as long as the others teach what acts.
    """
    row = study.runner.row
    both = np.column_stack([point.columns, point.whole]) / at.unit[:, None]
    both = both / at.noise.relative[:, None] if whole else at.noise.own(both)
    columns = both[:, :-1]
    rest = both[:, -1]
    part, by = folds_of(row, study.group, columns[:, list(acting)], study.fold)
    if by == "row" and study.series is not None:
        part = blocks_of(*study.series)[row]
        by = "block"
    return held_out(columns, rest, fitted, study.nuisance, part), by, part


def _stated(s: Suspect) -> float:
    """Largest change that is stated to be possible; two standard deviations. [unit]"""
    bounds = (
        s.nominal - s.low if s.low is not None else None,
        s.high - s.nominal if s.high is not None else None,
    )
    ranges = [] if None in bounds else [max(b for b in bounds if b is not None)]
    ranges += [] if s.prior_sd is None else [2.0 * s.prior_sd]
    return min(ranges, default=float("inf"))


@dataclass(frozen=True)
class _Report:
    """What is said of a diagnosis: final is where the causes alone fit best."""

    study: Study
    at: JudgedPoint
    final: FittedPoint
    causes: tuple[int, ...]

    def describe(self, k: int) -> SuspectFound:
        """Describe a cause, or what may be one in addition to the causes."""
        at = self.at
        run = self.study.runner
        names = self.study.runner.names
        others = [j for j in self.causes if j != k]
        size = float(at.linear([k, *others], at.likeliest.context).values[0])
        change = size * run.trial[k]
        whole = at.point.columns[:, k] * size
        if k in self.causes:
            change = self.final.values[k] - run.nominal[k]
            without = np.where(np.arange(len(names)) == k, run.nominal, self.final.values)
            whole = run.reading - self.final.rest - run.at(without)
        held = self.final.columns[:, self.study.nuisance] / at.weight[:, None]
        seen = whole / at.weight
        seen = (seen - held @ least_squares(held, seen)) * at.weight
        reach = _reach(self.study, at, k, others) * float(abs(run.trial[k]))
        value = float(np.clip(run.nominal[k] + change, run.low[k], run.high[k]))
        return SuspectFound(
            suspect=run.suspects[k],
            value=value,
            interval=(
                float(max(value - reach, run.low[k])),
                float(min(value + reach, run.high[k])),
            ),
            effect_rms=rms(seen),
            probability=min(at.follows.listed.get(key_of(names[k]), 0.0), 1.0),
            aliases=tuple(names[j] for j in self.study.design.class_of(k) if j != k),
        )

    def gain(self, start: FittedPoint, most_calls: int) -> HeldOutGain:
        """Misfit of rows held out, before and after, in the unit of the readings."""
        study = self.study
        at = self.at
        before, by, part = _held_out(study, at, start, (), self.causes)
        after, by, part = _held_out(study, at, self.final, self.causes, self.causes)
        # Each fold needs a step, its check, and the columns at both.
        folds = len(np.unique(part))
        fitted = (len(study.nuisance), len(study.nuisance) + len(self.causes))
        needed = sum(folds * 2 * (2 * k + 1) for k in fitted if k)
        refitted = study.runner.calls + needed <= most_calls
        if refitted:
            before = self._refitted(start, (), part)
            after = self._refitted(self.final, self.causes, part)
        return HeldOutGain(rms(before * at.weight), rms(after * at.weight), by, refitted)

    def _refitted(self, point: FittedPoint, fitted: Sequence[int], part: Wholes) -> Array:
        """Misfit of each reading over its scatter, the simulation fitted to the other folds."""
        study = self.study
        weight = self.at.weight
        active = [*fitted, *study.nuisance]
        left = point.rest / weight
        for k in np.unique(part):
            test = part == k
            if test.all() or not active:
                continue
            share = np.where(test, 0.0, 1.0 / weight**2)
            found = study.runner.fit(point.values, active, lambda c, w=share: w[:, None] * c)  # type: ignore[misc]
            slopes = study.runner.sensitivities(found.values, found.base, active)
            rest = (study.runner.reading - found.base) / weight
            own = list(range(len(fitted)))
            free = list(range(len(fitted), len(active)))
            left[test] = held_out(slopes / weight[:, None], rest, own, free, part, [k])[test]
        return left

    def untestable(self, found: Collection[int]) -> dict[str, str]:
        """Suspects that these rows cannot test, and why."""
        study = self.study
        run = self.study.runner
        why = dict[str, str]()
        for k, s in enumerate(run.suspects[: study.count]):
            if k in run.silent:
                why[s.name] = "the simulation gives no number near its nominal value"
            elif k not in study.design.testable:
                acts = np.any(study.nominal.columns[:, k] != 0.0)
                why[s.name] = "absorbed by the nuisance parameters" if acts else "no effect here"
            elif k not in found and (widest := _stated(s)) < (least := self._detectable(k)):
                unit = f" {s.unit}".rstrip()
                why[s.name] = (
                    f"a change of {least:.3g}{unit} would be detected, {widest:.3g}{unit} is the"
                    " most that is stated to be possible"
                )
        return why

    def _detectable(self, k: int) -> float:
        """Smallest change of a suspect that is detected with 80 % power. [unit of the suspect]"""
        error = self.at.linear([k, *(j for j in self.causes if j != k)], 0).errors[0]
        seen = self.study.beliefs.seen_from(self.study.often, len(self.at.unit))
        return float(seen * error * abs(self.study.runner.trial[k]))

    def notes(self, in_sequence: bool) -> tuple[str, ...]:
        """What to know before the numbers are used, as sentences."""
        run = self.study.runner
        notes = list[str]()
        if self.study.drawn > _DRAWN:
            notes.append(
                "Two calls with the same values gave different numbers, by"
                f" {self.study.drawn:.1%} of the smallest effect of a trial: let the simulation"
                " draw the same random numbers in each call (one seed)."
            )
        if in_sequence and self.study.series is None:
            notes.append(
                "Residuals of neighbouring rows are correlated: probabilities and intervals are too"
                " sharp. State with series= (and time=) which rows follow each other."
            )
        elif in_sequence:
            notes.append(
                "Residuals are correlated further than one correlation from row to row explains:"
                " probabilities and intervals may be too sharp."
            )
        for k in self.causes:
            if self.final.values[k] in {run.low[k], run.high[k]}:
                own = {run.names[j] for j in (*self.causes, *self.study.design.class_of(k))}
                others = (str(name) for _what, name in self.at.follows.listed if name not in own)
                notes.append(
                    f"{run.names[k]} stands at its bound {self.final.values[k]:g}; the likeliest"
                    f" rival is {next(others, 'something that is not listed')}."
                )
        if not self.final.arrived:
            notes.append("The fit did not arrive: values may be off, and intervals too narrow.")
        if run.failed:
            notes.append(
                f"{run.failed} of {run.calls} calls gave no number for some reading, the first"
                f" with {run.reasons[0]}."
            )
        return tuple(notes)

    def in_sequence(self) -> bool:
        """True if what the likeliest explanation leaves of a row resembles what it leaves of the
        row before it, the known correlation taken out.
        """
        at = self.at
        chosen = self.study.chosen(at.follows.posterior.names_of(at.likeliest))
        noise = at.settled(chosen, 0 if self.study.series is None else at.likeliest.context)
        own, _spare = noise.own_part(at.point.rest / at.unit)
        own = own / at.noise.relative
        along = 0.0
        square = 0.0
        for index in self.study.outputs:
            along += float(own[index][1:] @ own[index][:-1])
            square += float(own[index] @ own[index])
        return bool(along > FAR * square / np.sqrt(len(own)))

    def remainder_p(self) -> float:
        """p-value of the smooth shape that stands out most in the residual, as one of all of them
        (Bonferroni); each sum of squares as a multiple of chi-squared (Satterthwaite 1946).
        """
        noise = self.at.settled(self.causes, 0)
        ratio = noise.tail_ratios[-1]
        left = self.final.rest / self.at.unit
        weighed = noise.precision_times(left[:, None], ratio)[0][:, 0]
        variance = float(left @ weighed) / max(len(left) - noise.absorbed - len(self.causes), 1)
        if variance == 0.0:
            return 1.0
        patterns = self.study.contexts[1 :: len(self.study.beliefs.sizes)]
        chances = [1.0]
        for pattern in patterns:
            shape = pattern.shared_in
            spread = shape.T @ noise.precision_times(shape, ratio)[0]
            mean = float(np.trace(spread))
            square = float(np.sum(spread**2))
            size = float(np.sum((shape.T @ weighed) ** 2)) / variance
            chances.append(len(patterns) * float(chdtrc(mean**2 / square, size * mean / square)))
        return min(chances)
