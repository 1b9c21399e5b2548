"""A linkage from measurements: design variables by damped least squares from every linkage of the
ensemble.

The prior is normal about the mean of the ensemble, with its covariance shrunk: ten members say
little about thirty numbers' correlations. Each member and some draws are starts; the posterior is
normal about its mode (Laplace). A slip must not bend the linkage: the first fit is robust
(Student's t with four degrees of freedom, the uncertainties widened at first), and a reading counts
as a misfit by what the others predict for it. Draws are random maximum likelihood: a draw of the
prior and of the readings' errors, fitted anew by a few steps (Oliver et al. 1996).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.random import Generator

from mlg_troubleshoot.arrays import Array, Mask, Places
from mlg_troubleshoot.errors import InconclusiveDataError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.geometry.mechanism import Crank, Dyad, Slider
from mlg_troubleshoot.surveying import tuned
from mlg_troubleshoot.surveying.readings import (
    DEFAULT_U,
    ReadingKind,
    Readings,
    SurveyedLinkage,
    SurveyReading,
)
from mlg_troubleshoot.units import Sentence


@dataclass(frozen=True, slots=True)
class Misfit:
    """A reading that the others contradict.

    expected, spread: what the others predict for it, and with what standard uncertainty. [in or
    rad] suggestion: what would fit. group: rows that contradict each other, this one among them; of
    one alone it is the slip.
    """

    reading: SurveyReading
    expected: float
    spread: float
    suggestion: str
    group: tuple[int, ...]

    @property
    def words(self) -> str:
        """What would fit, and with which rows it contradicts."""
        if len(self.group) < 2:
            return self.suggestion
        rows = ", ".join(map(str, self.group))
        return Sentence.of("rows {} contradict each other; of this one: {}", rows, self.suggestion)


@dataclass(frozen=True, slots=True)
class Mode:
    """One assembly that the survey allows.

    mean, shape (n_variables,): the prior's middle, mirrored with the assembly. [in or rad]
    covariance, shape (n_variables, n_variables): of the design variables. [in², rad²] weight: share
    of the posterior. [1] parameters: how many numbers the readings determine. [1] sides: branch
    sign of each joint on two links or a slider, and on which side of a crank the rest stands.
    """

    vector: Array
    mean: Array
    covariance: Array
    weight: float
    chi2: float
    parameters: float
    sides: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Survey:
    """What a survey says about a linkage.

    modes: assemblies with their weight, the likeliest first.
    draws, shape (n, n_variables): from the posterior, all of which close. [in or rad]
    """

    linkage: SurveyedLinkage
    readings: Readings
    misfits: tuple[Misfit, ...]
    modes: tuple[Mode, ...]
    draws: Array

    @property
    def read(self) -> Readings:
        """The readings of the table."""
        return tuple(r for r in self.readings if r.row is not None)

    @property
    def words(self) -> str:
        """How many were read, and how many of them fit."""
        read = len(self.read)
        wrong = len(self.misfits)
        fit = f"{wrong} do{'es' if wrong == 1 else ''} not fit" if wrong else "all of them fit"
        return f"{read} reading{'' if read == 1 else 's'}, {fit}."

    @property
    def degrees_of_freedom(self) -> float:
        """Readings that fit, less the numbers that they determine. [1]"""
        fitted = len(self.readings) - len(self.misfits)
        return max(fitted - self.modes[0].parameters, 0.0)

    @property
    def contradicts(self) -> bool:
        """True if readings contradict each other so that the wrong one cannot be identified, or
        too many do.
        """
        most = max(2, tuned.MOST_MISFITS * len(self.read))
        return len(self.misfits) > most or any(len(m.group) > 1 for m in self.misfits)


class Prior:
    """What is known of the linkage before it is measured: a normal distribution.

    mean, shape (n_variables,): its middle. [in or rad]
    root, shape (n_variables, n_variables): Cholesky factor of its covariance. [in, rad]
    members, shape (n_members, n_variables): the ensemble. [in or rad]
    """

    def __init__(self, linkage: SurveyedLinkage) -> None:
        gear = linkage.gear
        members = np.array([linkage.vector(each) for each in gear.ensemble])
        angles = linkage.angles
        # The same direction, one turn further, is not a distance.
        turned = members[:, angles] - members[0, angles]
        turns = np.round(turned / (2 * np.pi))
        members[:, angles] -= 2 * np.pi * turns
        self.members = members
        self.linkage = linkage
        points = gear.reference.mechanism.points
        coordinates = [c for p in points for c in (p.x, p.y)]
        size = float(np.std(coordinates))
        alone = np.where(angles, np.radians(tuned.ALONE_ANGLE), tuned.ALONE_SIZE * size)
        least = tuned.LEAST_SPREAD * alone
        if linkage.travel is not None:
            # What the technical order prescribes is not a number of the ensemble: wide here, a
            # reading elsewhere.
            least[-1] = 0.1 * linkage.travel
        covariance = np.diag(alone**2)
        if len(members) > 2:
            around = np.cov(members.T)
            share = tuned.COVARIANCE_SHARE
            covariance = share * around + (1.0 - share) * np.diag(np.diag(around))
        self.mean = members.mean(axis=0)
        order = float(np.log(linkage.amplification(members)).mean())
        self.order = SurveyReading(ReadingKind.ORDER, value=order, u=DEFAULT_U[ReadingKind.ORDER])
        self.root = np.linalg.cholesky(covariance + np.diag(least**2))
        self.whiten = np.linalg.inv(self.root)

    def drawn(self, n: int, rng: Generator) -> Array:
        """Draws of it, whether they close or not."""
        z = rng.standard_normal((n, len(self.mean)))
        draws: Array = self.mean + z @ self.root.T
        return draws

    def closing(self, n: int, rng: Generator, readings: Readings = ()) -> Array:
        """About n draws of it that close, given the readings of one variable each."""
        found = self.drawn(tuned.DRAWN_FOR_ONE * n, rng)
        own = tuple(
            r
            for r in readings
            if r.kind in (ReadingKind.ANGLE, ReadingKind.EXTENSION, ReadingKind.TRAVEL)
        )
        if own:
            _, slopes = self.linkage.slopes(own, self.mean[None])
            slopes = slopes[0] @ self.root
            spread = slopes @ slopes.T + np.diag([r.u**2 for r in own])
            gain = np.linalg.solve(spread, slopes) @ self.root.T
            misfit = [r.value for r in own] - self.linkage.predicted(own, found)
            found = found + misfit @ gain
        order = self.linkage.predicted((self.order,), found)[:, 0]
        apart = (order - self.order.value) / self.order.u
        likely = np.exp(-0.5 * apart * apart) > rng.random(len(found))
        return found[likely & self.linkage.closes(found)][:n]


@dataclass(frozen=True, slots=True)
class Fits:
    """Fits that are under way, one per row.

    points, means, shape (n_fits, n_variables): where each is, and the middle of its prior. [in or
    rad] kept, shape (n_fits, n_readings): the readings that each believes. noise, shape (n_fits,
    n_readings): how far each takes a reading to be off, in the reading's uncertainty. [1] origin,
    shape (n_fits,): from which of several hypotheses each began. loss, shape (n_fits,): as it was
    judged last. [1]
    """

    points: Array
    means: Array
    kept: Mask
    noise: Array
    origin: Places
    loss: Array

    def __getitem__(self, rows: Any) -> Fits:
        return Fits(*(getattr(self, part.name)[rows] for part in fields(self)))

    def best(self, count: int) -> Fits:
        return self[np.argsort(self.loss)[:count]]

    @classmethod
    def joined(cls, *fits: Fits) -> Fits:
        columns = ([getattr(f, p.name) for f in fits] for p in fields(cls))
        return cls(*map(np.concatenate, columns))


class Fitting:
    """The readings of one survey against one prior."""

    def __init__(self, linkage: SurveyedLinkage, prior: Prior, readings: Readings) -> None:
        self.linkage = linkage
        self.prior = prior
        self.readings = readings
        self.value = np.array([r.value for r in readings])
        self.u = np.array([r.u for r in readings])

    @property
    def still(self) -> list[int]:
        """Which of them are read at the reference position, and so need no motion."""
        moves = (ReadingKind.PLUNGER, ReadingKind.ORDER)
        return [
            i for i, r in enumerate(self.readings) if r.extension is None and r.kind not in moves
        ]

    def begun(
        self, points: Array, means: Any = None, kept: Any = True, noise: Any = 0.0, origin: Any = 0
    ) -> Fits:
        """Fits that begin at points, as a rule with all readings and the middle of the prior."""
        count = len(points)
        shape = (count, len(self.readings))
        believed = np.broadcast_to(kept, shape)
        off = np.broadcast_to(noise, shape)
        middle = np.broadcast_to(self.prior.mean if means is None else means, points.shape)
        origin = np.broadcast_to(origin, count)
        return Fits(points, middle, believed, off, origin, np.zeros(count))

    def residuals(self, points: Array) -> Array:
        with np.errstate(all="ignore"):
            found = self.linkage.predicted(self.readings, points)
            residuals: Array = (found - self.value) / self.u
        return residuals

    def trusted(self, fits: Fits) -> Mask:
        """Readings that the first of the fits does not contradict."""
        residuals: Array = self.residuals(fits.points[:1])[0]
        return np.abs(residuals) < tuned.TRUSTED

    def linear(self, points: Array, widened: float = 1.0) -> tuple[Array, Array]:
        """Residuals in the uncertainties of the readings, and their slopes in widened ones."""
        with np.errstate(all="ignore"):
            found, slopes = self.linkage.slopes(self.readings, points)
            residuals = (found - self.value) / self.u
            widened_u = self.u * widened
            return residuals, slopes / widened_u[:, None]

    def loss(self, fits: Fits, widened: float, robust: bool) -> Array:
        r = (self.residuals(fits.points) - fits.noise) / widened
        r = np.where(fits.kept, r, 0.0)
        open_ = ~np.isfinite(r)
        r = np.where(open_, 0.0, r)
        penalty = _robust(r)[0] if robust else r * r
        data = np.where(open_, tuned.OPEN_LOSS, penalty)
        z = (fits.points - fits.means) @ self.prior.whiten.T
        loss: Array = data.sum(axis=1) + (z * z).sum(axis=1)
        return loss

    def descend(self, fits: Fits, widened: float, steps: int, robust: bool) -> Fits:
        """Damped least squares of all fits at once, in variables in which the prior is the unit
        sphere.
        """
        points = fits.points.copy()
        loss = self.loss(fits, widened, robust)
        damping = np.full(len(points), 1e-2)
        moving = np.arange(len(points))
        n = points.shape[1]
        for _ in range(steps):
            here = replace(fits, points=points)[moving]
            before = loss[moving]
            r, g = self.linear(here.points, widened)
            r = np.where(here.kept, (r - here.noise) / widened, 0.0)
            weight = _robust(r)[1] if robust else np.ones_like(r)
            g = np.where(here.kept[..., None], g, 0.0) @ self.prior.root
            # A position that does not close pulls nowhere.
            sound = np.isfinite(g).all(axis=2) & np.isfinite(r)
            bad = ~sound
            r = np.where(bad, 0.0, r)
            g = np.where(bad[..., None], 0.0, g)
            weighted = weight[..., None] * g
            gram = np.swapaxes(g, 1, 2) @ weighted + np.eye(n)
            down = (
                np.einsum("smi,sm->si", g, weight * r)
                + (here.points - here.means) @ self.prior.whiten.T
            )
            left = np.arange(len(moving))
            for _ in range(4 if robust else tuned.DAMPINGS):
                at = moving[left]
                trial = here[left]
                damped = gram[left] + damping[at, None, None] * np.eye(n)
                solved = np.linalg.solve(damped, down[left][..., None])
                step = solved[..., 0]
                step = np.where(np.isfinite(step), step, 0.0) @ self.prior.root.T
                trial = replace(trial, points=trial.points - step)
                new = self.loss(trial, widened, robust)
                better = new < loss[at]
                points[at[better]] = trial.points[better]
                loss[at[better]] = new[better]
                changed = np.where(better, damping[at] / 5.0, damping[at] * 8.0)
                damping[at] = changed.clip(1e-9, 1e12)
                left = left[~better]
                if not len(left):
                    break
            moving = moving[loss[moving] < before - 1e-2]
            if not len(moving):
                break
        return replace(fits, points=points, loss=loss)

    def robust(self, points: Array) -> Array:
        """Fit from every start with uncertainties that shrink to their own; the best few remain.

        What is read at the reference position needs no motion: it comes first and closes from every
        start. What it does not tell stays as the start has it, so that starts which also move are
        among them.
        """
        fits = self.begun(points, points)
        shrinking: tuple[int, ...] = tuned.WIDENED
        standing = self._standing()
        if len(standing.readings) > 2:
            still = standing.begun(points, points)
            for widened in shrinking:
                still = standing.descend(still, widened, tuned.STEPS_EACH, True)
            # Of the linkages that stand right, those that also move are the ones to go on with.
            fits = self.begun(still.points, points)
            loss = self.loss(fits, shrinking[2], True)
            fits = replace(fits, loss=loss).best(3 * tuned.MOST_MODES)
            shrinking = shrinking[1:]
        for k, widened in enumerate(shrinking):
            fits = self.descend(fits, widened, tuned.STEPS_EACH, True)
            if k >= 1:
                fits = fits.best(max(tuned.MOST_MODES, len(fits.points) // 2))
        fits = self.descend(self.begun(fits.points), 1.0, tuned.LAST_STEPS, True)
        return fits.best(tuned.MOST_MODES).points

    def _standing(self) -> Fitting:
        """The same for what is read at the reference position."""
        readings = tuple(self.readings[i] for i in self.still)
        return Fitting(self.linkage, self.prior, readings)

    def suspected(self, starts: Array) -> Fits:
        """Fit what stands still without each reading in turn, and with each two distances
        exchanged.

        A slip leads a fit that begins with it into another valley, where readings that are right
        look wrong. All begin at every start, and the worse two thirds are given up whenever the
        uncertainties shrink. Returns the likeliest few, each with the readings that it keeps and
        how far it takes them to be off.
        """
        still = self.still
        part = self._standing()
        lengths = [i for i, r in enumerate(part.readings) if r.kind is ReadingKind.DISTANCE]
        pairs = list(combinations(lengths, 2))
        all_but_one = ~np.eye(len(still), dtype=bool)
        all_kept = np.ones((len(pairs), len(still)), dtype=bool)
        kept = np.concatenate([all_but_one, all_kept])
        noise = np.zeros(kept.shape)
        starts = starts[: max(1, tuned.MOST_RESIDUALS // kept.size)]
        for row, (i, j) in zip(noise[len(still) :], pairs, strict=True):
            difference = part.value[j] - part.value[i]
            exchanged = np.array([difference, -difference])
            row[[i, j]] = exchanged / part.u[[i, j]]
        points = np.tile(starts, (len(kept), 1))
        which = np.repeat(np.arange(len(kept)), len(starts))
        fits = part.begun(points, points, kept[which], noise[which], which)
        for widened in tuned.WIDENED:
            fits = part.descend(fits, widened, tuned.STEPS_LEFT_OUT, False)
            fits = fits.best(max(tuned.FEWEST_STARTS, len(points) // 3))
            points = fits.points
        likely = list(dict.fromkeys(fits.origin))[: tuned.MOST_MODES]
        fits = fits[np.isin(fits.origin, likely)]
        held = np.ones((len(fits.points), len(self.readings)), dtype=bool)
        off = np.zeros(held.shape)
        held[:, still] = fits.kept
        off[:, still] = fits.noise
        fits = self.begun(fits.points, fits.means, held, off, fits.origin)
        for widened in tuned.WIDENED[1:]:
            fits = self.descend(fits, widened, tuned.STEPS_LEFT_OUT, False)
        each = [fits[fits.origin == k] for k in dict.fromkeys(fits.origin)]
        return Fits.joined(*(of[self._apart(of, 2)] for of in each))

    def reheated(self, fits: Fits, rng: Generator) -> Fits:
        """Fit once more from around each point, as far as wider uncertainties would let it go; the
        best few remain.

        Next to a valley there often lies a better one, behind a low ridge or where more of the
        readings close. All of the readings judge in the end.
        """
        r, slopes = self.linear(fits.points)
        _, weight = _robust(r - fits.noise)
        weight = np.where(fits.kept, np.nan_to_num(weight), 0.0)
        g = np.nan_to_num(slopes, posinf=0.0, neginf=0.0) @ self.prior.root
        gram = np.swapaxes(g, 1, 2) @ (weight[..., None] * g)
        values, turned = np.linalg.eigh(gram)
        is_plain = (fits.kept & (fits.noise == 0.0)).all()
        tried = tuned.FITTED_AGAIN if is_plain else tuned.TRIED_AROUND
        count, n = fits.points.shape
        around = [fits]
        near = fits[np.repeat(np.arange(count), tried)]
        for widened in tuned.REHEATED:
            z = rng.standard_normal((count, tried, n))
            precision = 1.0 + np.maximum(values, 0.0) / widened**2
            z /= np.sqrt(precision)[:, None]
            step = np.einsum("pij,pkj->pki", turned, z) @ self.prior.root.T
            trial = fits.points[:, None] + step
            near = replace(near, points=trial.reshape(-1, n))
            # Of many around a fit of what stands still, those that also move are the ones to go on
            # with.
            loss = self.loss(near, widened, True)
            order = np.argsort(loss.reshape(count, -1), axis=1)
            first = tried * np.arange(count)[:, None]
            best = order[:, : tuned.FITTED_AGAIN] + first
            tried_again = near[best.ravel()]
            around.append(self.descend(tried_again, widened, tuned.REHEAT_STEPS, True))
        fits = Fits.joined(*around)
        fits = replace(fits, kept=np.ones_like(fits.kept))
        for steps, most in (
            (tuned.STEPS_EACH, 3 * tuned.MOST_MODES),
            (tuned.LAST_STEPS, 2 * tuned.MOST_MODES),
        ):
            fits = self.descend(fits, 1.0, steps, True)
            # A few readings may be fitted by what does not move over its stroke.
            closes = self.linkage.closes(fits.points)
            loss = np.where(closes, fits.loss, np.inf)
            loss += tuned.EXCHANGE_LOSS * fits.noise.any(axis=1)
            fits = replace(fits, loss=loss)
            fits = fits[self._apart(fits, most)]
        return fits

    def _apart(self, fits: Fits, most: int) -> list[int]:
        """The best fits that are not near a better one."""
        found: list[int] = []
        whitened = fits.points @ self.prior.whiten.T
        for k in map(int, np.argsort(fits.loss)):
            distance = np.abs(whitened[found] - whitened[k]).max(axis=1)
            is_apart = np.all(distance > tuned.POINTS_APART)
            if len(found) < most and is_apart:
                found.append(k)
        return found

    def modes(self, points: Array, means: Array, kept: Mask) -> tuple[Mode, ...]:
        """Least squares on the readings kept, from every point; each mode with its Laplace
        posterior and evidence.
        """
        begun = self.begun(points, means, kept)
        fits = self.descend(begun, 1.0, tuned.LAST_STEPS, False)
        points = fits.points
        loss = fits.loss
        residuals, slopes = self.linear(points)
        closes = self.linkage.closes(points)
        index = self.linkage.amplification(points)
        own: list[Array] = []
        modes: list[Mode] = []
        evidence: list[float] = []
        for k in np.argsort(loss):
            if not (closes[k] and np.isfinite(slopes[k][kept]).all()):
                continue
            g = slopes[k][kept] @ self.prior.root
            values, turned = np.linalg.eigh(g.T @ g)
            values = np.maximum(values, 0.0)
            root = self.prior.root @ (turned / np.sqrt(1.0 + values))
            sides = self._sides(points[k])
            # A valley along which no index changes, as where all of a driving part may turn about
            # its pivot, is one.
            if any(
                m.sides == sides and np.abs(np.log(a / index[k])).max() < tuned.SAME_INDEX
                for m, a in zip(modes, own, strict=True)
            ):
                continue
            own.append(index[k])
            r = residuals[k][kept]
            determined = float(np.sum(values / (1.0 + values)))
            covariance = root @ root.T
            square = float(r @ r)
            modes.append(Mode(points[k], means[k], covariance, 0.0, square, determined, sides))
            log_determinant = float(np.log1p(values).sum())
            evidence.append(-0.5 * loss[k] - 0.5 * log_determinant)
        if not modes:
            return ()
        share = np.exp(np.array(evidence) - max(evidence))
        share /= share.sum()
        likeliest = np.argsort(-share).tolist()
        order = [k for k in likeliest if share[k] > tuned.LEAST_WEIGHT]
        return tuple(replace(modes[k], weight=float(share[k])) for k in order)

    def _sides(self, point: Array) -> tuple[int, ...]:
        space = self.linkage.space
        m = space.assembled(point[: len(space.names)])
        sides = (m.side(s) for s in m.steps if isinstance(s, (Dyad, Slider)))
        signs = [1 if side >= 0.0 else -1 for side in sides]
        for crank in (s for s in m.steps if isinstance(s, Crank)):
            plane = m.point(crank.joint).plane
            other = next(
                p.name
                for p in m.points
                if p.plane == plane and p.name not in (crank.joint, crank.pivot)
            )
            arm = m.seen_in_plane(plane, crank.pivot, crank.joint)
            away = m.seen_in_plane(plane, crank.pivot, other)
            is_to_the_left = arm[0] * away[1] >= arm[1] * away[0]
            signs.append(1 if is_to_the_left else -1)
        return tuple(signs)

    def with_mirrored(self, modes: tuple[Mode, ...], kept: Mask) -> tuple[Mode, ...]:
        """Try the other side of each joint on two links: where the readings allow it, both
        assemblies are kept.

        The ensemble's side says nothing of this gear's: the prior's middle is mirrored with its
        joint. A linkage that a crank drives moves otherwise if all of it is mirrored.
        """
        best = modes[0]
        names = list(self.linkage.names)
        points = [m.vector for m in modes]
        means = [m.mean for m in modes]
        space = self.linkage.space
        m = space.assembled(best.vector[: len(space.names)])
        for step in m.steps:
            if not isinstance(step, (Dyad, Slider)) or f"{step.joint}.x" not in names:
                continue
            plane = m.point(step.joint).plane
            i = names.index(f"{step.joint}.x")
            arm = np.array(m.seen_in_plane(plane, step.upstream, step.joint))
            if isinstance(step, Slider):
                across = np.array([np.cos(step.axis), np.sin(step.axis)])
            else:
                base = np.array(m.seen_in_plane(plane, step.upstream, step.downstream))
                across = np.array([-base[1], base[0]])
                across = across / np.hypot(*base)
            far = float(arm @ across)
            if np.sqrt(
                across @ best.covariance[i : i + 2, i : i + 2] @ across
            ) > tuned.PLACED * abs(far):
                continue
            moved = np.zeros(len(names))
            moved[i : i + 2] = -2.0 * far * across
            points.append(best.vector + moved)
            means.append(best.mean + moved)
        if any(isinstance(step, Crank) for step in m.steps):
            points += [p * self.linkage.mirror for p in points]
            means += [c * self.linkage.mirror for c in means]
        return (
            self.modes(np.array(points), np.array(means), kept) or modes
            if len(points) > len(modes)
            else modes
        )

    def misfits(self, mode: Mode, kept: Mask) -> tuple[tuple[Misfit, ...], Mask]:
        """Readings that the others contradict, one after the other, and the readings that
        remain.
        """
        kept, back = kept.copy(), np.zeros_like(kept)
        for _ in range(len(self.readings)):
            modes = self.modes(mode.vector[None], mode.mean[None], kept)
            mode = modes[0] if modes else mode
            gap, spread = self._left_out(mode, kept)
            size = np.nan_to_num(np.abs(gap) / spread, nan=np.inf)
            again = ~kept & (size < tuned.MISFIT)
            if again.any():
                # Never the same reading out and in: one that was taken back stays.
                i = int(np.argmin(np.where(again, size, np.inf)))
                kept[i] = back[i] = True
                continue
            size = np.where(kept & ~back, size, 0.0)
            worst = int(np.argmax(size))
            if size[worst] < tuned.MISFIT:
                break
            kept[worst] = False
        found: dict[int | None, Misfit] = {}
        for i in map(int, np.flatnonzero(~kept)):
            words, sure = self._suggestion(mode, i, gap, spread, ~kept)
            deviation = float(gap[i] / spread[i])
            group = (i,) if sure else self._alike(mode, kept, i, deviation)
            lines = (self.readings[j].row for j in group)
            rows = tuple(sorted(row for row in lines if row is not None))
            own = self.readings[i]
            predicted = float(self.value[i] - gap[i])
            found[own.row] = Misfit(own, predicted, float(spread[i]), words, rows)
            for other in (self.readings[j] for j in group if j != i):
                also = Misfit(
                    other, other.value, other.u, "contradicts the others of its group", rows
                )
                found.setdefault(other.row, also)
        return tuple(m for row, m in found.items() if row is not None), kept

    def _left_out(self, mode: Mode, kept: Mask) -> tuple[Array, Array]:
        """How far each reading is from what the others predict, and the standard uncertainty of
        that.
        """
        found, slopes = self.linkage.slopes(self.readings, mode.vector[None])
        gap = self.value - found[0]
        g = slopes[0]
        known = np.einsum("mi,ij,mj->m", g, mode.covariance, g) / self.u**2
        # With the reading among those kept its own weight is taken out; else the prediction's is
        # added.
        held = np.clip(1.0 - known, 1e-9, None)
        return np.where(kept, gap / held, gap), self.u * np.where(
            kept, 1.0 / np.sqrt(held), np.sqrt(1.0 + known)
        )

    def _alike(self, mode: Mode, kept: Mask, i: int, size: float) -> tuple[int, ...]:
        """Readings one of which is wrong without anybody telling which: leaving out any of them
        fits alike.
        """
        slopes = self.linear(mode.vector[None])[1][0]
        column = mode.covariance @ slopes[i]
        variance = 1.0 + slopes[i] @ column
        covariance = mode.covariance - np.outer(column, column) / variance
        rows = np.flatnonzero(kept | (np.arange(len(kept)) == i))
        explained = slopes[rows] @ covariance @ slopes[rows].T
        residual = np.eye(len(rows)) - explained
        at = int(np.flatnonzero(rows == i)[0])
        variances = residual[at, at] * np.diag(residual)
        alike = residual[at] ** 2 / np.clip(variances, 1e-12, None)
        loss = (1.0 - np.minimum(alike, 1.0)) * size**2
        return tuple(rows[loss < tuned.ALIKE_LOSS].tolist())

    def _suggestion(
        self, mode: Mode, i: int, gap: Array, spread: Array, out: Mask
    ) -> tuple[str, bool]:
        """What would make a misfit fit, and whether that says that this reading is the wrong
        one.
        """
        reading = self.readings[i]
        near = 3.5 * float(spread[i])
        value = reading.value
        expected = reading.value - float(gap[i])
        for j in map(int, np.flatnonzero(out)):
            other = self.readings[j]
            if j != i and other.row is not None and other.kind is reading.kind:
                back = other.value - float(gap[j])
                if abs(other.value - expected) < near and abs(value - back) < 3.5 * float(
                    spread[j]
                ):
                    said = Sentence.of("swapped with row {}: {}", other.row, other.words)
                    return said, True
        if not reading.is_angle:
            for slip in tuned.SURVEY_SLIPS:
                for size, factor, words in (
                    ("large", 1 / slip.factor, slip.too_large),
                    ("small", slip.factor, slip.too_small),
                ):
                    if abs(value * factor - expected) < near:
                        said = Sentence.of(
                            "{} would fit: the value is {} times too {}, {}",
                            reading.shown(value * factor),
                            f"{slip.factor:g}",
                            size,
                            words,
                        )
                        return said, True
        if reading.kind is ReadingKind.DISTANCE:
            names = [p.name for p in self.linkage.space.mechanism.points]
            pairs = [(reading.start, n) for n in names] + [(n, reading.end) for n in names]
            others = [
                SurveyReading(ReadingKind.DISTANCE, a, b, extension=reading.extension)
                for a, b in pairs
                if a != b and {a, b} != {reading.start, reading.end}
            ]
            guess = self.linkage.predicted(tuple(others), mode.vector[None])[0]
            best = int(np.nanargmin(np.abs(guess - value)))
            if abs(guess[best] - value) < 3.5 * reading.u:
                said = Sentence.of(
                    "a wrong pin: {} to {} measures {}",
                    others[best].start,
                    others[best].end,
                    reading.shown(guess[best]),
                )
                return said, True
        if not reading.is_angle:
            for inches in tuned.MISREAD_IN:
                if near < 0.4 * inches and abs(abs(gap[i]) - inches) < near:
                    said = Sentence.of(
                        "misread by {}: {} would fit",
                        reading.shown(inches),
                        reading.shown(expected),
                    )
                    return said, True
        said = Sentence.of(
            "the others give {} ± {}: read it again",
            reading.shown(expected),
            reading.shown(float(spread[i])),
        )
        return said, False

    def draws(self, modes: tuple[Mode, ...], kept: Mask, rng: Generator) -> Array:
        """Draws from the posterior, all of which close: of each mode its share."""
        prior = self.prior
        n = len(self.prior.mean)
        begun = []
        for mode in modes:
            count = max(1, round(tuned.DRAWS * mode.weight))
            means = mode.mean + rng.standard_normal((count, n)) @ prior.root.T
            noise = rng.standard_normal((count, len(self.readings)))
            _, slopes = self.linear(mode.vector[None])
            g = np.where(kept[:, None], slopes[0], 0.0)
            pulled = (means - mode.mean) @ prior.whiten.T @ prior.whiten + noise @ g
            # A valley is curved: each draw begins as far along its linear step as that helps.
            steps = [mode.vector + t * pulled @ mode.covariance for t in tuned.ALONG_PULL]
            if mode.parameters < tuned.FEW * n:
                # So little is known that the modes say little: each draw begins at its own draw of
                # the prior.
                drawn = np.concatenate([prior.closing(count, rng), means])
                means = steps[0] = drawn[:count]
                del steps[1:]
            fits = self.begun(means, means, kept, noise)
            losses = [self.loss(replace(fits, points=x), 1.0, False) for x in steps]
            points = np.choose(np.argmin(losses, axis=0)[:, None], steps)
            begun.append(replace(fits, points=points))
        fits = Fits.joined(*begun)
        # The remaining loss of a draw that arrived is chi-squared, with as many degrees as
        # readings.
        enough = kept.sum() + tuned.FAR * np.sqrt(2.0 * kept.sum())
        points = fits.points
        loss = np.full(len(fits.points), np.inf)
        late = np.arange(len(points))
        for _ in range(tuned.DRAW_ROUNDS):
            found = self.descend(fits[late], 1.0, tuned.DRAW_STEPS, False)
            points[late] = found.points
            loss[late] = found.loss
            late = np.flatnonzero(loss > enough)
            if not len(late):
                break
            # One that is held up in another valley begins again at the nearest that is in the right
            # one.
            sound = np.concatenate([[mode.vector for mode in modes], points[loss <= enough]])
            away = (fits.means[late][:, None] - sound) @ prior.whiten.T
            apart = (away**2).sum(axis=2)
            points[late] = sound[np.argmin(apart, axis=1)]
        arrived = points[(loss <= enough) & self.linkage.closes(points)]
        if len(arrived) < 2:
            raise InconclusiveDataError(
                "no linkage near the fitted one moves over its whole stroke",
                "Check the extensions and their unit.",
            )
        return rng.permutation(arrived)


def _robust(r: Array) -> tuple[Array, Array]:
    """Loss of residuals and their weights: Student's t, or a slip, which costs the same however
    large it is.
    """
    loss = (tuned.FREEDOM + 1.0) * np.log1p(r * r / tuned.FREEDOM)
    sound = 1.0 / (1.0 + np.exp((loss - tuned.SLIP_LOSS) / 2.0))
    weight = sound * (tuned.FREEDOM + 1.0) / (tuned.FREEDOM + r * r)
    return loss + 2.0 * np.log(sound), weight


def fit(
    gear: Gear,
    readings: Readings,
    rng: Generator,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> Survey:
    """Find the linkages that fit the readings, what does not fit, and draws from the posterior.

    progress: called with the stages that are done and how many there are.
    """
    progress(0, tuned.STAGES)
    linkage = SurveyedLinkage(gear)
    prior = Prior(linkage)
    if linkage.travel is not None:
        readings = (
            *readings,
            SurveyReading(
                ReadingKind.TRAVEL, value=linkage.travel, u=DEFAULT_U[ReadingKind.TRAVEL]
            ),
        )
    if len(readings) < tuned.FEW * len(linkage.names):
        readings = (*readings, prior.order)
    fitting = Fitting(linkage, prior, readings)
    drawn = prior.closing(tuned.STARTS, rng, readings)
    starts = np.concatenate([prior.members, drawn])
    fits = fitting.reheated(fitting.begun(fitting.robust(starts)), rng)
    progress(1, tuned.STAGES)
    kept = fitting.trusted(fits)
    if not kept.all() and fitting.still:
        # What does not fit is a slip or another valley.
        found = fits.points[: tuned.MOST_MODES]
        others = fitting.suspected(starts)
        others = replace(others, means=np.broadcast_to(prior.mean, others.points.shape))
        fits = fitting.reheated(Fits.joined(fitting.begun(found), others), rng)
        kept = fitting.trusted(fits)
    # What is that much less likely, each slip counted, is not a mode: without what was exchanged it
    # might seem one.
    most_loss = fits.loss[0] - 2.0 * np.log(tuned.LEAST_WEIGHT)
    points = fits.points[fits.loss <= most_loss]
    progress(2, tuned.STAGES)
    modes = fitting.modes(points, np.broadcast_to(prior.mean, points.shape), kept)
    if not modes:
        raise InconclusiveDataError(
            "no linkage of this type has these dimensions: none of the starts can be assembled with"
            " them",
            "Check the units and the points of the readings.",
        )
    progress(tuned.STAGES - 2, tuned.STAGES)
    misfits, kept = fitting.misfits(modes[0], kept)
    vectors = np.array([m.vector for m in modes])
    means = np.array([m.mean for m in modes])
    modes = fitting.modes(vectors, means, kept) or modes
    modes = fitting.with_mirrored(modes, kept)
    progress(tuned.STAGES - 1, tuned.STAGES)
    draws = fitting.draws(modes, kept, rng)
    progress(tuned.STAGES, tuned.STAGES)
    return Survey(linkage, readings, misfits, modes, draws)
