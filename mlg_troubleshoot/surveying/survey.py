"""A linkage from readings, by robust least squares from every linkage of the ensemble.

The design variables are x = m + L z, with z ~ N(0, I): m and L Lᵀ are mean and covariance of the
ensemble. A reading is y = f(x) + u e, with e of Student's t distribution, so that an entry error
does not bend the linkage. The fit minimises the sum of (ν + 1) ln(1 + e²/ν) and of z² (1). Of the
readings that fit, with slopes J of f/u, the posterior is normal about it with covariance
(I + JᵀJ)⁻¹ of z (2).

What is read on a gear, and what a linkage of its type predicts for it.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from hashlib import sha256
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from scipy.optimize import least_squares

from mlg_troubleshoot.arrays import Array, Mask, central_slopes, central_steps, frozen
from mlg_troubleshoot.errors import InconclusiveDataError, UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.gear.assembly import DesignSpace, member_values
from mlg_troubleshoot.gear.gear import Gear, Linkage
from mlg_troubleshoot.gear.gear_file import load_gear, read_gear_file, with_changes
from mlg_troubleshoot.geometry.kernel import Kernel
from mlg_troubleshoot.geometry.program import write_program
from mlg_troubleshoot.outputs import write_text
from mlg_troubleshoot.results import Result
from mlg_troubleshoot.units import MM_PER_IN, LengthUnit

# Positions over the stroke among which the least displacement of the plunger is sought.
_POSITIONS = 25
_COLUMNS = (
    *("kind", "from", "to", "value_in", "value_mm", "value_deg", "u_in", "u_mm", "u_deg"),
    *("extension_in", "extension_mm", "note"),
)


# What a frame or a file has in an empty cell.
_BLANK = ("", "nan", "None", "<NA>", "NaT")


class ReadingKind(StrEnum):
    """What is read: the distance of two pins, the plunger relative to its reference position, an
    angle, the extension from Down Lock to the reference position.
    """

    DISTANCE = "DISTANCE"
    PLUNGER = "PLUNGER"
    ANGLE = "ANGLE"
    EXTENSION = "EXTENSION"


# Standard uncertainty of a reading that states none: assumed for a caliper, a dial indicator and an
# inclinometer. [in or rad]
_ANGLE_U = float(np.radians(1))
_DEFAULT_U = {
    ReadingKind.DISTANCE: 0.01,
    ReadingKind.PLUNGER: 0.0015,
    ReadingKind.ANGLE: _ANGLE_U,
    ReadingKind.EXTENSION: 0.005,
}


@dataclass(frozen=True, slots=True)
class SurveyReading:
    """One reading.

    row: label of its row in the table. start, end: names of two points; a hinged plane and
    ``hinge`` or ``dihedral``; the joint of a slider and ``axis``. value, u: reading and its
    standard uncertainty. [in or rad] extension: input at the reading, from Down Lock; None at the
    reference position. [in or rad]
    """

    row: Any
    kind: ReadingKind
    start: str
    end: str
    value: float
    u: float
    extension: float | None
    is_angle: bool

    @property
    def name(self) -> str:
        parts = filter(None, (self.kind.lower(), self.start, self.end))
        at = "" if self.extension is None else f" at extension {self.extension:g}"
        return f"row {self.row}, {' '.join(parts)}{at}"

    def shown(self, value: float) -> str:
        return f"{np.degrees(value):.2f}°" if self.is_angle else f"{value:.4f} in"


class SurveyedLinkage:
    """The design variables of a gear's linkage and its travel, for batches of vectors."""

    def __init__(self, gear: Gear) -> None:
        self.gear = gear
        self.space = DesignSpace(gear.reference)
        self.kernel = Kernel(gear.reference.mechanism)
        self.travel = gear.calibration.travel_in
        self.names = (*self.space.names, *(() if self.travel is None else ("travel",)))
        self.is_angle = np.array(
            [name.endswith((".direction", ".dihedral", ".axis")) for name in self.names]
        )
        self.low, self.high = gear.reference.stroke
        self.after = self.high - gear.reference.mechanism.reference_input

    def vector(self, linkage: Linkage) -> Array:
        """The variables of one of the gear's linkages, shape (n_variables,). [in or rad]"""
        return np.append(self.space.vector(linkage), () if self.travel is None else self.travel)

    def linkage(self, vector: Array, name: str) -> Linkage:
        return self.space.linkage(vector[: len(self.space.names)], name)

    def _solver(self, vectors: Array) -> tuple[Any, Array, list[Any], Any]:
        """Mechanisms of a batch, their reference inputs, their numbers, each of shape (n_vectors,
        1), and their calibration rates k (section 4.2), by a parabola through the least position of
        the plunger and its neighbours. [1]
        """
        mechanism = self.space.assembled(vectors[:, : len(self.space.names)])
        count = len(vectors)
        reference = np.broadcast_to(np.asarray(mechanism.reference_input, float), count)[:, None]
        parameters = write_program(mechanism).parameters.values()
        numbers = [np.broadcast_to(np.asarray(v, float), count)[:, None] for v in parameters]
        if self.travel is None:
            return mechanism, reference, numbers, 1.0
        share = np.linspace(0.0, 1.0, _POSITIONS)
        inputs = self.low + (reference + self.after - self.low) * share
        raw = self.kernel.output(inputs, self.kernel.no_clearance(), numbers)
        direction = np.sign(raw[:, -1:] - raw[:, :1])
        along = direction * raw
        middle = np.clip(np.argmin(along, axis=1), 1, _POSITIONS - 2)[:, None]
        before, least, after = np.take_along_axis(along, middle + np.arange(-1, 2), 1).T
        slope = (after - before) / 2.0
        bend = after - 2.0 * least + before
        step = np.clip(-slope / np.maximum(bend, 1e-12), -1.0, 1.0)
        least = least + step * (slope + step * bend / 2.0)
        rate = direction * vectors[:, -1:] / (along[:, -1:] - least[:, None])
        return mechanism, reference, numbers, rate

    def predicted(self, readings: tuple[SurveyReading, ...], vectors: Array) -> Array:
        """What each vector predicts for each reading, shape (n_vectors, n_readings); NaN where the
        linkage does not close. [in or rad]
        """
        mechanism, reference, numbers, rate = self._solver(vectors)
        tight = self.kernel.no_clearance()
        extensions = list(dict.fromkeys((None, *(r.extension for r in readings))))
        inputs = np.hstack(
            [reference if e is None else np.full_like(reference, self.low + e) for e in extensions]
        )
        output = self.kernel.output(inputs, tight, numbers)
        plunger = (output - output[:, :1]) * rate
        places = {}
        for name, place in self.kernel.positions(inputs, tight, numbers).items():
            origin, axes = mechanism.frame(mechanism.point(name).plane)
            x, y = (np.broadcast_to(each, inputs.shape)[..., None] for each in place)
            across = x * axes[..., None, 0, :] + y * axes[..., None, 1, :]
            places[name] = origin[..., None, :] + across
        columns = []
        for r in readings:
            at = extensions.index(r.extension)
            if r.kind is ReadingKind.DISTANCE:
                apart = (places[r.start] - places[r.end])[:, at]
                columns.append(np.linalg.norm(apart, axis=1))
            elif r.kind is ReadingKind.PLUNGER:
                columns.append(plunger[:, at])
            elif r.kind is ReadingKind.EXTENSION:
                columns.append(reference[:, 0] - self.low)
            else:
                angle = f"{r.start}.{'direction' if r.end == 'hinge' else r.end}"
                turned = vectors[:, self.names.index(angle)]
                # The nearest of the turns that mean the same direction.
                turns = np.round((turned - r.value) / (2.0 * np.pi))
                columns.append(turned - 2.0 * np.pi * turns)
        return np.column_stack(columns)

    def amplification(self, vectors: Array) -> Array:
        """Plunger amplification index A_iP of each joint (Eq. 8), shape (n_vectors, n_joints);
        NaN where the linkage does not close over its whole stroke. [1]
        """
        _, reference, numbers, rate = self._solver(vectors)
        links = central_steps(len(self.kernel.no_clearance()))
        moved = self.kernel.output(reference + self.after, list(links.T), numbers)
        gradient = central_slopes(moved, axis=1) * rate
        found: Array = np.hypot(gradient[:, 0::2], gradient[:, 1::2])
        return found


def read_table(table: Any, linkage: SurveyedLinkage) -> tuple[SurveyReading, ...]:
    """Read the rows of a CSV file or frame that have a value; UsageError names every wrong cell."""
    if isinstance(table, str | Path):
        with Path(table).open(encoding="utf-8-sig", newline="") as file:
            rows = list(enumerate(csv.DictReader(file), start=2))
    else:
        rows = list(zip(table.index, table.to_dict("records"), strict=True))
    columns = dict.fromkeys(name for _, cells in rows for name in cells)
    wrong = [f"column {name!r} is unknown" for name in columns if name not in _COLUMNS]
    readings = []
    for row, cells in rows:
        filled = {k: v for k, v in cells.items() if str(v).strip() not in _BLANK}
        if any(name.startswith("value_") for name in filled):
            try:
                readings.append(_reading(row, filled, linkage))
            except (KeyError, ValueError) as error:
                wrong.append(f"row {row}: {error.args[0]}")
    if wrong or not readings:
        raise UsageError(
            f"the survey has no usable table of readings: {'; '.join(wrong) or 'no value in it'}",
            f"Its columns are {', '.join(_COLUMNS)}: see docs/how-to/measured-gear.md.",
        )
    return tuple(readings)


def _reading(row: Any, cells: dict[str, Any], linkage: SurveyedLinkage) -> SurveyReading:
    space = linkage.space
    kind = ReadingKind(str(cells.get("kind", "")).strip().upper())
    # A spreadsheet takes the point 4 for a number.
    texts = (cells.get(name, "") for name in ("from", "to"))
    ends = tuple(f"{each:g}" if isinstance(each, float) else str(each).strip() for each in texts)
    points = [point.name for point in space.mechanism.points]
    angles = [(plane, what) for plane in space.planes for what in ("hinge", "dihedral")]
    angles += [(slider, "axis") for slider in space.sliders]
    nothing = [("", "")]
    known = {
        ReadingKind.DISTANCE: list(permutations(points, 2)),
        ReadingKind.ANGLE: angles,
        ReadingKind.PLUNGER: nothing,
        ReadingKind.EXTENSION: nothing if space.moves_reference else [],
    }
    if ends not in known[kind]:
        raise ValueError(
            f"no {kind} from {ends[0]!r} to {ends[1]!r}: expected points of"
            f" {', '.join(points)}, angles of {angles}, for the plunger blank cells"
        )
    turns = space.mechanism.output.kind == "angle" and kind is ReadingKind.PLUNGER
    is_angle = turns or kind is ReadingKind.ANGLE
    value = _number(cells, "value", is_angle)
    u = _number(cells, "u", is_angle) or (_ANGLE_U if is_angle else _DEFAULT_U[kind])
    least = 0.0 if kind in (ReadingKind.DISTANCE, ReadingKind.EXTENSION) else -np.inf
    if value is None or not value > least or not u > 0.0:
        raise ValueError(f"{kind} {value} ± {u}: expected a reading above 0 and its uncertainty")
    extension = _number(cells, "extension", is_angle=False)
    return SurveyReading(row, kind, *ends, value, u, extension, is_angle)


def _number(cells: dict[str, Any], name: str, is_angle: bool) -> float | None:
    """The number of a quantity. [in or rad]"""
    given = [(unit, f"{name}_{unit}") for unit in ("in", "mm", "deg") if f"{name}_{unit}" in cells]
    if not given:
        return None
    ((unit, column),) = given[:1]
    text = str(cells[column])
    if len(given) > 1 or (unit == "deg") != is_angle:
        raise ValueError(f"{column} {text!r}: expected one {'angle' if is_angle else 'length'}")
    try:
        number = float(text)
    except ValueError:
        number = np.nan
    if not np.isfinite(number):
        raise ValueError(f"{column} {text!r}: expected a number")
    return float(np.radians(number)) if is_angle else LengthUnit.parse(unit).to_inches(number)


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
