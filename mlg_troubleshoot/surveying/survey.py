"""A linkage from readings, by robust least squares from every linkage of the ensemble.

The design variables are x = m + L z, with z ~ N(0, I): m and L Lᵀ are mean and covariance of the
ensemble. A reading is y = f(x) + u e, with e of Student's t distribution, so that an entry error
does not bend the linkage. The fit minimises the sum of (ν + 1) ln(1 + e²/ν) and of z² (1). Of the
readings that fit, with slopes J of f/u, the posterior is normal about it with covariance
(I + JᵀJ)⁻¹ of z (2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from scipy.optimize import least_squares

from mlg_troubleshoot.arrays import Array, Mask, central_slopes, central_steps, frozen
from mlg_troubleshoot.errors import InconclusiveDataError, UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.gear.design import member_values
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear, read_gear_file, with_changes
from mlg_troubleshoot.outputs import write_text
from mlg_troubleshoot.results import Result
from mlg_troubleshoot.surveying.readings import (
    ReadingKind,
    SurveyedLinkage,
    SurveyReading,
    read_table,
)
from mlg_troubleshoot.units import MM_PER_IN

# The prior. Share of the ensemble's covariances that is believed: its members were found by one
# method; standard deviations without an ensemble, in the linkage's size and as an angle; the least
# ones, as a share of those; that of the prescribed travel. [1, 1, rad, 1, in]
_COVARIANCE_SHARE = 0.5
_ALONE_SIZE = 0.5
_ALONE_ANGLE = float(np.radians(30))
_LEAST_SPREAD = 0.01
_TRAVEL_U = 0.005
# Two lengths are in each other's unit if their ratio is 25.4 to this share. [1]
_ALIKE = 0.1
# Degrees of freedom of the errors of readings, and the residual of one at which the linkage does
# not close: a loss of 100. [1]
_FREEDOM = 4.0
_OPEN = 4.4e4
# The search. Starts of a round, rounds, and how far uncertainties are widened in turn with the
# steps and the fits that are kept: at first for what is read at the reference position, which
# closes from every start; of these, those that come near all readings are gone on with. [1]
_STARTS = 45
_ROUNDS = 6
_SIGHT = 30.0
_STANDING = ((100.0, 8), (10.0, 8), (1.0, 8))
_MOVING = ((10.0, 8, 8), (3.0, 10, 5), (1.0, 40, 3))
# Residuals that a fit may have and is the one: on average one unit of loss, but for two readings.
_ENTRY_ERRORS = 2
# A reading is believed at first within so many uncertainties of the robust fit, and in the end
# within so many of what the others predict: the largest of forty exceeds that in 0.4 %. [1]
_TRUSTED = 6.0
_MISFIT = 3.9
# Two fits are different if a variable z differs by more than the first, and as likely if the losses
# differ by less than the second. [1]
_APART = 0.1
_AS_LIKELY = 3.0
# Draws of the posterior, and those of them that are an ensemble.
_DRAWS = 200
_MEMBERS = 11


@dataclass(frozen=True, slots=True)
class Misfit:
    """A reading that the others contradict.

    Parameters
    ----------
    reading : SurveyReading
        The reading.
    expected, u : float
        What the others predict for it, and with what standard uncertainty. [in or rad]
    """

    reading: SurveyReading
    expected: float
    u: float

    def __str__(self) -> str:
        shown = self.reading.shown
        words = f"{self.reading.name}: {shown(self.reading.value)}, the others give"
        words = f"{words} {shown(self.expected)} ± {shown(self.u)}"
        ratio = self.reading.value / self.expected
        if not self.reading.is_angle and abs(abs(np.log(ratio)) - np.log(MM_PER_IN)) < _ALIKE:
            return f"{words}: inches and millimetres exchanged"
        return words


@dataclass(frozen=True, slots=True)
class Adjusted:
    """A number that a survey gives, with its 95 % interval. [in, rad or 1]"""

    name: str
    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class SurveyResult(Result):
    """What a survey gave.

    Parameters
    ----------
    gear : Gear
        The gear with the surveyed linkage, and draws of the posterior as its ensemble.
    numbers : tuple of Adjusted
        Coordinates, angles, extension and travel. [in or rad]
    joints : tuple of Adjusted
        Plunger amplification index of each joint (Eq. 8). [1]
    readings : tuple of SurveyReading
        The readings.
    residuals : ndarray, shape (n_readings,)
        Predicted less read, in standard uncertainties of the readings. [1]
    misfits : tuple of Misfit
        Readings that the others contradict; they do not count.
    fits : int
        Different linkages that the readings allow. Above 1 read something that distinguishes them.
    seed : int
        Seed of the starts and draws.
    """

    gear: Gear
    numbers: tuple[Adjusted, ...]
    joints: tuple[Adjusted, ...]
    readings: tuple[SurveyReading, ...]
    residuals: Array
    misfits: tuple[Misfit, ...]
    fits: int
    seed: int

    def write(self, path: str | Path, *, force: bool = False) -> Gear:
        """Write the gear file and its ensemble, and load it.

        Raises UsageError if the name does not end in .toml, or a file exists and `force` is false.
        """
        file = Path(path)
        ensemble = file.with_name(f"{file.stem}-ensemble.toml")
        exists = any(each.exists() for each in (file, ensemble))
        if file.suffix != ".toml" or (exists and not force) or file in self.gear.files:
            raise UsageError(
                f"{file} cannot be written: it or {ensemble.name} exists",
                "Give a name that ends in .toml and is free, or force=True.",
            )
        own = member_values(self.gear.reference)
        points = [*own.get("ground", ()), *own.get("moving", ())]
        changes: dict[str, Any] = {
            "id": file.stem,
            "provenance": self.gear.provenance,
            "ensemble": ensemble.name,
            "indices": f"{file.stem}-indices.json",
            "sources": {"survey": {"kind": "measured", "text": self.gear.provenance}},
            "source_of": dict.fromkeys(points, "survey"),
            "input": {"source": "survey"},
            "planes": {name: {"source": "survey"} for name in own.get("planes", ())},
        }
        if self.gear.calibration.travel_in is not None:
            changes["calibration"] = {"travel": self.gear.calibration.travel_in}
        values = with_changes(with_changes(read_gear_file(self.gear.path).values, own), changes)
        members = {each.name: member_values(each) for each in self.gear.ensemble[1:]}
        drawn = {"source": f"Drawn from what the readings leave open: {self.gear.provenance}."}
        write_text(ensemble, tomli_w.dumps({**drawn, "members": members}))
        write_text(file, tomli_w.dumps({k: v for k, v in values.items() if v != {}}))
        return load_gear(file)


def survey(readings: Any, gear: Gear | str | Path = DEFAULT_GEAR, *, seed: int = 0) -> SurveyResult:
    """Find the linkage of a gear from readings of it.

    Parameters
    ----------
    readings : DataFrame, str or Path
        One reading per row, as docs/how-to/measured-gear.md has them; rows without a value count as
        not read.
    gear : Gear, str or Path
        The gear whose type it is; its ensemble says what is known before.
    seed : int
        Seed of the starts and draws.

    Returns
    -------
    SurveyResult
        The gear, the adjusted numbers with 95 % intervals, and the readings that do not fit.

    Raises
    ------
    UsageError
        If cells of the table are wrong; each is named.
    InconclusiveDataError
        If no linkage of the type has these dimensions.
    """
    before = load_gear(gear)
    linkage = SurveyedLinkage(before)
    read = read_table(readings, linkage)
    fit = _Fit(linkage, read)
    rng = np.random.default_rng(seed)
    kept, modes = fit.settled(fit.search(rng))
    best, _, covariance, _ = modes[0]
    weights = np.exp([modes[0][1] - cost for _, cost, _, _ in modes])
    counts = np.ceil(_DRAWS * weights / weights.sum()).astype(int)
    drawn = [
        rng.multivariate_normal(z, spread, count)
        for (z, _, spread, _), count in zip(modes, counts, strict=True)
    ]
    points = fit.points(np.vstack([best, rng.permutation(np.concatenate(drawn))]))
    with np.errstate(all="ignore"):
        indices = linkage.amplification(points)
    closed = np.array(np.isfinite(indices).all(axis=1))
    if not closed[0] or closed.sum() < 3:
        raise InconclusiveDataError(
            "no linkage near the fitted one moves over its whole stroke",
            "Check the extensions and their unit.",
        )
    residuals = fit.residuals(best[None])[0]
    slopes = fit.slopes(best)
    known = np.sqrt(np.einsum("ij,jk,ik->i", slopes, covariance, slopes))
    misfits = tuple(
        Misfit(r, r.value + residual * r.u, float(share * r.u))
        for r, residual, share, fits in zip(read, residuals, known, kept, strict=True)
        if not fits
    )
    values = points[closed]
    joints = [f"#{number}" for number in before.joint_numbers]
    return SurveyResult(
        _surveyed(before, linkage, values, len(read)),
        _adjusted(linkage.names, values),
        _adjusted(joints, indices[closed]),
        read,
        frozen(residuals),
        misfits,
        len(modes),
        seed,
    )


def _adjusted(names: Sequence[str], values: Array) -> tuple[Adjusted, ...]:
    """The first row, with the interval of the others."""
    columns = (values[0], *np.quantile(values[1:], [0.025, 0.975], axis=0))
    return tuple(map(Adjusted, names, *(column.tolist() for column in columns)))


def _surveyed(before: Gear, linkage: SurveyedLinkage, values: Array, count: int) -> Gear:
    """The gear whose linkage and ensemble are the rows."""
    ensemble = tuple(
        linkage.linkage(each, f"S{k}" if k else "A")
        for k, each in enumerate(values[: _MEMBERS + 1])
    )
    calibration = before.calibration
    if linkage.travel is not None:
        calibration = replace(calibration, travel_in=float(values[0, -1]))
    digest = sha256(values.tobytes()).hexdigest()
    return replace(
        before,
        provenance=f"surveyed ({count} readings)",
        reference=ensemble[0],
        ensemble=ensemble,
        calibration=calibration,
        geometry_sha256=digest,
        ensemble_sha256=digest,
    )


def _distinct(fits: list[Any], count: int) -> list[Any]:
    """The best different fits."""
    found: list[Any] = []
    for fit in sorted(fits, key=lambda fit: float(fit.cost)):
        if all(np.abs(fit.x - other.x).max() > _APART for other in found):
            found.append(fit)
    return found[:count]


class _Fit:
    """The readings of one survey against the prior of its gear, in variables z of equation 1."""

    def __init__(self, linkage: SurveyedLinkage, readings: tuple[SurveyReading, ...]) -> None:
        self.linkage = linkage
        self.readings = readings
        self.value = np.array([r.value for r in readings])
        self.u = np.array([r.u for r in readings])
        self.all = np.ones(len(readings), bool)
        members = np.array([linkage.vector(each) for each in linkage.gear.ensemble])
        angles = linkage.is_angle
        # The same direction, one turn further, is not a distance.
        turned = members[:, angles] - members[0, angles]
        members[:, angles] -= 2.0 * np.pi * np.round(turned / (2.0 * np.pi))
        points = linkage.gear.reference.mechanism.points
        size = np.std([c for p in points for c in (p.x, p.y)])
        alone = np.where(angles, _ALONE_ANGLE, _ALONE_SIZE * size)
        covariance = np.diag(alone**2)
        if len(members) > 2:
            around = np.cov(members.T)
            own = np.diag(np.diag(around))
            covariance = _COVARIANCE_SHARE * around + (1.0 - _COVARIANCE_SHARE) * own
            covariance += np.diag((_LEAST_SPREAD * alone) ** 2)
        if linkage.travel is not None:
            covariance[-1, -1] = _TRAVEL_U**2
        self.mean = members.mean(axis=0)
        self.root = np.linalg.cholesky(covariance)
        self.members = np.linalg.solve(self.root, (members - self.mean).T).T

    def points(self, z: Array) -> Array:
        found: Array = self.mean + z @ self.root.T
        return found

    def residuals(self, z: Array) -> Array:
        """Shape (n_points, n_readings); NaN where the linkage does not close. [1]"""
        with np.errstate(all="ignore"):
            found = self.linkage.predicted(self.readings, self.points(z))
        residuals: Array = (found - self.value) / self.u
        return residuals

    def slopes(self, z: Array) -> Array:
        """Shape (n_readings, n_variables); 0 where the linkage does not close. [1]"""
        with np.errstate(all="ignore"):
            tried = self.points(z) + central_steps(len(z))
            found = central_slopes(self.linkage.predicted(self.readings, tried)).T
        slopes: Array = np.where(np.isfinite(found), found, 0.0) @ self.root / self.u[:, None]
        return slopes

    def losses(self, z: Array, widened: float) -> Array:
        """Loss of each reading, shape (n_points, n_readings). [1]"""
        residuals = self.residuals(z) / widened
        square = np.where(np.isfinite(residuals), residuals, _OPEN) ** 2
        found: Array = (_FREEDOM + 1.0) * np.log1p(square / _FREEDOM)
        return found

    def descend(
        self,
        z: Array,
        kept: Mask,
        steps: int,
        widened: float = 1.0,
        *,
        middle: Any = 0.0,
        robust: bool = True,
    ) -> Any:
        """Minimise equation 1 from one point; middle: of the prior, else 0."""
        count = len(kept)
        weight = (kept / widened)[:, None]

        def residuals(at: Array) -> Array:
            found = self.residuals(at[None])[0] / widened
            found = np.where(np.isfinite(found), found, _OPEN)
            return np.append(np.where(kept, found, 0.0), at - middle)

        def loss(square: Array) -> Array:
            rho = np.array([square, np.ones_like(square), np.zeros_like(square)])
            inner = 1.0 + square[:count] / _FREEDOM
            slope = (_FREEDOM + 1.0) / _FREEDOM / inner
            logarithm = (_FREEDOM + 1.0) * np.log(inner)
            rho[:, :count] = logarithm, slope, -slope / inner / _FREEDOM
            return rho

        def slopes(at: Array) -> Array:
            return np.vstack([self.slopes(at) * weight, np.eye(len(at))])

        measure: Any = loss if robust else "linear"
        return least_squares(residuals, z, slopes, loss=measure, max_nfev=steps)

    def search(self, rng: np.random.Generator) -> list[Any]:
        """The best robust fits of two rounds, or until one explains all readings but two."""
        standing = _Fit(
            self.linkage,
            tuple(
                r
                for r in self.readings
                if r.kind is not ReadingKind.PLUNGER and r.extension is None
            ),
        )
        best: list[Any] = []
        starts = self.members
        for turn in range(_ROUNDS):
            drawn = rng.standard_normal((_STARTS, len(self.mean)))
            starts = np.concatenate([starts, drawn])[:_STARTS]
            for k, start in enumerate(starts.copy()):
                for widened, steps in _STANDING:
                    begun = standing.descend(starts[k], standing.all, steps, widened, middle=start)
                    starts[k] = begun.x
            cost = self.losses(starts, _SIGHT).sum(axis=1) + (starts**2).sum(axis=1)
            points = list(starts[np.argsort(cost)[: _STARTS // 3]])
            for widened, steps, count in _MOVING:
                fits = [self.descend(z, self.all, steps, widened) for z in points]
                fits = _distinct(fits, count)
                points = [fit.x for fit in fits]
            best = _distinct([*best, *fits], count)
            z = best[0].x
            losses = np.sort(self.losses(z[None], 1.0)[0])[:-_ENTRY_ERRORS]
            if turn and losses.sum() + z @ z < len(losses):
                break
            starts = starts[:0]
        return best

    def settled(self, fits: list[Any]) -> tuple[Mask, list[tuple[Array, float, Array, Array]]]:
        """The readings that fit, and the fits of them that are as likely: z, its loss and
        covariance (2).
        """
        robust = self.descend(fits[0].x, self.all, 300).x
        kept = np.abs(np.nan_to_num(self.residuals(robust[None])[0], nan=np.inf)) < _TRUSTED
        for _ in self.readings:
            fitted = self._fitted(robust, kept)
            excess = np.abs(fitted[3])
            worst = np.argmax(np.where(kept, excess, 0.0))
            if excess[worst] * kept[worst] > _MISFIT:
                kept[worst] = False
            elif (~kept & (excess < _MISFIT)).any():
                kept |= excess < _MISFIT
            else:
                break
        modes = [fitted]
        for fit in fits[1:]:
            other = self._fitted(fit.x, kept)
            apart = min(float(np.abs(other[0] - mode[0]).max()) for mode in modes)
            if other[1] < fitted[1] + _AS_LIKELY and apart > _APART:
                modes.append(other)
        return kept, sorted(modes, key=lambda mode: mode[1])

    def _fitted(self, z: Array, kept: Mask) -> tuple[Array, float, Array, Array]:
        """Fit, loss, covariance, and each reading against what the others predict for it, in its
        standard deviations. [1]
        """
        fit = self.descend(z, kept, 100, robust=False)
        slopes = self.slopes(fit.x)
        used = slopes * kept[:, None]
        covariance = np.linalg.inv(np.eye(len(z)) + used.T @ used)
        known = np.einsum("ij,jk,ik->i", slopes, covariance, slopes)
        size = np.where(kept, np.maximum(1.0 - known, 1e-9), 1.0 + known)
        residuals = np.nan_to_num(self.residuals(fit.x[None])[0], nan=_OPEN)
        excess: Array = residuals / np.sqrt(size)
        return fit.x, float(fit.cost), np.asarray(covariance, float), excess
