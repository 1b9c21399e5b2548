"""A linkage from readings, by robust least squares from every linkage of the ensemble.

The design variables are x = m + L z: m and L Lᵀ are mean and covariance of the ensemble, z of each
linkage of the type is about of unit size. A reading is y = f(x) + u e. An entry error does not bend
the linkage: the fit minimises the sum of c² ln(1 + (e/c)²) over all e and all z (1). The readings
that the others do not contradict are fitted by least squares; with slopes J of f/u, each is known
from the others by the covariance (I + JᵀJ)⁻¹ of z (2). The linkages that fit the readings lie on a
bent surface: a draw of the posterior is the fit to readings and prior that were moved by standard
normal numbers (3; randomized maximum likelihood, Kitanidis 1995).
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from hashlib import sha256
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
from mlg_troubleshoot.units import MM_PER_IN

# Positions over the stroke among which the least displacement of the plunger is sought.
_POSITIONS = 101
_COLUMNS = (
    *("kind", "from", "to", "value_in", "value_mm", "value_deg", "u_in", "u_mm", "u_deg"),
    *("extension_in", "extension_mm", "note"),
)
# Units of readings, in inches or radians.
_UNITS = {"in": 1.0, "mm": 1.0 / MM_PER_IN, "deg": float(np.radians(1))}
# How the names of design variables end that are angles.
_ANGLES = (".direction", ".dihedral", ".axis")
# What a frame or a file has in an empty cell.
_BLANK = ("", "nan", "None", "<NA>")


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
_ANGLE_U = _UNITS["deg"]
_DEFAULT_U = {
    ReadingKind.DISTANCE: 0.01,
    ReadingKind.PLUNGER: 0.0015,
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
    def variable(self) -> str:
        """The design variable that an angle or the extension is a reading of."""
        what = "direction" if self.end == "hinge" else self.end
        return f"{self.start}.{what}" if self.start else "extension"

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
        self.tight = self.kernel.no_clearance()
        self.travel = gear.calibration.travel_in
        self.names = [*self.space.names, *(["travel"] if self.travel else [])]
        self.low, high = gear.reference.stroke
        self.after = high - gear.reference.mechanism.reference_input

    def vector(self, linkage: Linkage) -> Array:
        """The variables of one of the gear's linkages, shape (n_variables,). [in or rad]"""
        return np.append(self.space.vector(linkage), self.travel or ())

    def _solver(self, vectors: Array) -> tuple[Any, Array, list[Any], Any]:
        """Mechanisms of a batch, their reference inputs, their numbers, each of shape (n_vectors,
        1), and their calibration rates k (section 4.2). [1]
        """
        mechanism = self.space.assembled(vectors[:, : len(self.space.names)])
        parameters = (mechanism.reference_input, *write_program(mechanism).parameters.values())
        columns = (np.asarray(value, float).reshape(-1, 1) for value in parameters)
        reference, *numbers = (column + 0.0 * vectors[:, :1] for column in columns)
        if not self.travel:
            return mechanism, reference, numbers, 1.0
        inputs = np.linspace(self.low, reference + self.after, _POSITIONS, axis=1)[..., 0]
        raw = self.kernel.output(inputs, self.tight, numbers)
        moved = raw - raw[:, -1:]
        direction = np.sign(-moved[:, :1])
        rate = direction * vectors[:, -1:] / -np.min(direction * moved, axis=1, keepdims=True)
        return mechanism, reference, numbers, rate

    @np.errstate(all="ignore")
    def predicted(self, readings: Sequence[SurveyReading], vectors: Array) -> Array:
        """What each vector predicts for each reading, shape (n_vectors, n_readings); NaN where the
        linkage does not close. [in or rad]
        """
        mechanism, reference, numbers, rate = self._solver(vectors)
        extensions = list(dict.fromkeys((None, *(r.extension for r in readings))))
        inputs = np.hstack(
            [reference if e is None else np.full_like(reference, self.low + e) for e in extensions]
        )
        output = self.kernel.output(inputs, self.tight, numbers)
        plunger = (output - output[:, :1]) * rate
        places = {}
        for name, place in self.kernel.positions(inputs, self.tight, numbers).items():
            origin, axes = mechanism.frame(mechanism.point(name).plane)
            x, y = (np.broadcast_to(each, inputs.shape)[..., None] for each in place)
            across = x * axes[..., None, 0, :] + y * axes[..., None, 1, :]
            places[name] = origin[..., None, :] + across
        columns = []
        for r in readings:
            at = extensions.index(r.extension)
            if r.kind is ReadingKind.DISTANCE:
                columns.append(np.linalg.norm((places[r.start] - places[r.end])[:, at], axis=1))
            elif r.kind is ReadingKind.PLUNGER:
                columns.append(plunger[:, at])
            else:
                value = vectors[:, self.names.index(r.variable)]
                # The nearest of the turns that mean the same direction.
                turns = r.is_angle * np.round((value - r.value) / (2.0 * np.pi))
                columns.append(value - 2.0 * np.pi * turns)
        return np.column_stack(columns)

    @np.errstate(all="ignore")
    def amplification(self, vectors: Array) -> Array:
        """Plunger amplification index A_iP of each joint (Eq. 8), shape (n_vectors, n_joints);
        NaN where the linkage does not close over its whole stroke. [1]
        """
        _, reference, numbers, rate = self._solver(vectors)
        links = central_steps(len(self.tight))
        moved = self.kernel.output(reference + self.after, list(links.T), numbers)
        gradient = central_slopes(moved, axis=1) * rate
        return np.asarray(np.hypot(gradient[:, 0::2], gradient[:, 1::2]))


def read_table(table: Any, linkage: SurveyedLinkage) -> tuple[SurveyReading, ...]:
    """Read the rows of a CSV file or frame that have a value; UsageError names every wrong cell."""
    if isinstance(table, str | Path):
        with Path(table).open(encoding="utf-8-sig", newline="") as file:
            rows = list(enumerate(csv.DictReader(file), start=2))
    else:
        rows = list(zip(table.index, table.to_dict("records"), strict=True))
    columns = dict.fromkeys(name for _, cells in rows for name in cells if name not in _COLUMNS)
    wrong = [f"column {name!r} is unknown" for name in columns]
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
    kind = ReadingKind(str(cells.get("kind", "")).strip().upper())
    # A spreadsheet takes the point 4 for a number.
    texts = (cells.get(name, "") for name in ("from", "to"))
    start, end = (f"{each:g}" if isinstance(each, float) else str(each).strip() for each in texts)
    turns = linkage.space.mechanism.output.kind == "angle" and kind is ReadingKind.PLUNGER
    is_angle = turns or kind is ReadingKind.ANGLE
    value = _number(cells, "value", is_angle)
    u = _number(cells, "u", is_angle) or (_ANGLE_U if is_angle else _DEFAULT_U[kind])
    extension = _number(cells, "extension", is_angle=False)
    reading = SurveyReading(row, kind, start, end, value or 0.0, u, extension, is_angle)
    points = [point.name for point in linkage.space.mechanism.points]
    angles = [name for name in linkage.names if name.endswith(_ANGLES)]
    if kind is ReadingKind.DISTANCE:
        is_known = start != end and {start, end} <= {*points}
    elif kind is ReadingKind.PLUNGER:
        is_known = not start + end
    else:
        is_known = reading.variable in (angles if is_angle else ["extension"])
    if not is_known:
        raise ValueError(
            f"no {kind} from {start!r} to {end!r}: expected points of {', '.join(points)},"
            f" angles of {', '.join(angles)}, for the plunger blank cells"
        )
    least = 0.0 if kind in (ReadingKind.DISTANCE, ReadingKind.EXTENSION) else -np.inf
    if value is None or not value > least or u < 0.0:
        raise ValueError(f"{kind} {value} ± {u}: expected a reading above 0 and its uncertainty")
    return reading


def _number(cells: dict[str, Any], name: str, is_angle: bool) -> float | None:
    """The number of a quantity. [in or rad]"""
    given = [column for column in cells if column.startswith(f"{name}_")]
    if not given:
        return None
    text = str(cells[given[0]])
    try:
        number = float(text)
    except ValueError:
        number = np.nan
    unit = given[0].removeprefix(f"{name}_")
    if len(given) > 1 or (unit == "deg") != is_angle or not np.isfinite(number):
        kind = "angle" if is_angle else "length"
        raise ValueError(f"{', '.join(given)} {text!r}: expected the number of one {kind}")
    return number * _UNITS[unit]


# The prior. Share of the ensemble's covariances that is believed: its members were found by one
# method; standard deviations without an ensemble, in the linkage's size and as an angle; the least
# ones, as a share of those; that of the prescribed travel. [1, 1, rad, 1, in]
_COVARIANCE_SHARE = 0.5
_ALONE_SIZE = 0.5
_ALONE_ANGLE = float(np.radians(30))
_LEAST_SPREAD = 0.01
_TRAVEL_U = 0.005
# The residual from which on a reading counts less and less, and that of one at which the linkage
# does not close. [1]
_CORE = 2.0
_OPEN = 4.4e4
# The search. Starts of a round, rounds, and how far uncertainties are widened in turn with the
# steps and the fits that are kept: at first for what is read at the reference position, which
# closes from every start; of these, those that come nearest to the readings are gone on with. [1]
_STARTS = 45
_ROUNDS = 6
_STANDING = (100.0, 10.0, 1.0)
_MOVING = ((10.0, 8, 8), (3.0, 10, 5), (1.0, 40, 3))
# Residuals that a fit may have and is the one: on average one unit of loss, but for two readings.
_ENTRY_ERRORS = 2
# A reading is believed within so many standard deviations of what the others predict: the largest
# of forty exceeds that in 0.4 %; at first within twice as many of the robust fit. [1]
_MISFIT = 3.9
# Two fits are different if a variable z differs by more than the first, and as likely if the losses
# differ by less than the second. [1]
_APART = 0.1
_AS_LIKELY = 3.0
# Draws of the posterior, steps of each from the fit, and draws that are an ensemble.
_DRAWS = 200
_SETTLED = 8
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
        others = f"the others give {shown(self.expected)} ± {shown(self.u)}"
        return f"{self.reading.name}: {shown(self.reading.value)}, {others}"


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

    json_names = "numbers joints"
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
        taken = not force and (file.exists() or ensemble.exists())
        if file.suffix != ".toml" or taken or file in self.gear.files:
            raise UsageError(
                f"{file} cannot be written: it or {ensemble.name} exists",
                "Give a name that ends in .toml and is free, or force=True.",
            )
        gear = self.gear
        own = member_values(gear.reference)
        measured = {"source": "survey"}
        changes: dict[str, Any] = {
            "id": file.stem,
            "provenance": gear.provenance,
            "ensemble": ensemble.name,
            "indices": f"{file.stem}-indices.json",
            "sources": {"survey": {"kind": "measured", "text": gear.provenance}},
            "source_of": dict.fromkeys([*own.get("ground", ()), *own.get("moving", ())], "survey"),
            "input": measured,
            "planes": dict.fromkeys(own.get("planes", ()), measured),
        }
        if gear.calibration.travel_in is not None:
            changes["calibration"] = {"travel": gear.calibration.travel_in}
        values = with_changes(with_changes(read_gear_file(gear.path).values, own), changes)
        members = {each.name: member_values(each) for each in gear.ensemble[1:]}
        drawn = f"Drawn from what the readings leave open: {gear.provenance}."
        write_text(ensemble, tomli_w.dumps({"source": drawn, "members": members}))
        write_text(file, tomli_w.dumps(values))
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
    best = modes[0]
    weights = np.exp([best.cost - mode.cost for mode in modes])
    drawn = [
        fit.descend(
            modes[k].x,
            kept,
            _SETTLED,
            moved=rng.standard_normal(len(read)),
            middle=rng.standard_normal(len(best.x)),
            loss="linear",
        ).x
        for k in rng.choice(len(modes), _DRAWS, p=weights / weights.sum())
    ]
    points = fit.points(np.vstack([best.x, *drawn]))
    indices = linkage.amplification(points)
    closed = np.isfinite(indices.sum(axis=1))
    if not closed[0] or closed.sum() < 3:
        raise InconclusiveDataError(
            "no linkage near the fitted one moves over its whole stroke",
            "Check the extensions and their unit.",
        )
    residuals = fit.residuals(best.x[None])[0]
    known = np.sqrt(np.abs(best.variance - 1.0))
    misfits = (
        Misfit(read[k], float(fit.value[k] + residuals[k] * fit.u[k]), float(known[k] * fit.u[k]))
        for k in np.flatnonzero(~kept)
    )
    values = points[closed]
    ensemble = tuple(
        linkage.space.linkage(each[: len(linkage.space.names)], f"S{k}" if k else "A")
        for k, each in enumerate(values[: _MEMBERS + 1])
    )
    digest = sha256(values.tobytes()).hexdigest()
    surveyed = replace(
        before,
        provenance=f"surveyed ({len(read)} readings)",
        reference=ensemble[0],
        ensemble=ensemble,
        calibration=replace(
            before.calibration, travel_in=float(values[0, -1]) if linkage.travel else None
        ),
        geometry_sha256=digest,
        ensemble_sha256=digest,
    )
    return SurveyResult(
        surveyed,
        _adjusted(linkage.names, values),
        _adjusted([f"#{number}" for number in before.joint_numbers], indices[closed]),
        read,
        frozen(residuals),
        tuple(misfits),
        len(modes),
        seed,
    )


def _adjusted(names: Sequence[str], values: Array) -> tuple[Adjusted, ...]:
    """The first row, with the interval of the others."""
    columns = (values[0], *np.quantile(values[1:], [0.025, 0.975], axis=0))
    return tuple(map(Adjusted, names, *(column.tolist() for column in columns)))


def _distinct(fits: list[Any], count: int) -> list[Any]:
    """The best different fits."""
    found: list[Any] = []
    for fit in sorted(fits, key=lambda fit: float(fit.cost)):
        if all(np.abs(fit.x - other.x).max() > _APART for other in found):
            found.append(fit)
    return found[:count]


class _Fit:
    """The readings of one survey against the prior of its gear, in variables z of equation 1."""

    def __init__(self, linkage: SurveyedLinkage, readings: Sequence[SurveyReading]) -> None:
        self.linkage = linkage
        self.readings = readings
        self.value = np.array([r.value for r in readings])
        self.u = np.array([r.u for r in readings])
        members = np.array([linkage.vector(each) for each in linkage.gear.ensemble])
        angles = np.array([name.endswith(_ANGLES) for name in linkage.names])
        # The same direction, one turn further, is not a distance.
        turns = np.round((members - members[0]) / (2.0 * np.pi))
        members -= 2.0 * np.pi * turns * angles
        places = ((p.x, p.y) for p in linkage.gear.reference.mechanism.points)
        alone = np.where(angles, _ALONE_ANGLE, _ALONE_SIZE * np.std([*places]))
        covariance = np.diag(alone**2)
        if len(members) > 2:
            around = np.cov(members.T)
            own = np.diag(np.diag(around))
            covariance = _COVARIANCE_SHARE * around + (1.0 - _COVARIANCE_SHARE) * own
            covariance += np.diag((_LEAST_SPREAD * alone) ** 2)
        if linkage.travel:
            covariance[-1, -1] = _TRAVEL_U**2
        self.mean = members.mean(axis=0)
        self.root = np.linalg.cholesky(covariance)
        self.members = np.linalg.solve(self.root, (members - self.mean).T).T

    def points(self, z: Array) -> Array:
        return np.asarray(self.mean + z @ self.root.T)

    def residuals(self, z: Array) -> Array:
        """Shape (n_points, n_readings). [1]"""
        residuals = (self.linkage.predicted(self.readings, self.points(z)) - self.value) / self.u
        return np.where(np.isfinite(residuals), residuals, _OPEN)

    def slopes(self, z: Array) -> Array:
        """Shape (n_readings, n_variables); 0 where the linkage does not close. [1]"""
        tried = self.points(z) + central_steps(len(z))
        found = central_slopes(self.linkage.predicted(self.readings, tried)).T
        return np.asarray(np.where(np.isfinite(found), found, 0.0) @ self.root / self.u[:, None])

    def descend(
        self,
        z: Array,
        kept: Any,
        steps: int,
        widened: float = 1.0,
        *,
        moved: Any = 0.0,
        middle: Any = 0.0,
        loss: Any = "cauchy",
    ) -> Any:
        """Minimise equation 1 from one point; moved: how far the readings are, in their
        uncertainties; middle: of the prior, else 0.
        """
        weight = kept / widened

        def residuals(at: Array) -> Array:
            return np.append((self.residuals(at[None])[0] - moved) * weight, at - middle)

        def slopes(at: Array) -> Array:
            return np.vstack([(self.slopes(at).T * weight).T, np.eye(len(at))])

        return least_squares(residuals, z, slopes, loss=loss, f_scale=_CORE, max_nfev=steps)

    def search(self, rng: np.random.Generator) -> list[Any]:
        """The best robust fits of two rounds, or until one explains all readings but two."""
        standing = np.array(
            [r.kind is not ReadingKind.PLUNGER and r.extension is None for r in self.readings]
        )
        best: list[Any] = []
        starts = self.members
        for turn in range(_ROUNDS):
            drawn = rng.standard_normal((_STARTS, len(self.mean)))
            starts = np.concatenate([starts, drawn])[:_STARTS]
            for k, start in enumerate(starts.copy()):
                for widened in _STANDING:
                    starts[k] = self.descend(starts[k], standing, 8, widened, middle=start).x
            nearest = np.argsort(np.median(np.abs(self.residuals(starts)), axis=1))
            points = list(starts[nearest[: _STARTS // 3]])
            for widened, steps, count in _MOVING:
                fits = _distinct([self.descend(z, True, steps, widened) for z in points], count)
                points = [fit.x for fit in fits]
            best = _distinct([*best, *fits], count)
            square = np.sort(best[0].fun ** 2)[:-_ENTRY_ERRORS]
            if turn and square.sum() < len(self.u) - _ENTRY_ERRORS:
                break
            starts = starts[:0]
        return best

    def settled(self, fits: list[Any]) -> tuple[Mask, list[Any]]:
        """The readings that fit, and the fits of them that are as likely."""
        robust = self.descend(fits[0].x, True, 300).x
        kept = np.abs(self.residuals(robust[None])[0]) < 2.0 * _MISFIT
        for _ in self.readings:
            fitted = self._fitted(robust, kept)
            excess = np.abs(self.residuals(fitted.x[None])[0]) / np.sqrt(fitted.variance)
            worst = kept & (excess >= max(_MISFIT, np.max(excess, where=kept, initial=0.0)))
            again = kept & ~worst if worst.any() else excess < _MISFIT
            if (again == kept).all():
                break
            kept = again
        others = (self._fitted(fit.x, kept) for fit in fits[1:])
        near = [fit for fit in others if fit.cost < fitted.cost + _AS_LIKELY]
        return kept, _distinct([fitted, *near], len(fits))

    def _fitted(self, z: Array, kept: Mask) -> Any:
        """Fit with its covariance (2), and the variance of each reading about what the others
        predict for it, over its own. [1]
        """
        fit = self.descend(z, kept, 100, loss="linear")
        slopes = self.slopes(fit.x)
        used = slopes * kept[:, None]
        covariance = np.linalg.inv(np.eye(len(z)) + used.T @ used)
        known = np.einsum("ij,jk,ik->i", slopes, covariance, slopes)
        fit.variance = np.where(kept, np.maximum(1.0 - known, 1e-9), 1.0 + known)
        return fit
