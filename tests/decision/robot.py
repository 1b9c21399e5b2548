"""A robot that does what the next action says, on gears whose clearances and directions it alone
knows.

The gears are drawn and moved by the independent simulator's linkage, solved as a closed chain in
space; costs are read from the gear file as plain TOML. The robot speaks to the product through a
table and its JSON alone.
"""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import mlg_troubleshoot
from mlg_troubleshoot.reporting.json_form import check_as_json
from mlg_troubleshoot.workflows.check import CheckOptions, check_files
from tests.benchmarks.worn_gears import GROUPS, LIMIT_IN, displacement, worst

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
MARGIN_IN, GAUGE_U_IN, PLUNGER_U_IN = 0.03, 0.0005, 0.0005
CLEARANCE, OTHER, NONE = range(3)
ROUNDS = 12
_RAW = tomllib.loads(
    (Path(mlg_troubleshoot.__file__).parent / "gear" / "data" / "hawker-800xp.toml").read_text(
        encoding="utf-8"
    )
)
AREA = [joint["area"] for joint in _RAW["joints"]]
AREA_MIN = {area["name"]: float(area["access_min"]) for area in _RAW["areas"]}
READ_MIN = [float(joint["access_min"]) for joint in _RAW["joints"]]
RESTORE_MIN = [float(joint["restore_min"]) for joint in _RAW["joints"]]
PLUNGER_MIN = float(_RAW["plunger"]["read_min"])


@dataclass
class Gears:
    """Gears as they truly are, what has been read of them, and what was done to them."""

    true_in: Array
    angles: Array
    kind: NDArray[np.int64]
    read_in: Array
    linkage: str = "A"
    own_u_in: Array = field(init=False)
    plunger_in: Array = field(init=False)
    minutes: Array = field(init=False)
    rounds: NDArray[np.int64] = field(init=False)
    repairs: NDArray[np.int64] = field(init=False)
    restored: NDArray[np.int64] = field(init=False)
    sound: NDArray[np.int64] = field(init=False)
    end: list[str] = field(init=False)
    opened: list[set[str]] = field(init=False)
    done: list[list[tuple[str, tuple[int, ...]]]] = field(init=False)

    def __post_init__(self) -> None:
        n = len(self.kind)
        self.own_u_in, self.plunger_in = np.full((n, 10), np.nan), np.full(n, np.nan)
        self.minutes = np.zeros(n)
        self.rounds, self.repairs, self.restored, self.sound = (np.zeros(n, int) for _ in range(4))
        self.end, self.opened, self.done = (
            [""] * n,
            [set() for _ in range(n)],
            [[] for _ in range(n)],
        )
        self.failed = (self.kind == OTHER) | (np.abs(self.moved()) > MARGIN_IN)

    def moved(self) -> Array:
        """Where the plunger really stands. [in]"""
        return displacement(self.true_in, self.angles, self.linkage)

    def read(self, i: int, joint: int, rng: np.random.Generator, u_in: float = GAUGE_U_IN) -> None:
        """Read one joint."""
        self.read_in[i, joint - 1] = max(self.true_in[i, joint - 1] + rng.normal(0.0, u_in), 0.0)

    def open(self, i: int, joints: list[int]) -> None:
        """Open the areas of some joints, each once."""
        needed = {AREA[j - 1] for j in joints} - self.opened[i]
        self.minutes[i] += sum(AREA_MIN[name] for name in needed)
        self.opened[i] |= needed

    def restore(
        self, i: int, joints: list[int], rng: np.random.Generator, *, read: bool = True
    ) -> None:
        """Restore joints: small clearances, new directions, areas closed, the plunger somewhere
        else.
        """
        self.open(i, joints)
        for j in joints:
            self.minutes[i] += RESTORE_MIN[j - 1]
            self.restored[i] += 1
            self.sound[i] += self.true_in[i, j - 1] <= LIMIT_IN
            self.true_in[i, j - 1] = rng.uniform(0.0, 0.001)
            self.angles[i, j - 1] = rng.uniform(0.0, 2.0 * np.pi)
            self.own_u_in[i, j - 1] = self.read_in[i, j - 1] = np.nan
            if read:
                self.read(i, j, rng)
        self.repairs[i] += 1
        self.opened[i], self.plunger_in[i] = set(), np.nan


def drawn(n: int, rng: np.random.Generator, linkage: str = "A") -> Gears:
    """A third failed through clearance, a third through something else, a third not; 0, 2, 5 or 10
    joints read.
    """
    parts = []
    for kind in (CLEARANCE, OTHER, NONE):
        found: list[tuple[Array, Array]] = []
        while sum(len(f[0]) for f in found) < -(-n // 3):
            share = rng.triangular(0.0, 0.0, 1.0, (4 * n, 10))
            for group in GROUPS:
                hit = rng.random(4 * n) < (0.15 if kind == CLEARANCE else 0.01)
                share[hit, rng.choice(group, int(hit.sum())) - 1] = rng.uniform(
                    1.0, 2.0, int(hit.sum())
                )
            true, angles = LIMIT_IN * share, rng.uniform(0.0, 2.0 * np.pi, share.shape)
            keep = (np.abs(displacement(true, angles, linkage)) > MARGIN_IN) == (kind == CLEARANCE)
            found.append((true[keep], angles[keep]))
        true, angles = (np.concatenate(part)[: -(-n // 3)] for part in zip(*found, strict=True))
        parts.append((true, angles, np.full(len(true), kind)))
    true, angles, kinds = (np.concatenate(part)[:n] for part in zip(*parts, strict=True))
    read = np.full(true.shape, np.nan)
    for i in range(n):
        for j in rng.permutation(10)[: (0, 2, 5, 10)[i % 4]]:
            read[i, j] = max(true[i, j] + rng.normal(0.0, GAUGE_U_IN), 0.0)
    return Gears(true, angles, kinds, read, linkage)


def write_table(file: Path, gears: Gears, rows: NDArray[np.intp]) -> None:
    """What is known of some gears, as a technician would hand it in."""
    numbers = range(1, 11)
    header = [
        "record_id",
        "tail_no",
        "side",
        "clearance_convention",
        "gauge_u_in",
        "outcome",
        "plunger_displacement_in",
    ]
    header += [f"clearance_{j}_in" for j in numbers] + [f"gauge_u_{j}_in" for j in numbers]

    def text(value: float) -> str:
        return "" if np.isnan(value) else repr(float(value))

    with file.open("w", newline="", encoding="utf-8") as out:
        writer = csv.writer(out)
        writer.writerow(header)
        for i in rows:
            outcome = "FAILED" if gears.failed[i] else "RETRACTED"
            start = [
                f"R{i}",
                f"N{i}",
                "LH",
                "RADIAL",
                GAUGE_U_IN,
                outcome,
                text(gears.plunger_in[i]),
            ]
            writer.writerow(
                start + [text(v) for v in gears.read_in[i]] + [text(v) for v in gears.own_u_in[i]]
            )


def judged(file: Path, gears: Gears, rows: NDArray[np.intp]) -> list[dict[str, Any]]:
    """What the product says of some gears."""
    write_table(file, gears, rows)
    result = check_files([file], CheckOptions(advice=False))
    assert not result.problems
    form = check_as_json(result.gear, result.judgements, result.problems, result.notes)
    return list(form["inspections"])


def play(
    gears: Gears,
    folder: Path,
    rng: np.random.Generator,
    *,
    read_new: bool = True,
    rounds: int = ROUNDS,
) -> dict[int, list[dict[str, Any]]]:
    """Do what the next action says, all gears in one table a round, until every plan has ended."""
    said: dict[int, list[dict[str, Any]]] = {}
    going = np.arange(len(gears.kind))
    for _ in range(rounds):
        if not len(going):
            break
        for i, row in zip(going, judged(folder / "round.csv", gears, going), strict=True):
            said.setdefault(int(i), []).append(row)
            gears.rounds[i] += 1
            _obey(gears, int(i), row, rng, read_new)
        repaired = [i for i in going if gears.done[i][-1][0] == "RESTORE"]
        if repaired:
            gears.failed[repaired] = (gears.kind[repaired] == OTHER) | (
                np.abs(gears.moved()[repaired]) > MARGIN_IN
            )
        going = np.array([i for i in going if not gears.end[i]], dtype=np.intp)
    return said


def _obey(
    gears: Gears, i: int, row: dict[str, Any], rng: np.random.Generator, read_new: bool
) -> None:
    step = row["next_action"]
    joints = step["joints"]
    gears.done[i].append((step["action"], tuple(joints)))
    match step["action"]:
        case "MEASURE" | "MEASURE_AGAIN":
            gears.open(i, joints)
            needed = step["gauge_u_needed_in"]
            for j in joints:
                gears.minutes[i] += READ_MIN[j - 1]
                gears.read(i, j, rng, needed or GAUGE_U_IN)
                gears.own_u_in[i, j - 1] = np.nan if needed is None else needed
        case "READ_PLUNGER":
            gears.minutes[i] += PLUNGER_MIN
            one = displacement(gears.true_in[i : i + 1], gears.angles[i : i + 1], gears.linkage)[0]
            gears.plunger_in[i] = one + rng.normal(0.0, PLUNGER_U_IN)
        case "RESTORE":
            gears.restore(i, joints, rng, read=read_new)
        case _:
            gears.end[i] = row["end"]


@dataclass(frozen=True)
class Figures:
    """What the issue asks of a policy."""

    ended: float
    median_rounds: float
    most_rounds: int
    second_repair: float
    wrong_within: float
    retract: float
    other_sound: float
    sound_share: float
    overlooked: float
    minutes: float
    by_kind: tuple[float, ...]

    @classmethod
    def of(cls, gears: Gears) -> Figures:
        """Count."""
        kind, repaired = gears.kind, gears.repairs > 0
        said_within = np.array([end == "WITHIN" for end in gears.end])
        true_worst = worst(gears.true_in, gears.linkage)
        return cls(
            ended=float(np.mean([bool(end) for end in gears.end])),
            median_rounds=float(np.median(gears.rounds)),
            most_rounds=int(gears.rounds.max()),
            second_repair=float(np.mean(gears.repairs[repaired] > 1)) if repaired.any() else 0.0,
            wrong_within=float(np.mean(said_within & (true_worst > 1.05 * MARGIN_IN))),
            retract=float(np.mean(~gears.failed[kind == CLEARANCE])),
            other_sound=float(np.mean(gears.sound[kind == OTHER] > 0)),
            sound_share=float(gears.sound.sum() / max(gears.restored.sum(), 1)),
            overlooked=float(np.mean((gears.true_in > LIMIT_IN + GAUGE_U_IN).any(axis=1))),
            minutes=float(gears.minutes.mean()),
            by_kind=tuple(float(gears.minutes[kind == k].mean()) for k in (CLEARANCE, OTHER, NONE)),
        )


Policy = Callable[[Gears, Path, np.random.Generator], None]
