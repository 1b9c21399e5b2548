"""A technician who does what NEXT says, on gears of which only this file knows the truth.

The gears are moved by the independent simulator's linkage; directions, gauges, loads, rigging and
minutes are drawn and counted here. What the program knows is a table, what it says is its JSON.
"""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import mlg_troubleshoot
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.store import Store
from mlg_troubleshoot.workflows.check import CheckOptions, check_files
from mlg_troubleshoot.workflows.keep import keep, told_by
from tests.benchmarks.worn_gears import GROUPS, LIMIT_IN, displacement, worst
from tests.hidden_effect.simulator.linkage import load

Array = NDArray[np.float64]
CLEARANCE, OTHER, NONE, MISRIGGED = range(4)
KINDS = ("clearance", "other", "not failed", "mis-rigged")
MARGIN_IN, GAUGE_U_IN = 0.03, 0.0005
MOST_ROUNDS = 20
_RAW = tomllib.loads(
    (Path(mlg_troubleshoot.__file__).parent / "gear" / "data" / "hawker-800xp.toml").read_text(
        encoding="utf-8"
    )
)
AREA = [joint["area"] for joint in _RAW["joints"].values()]
AREA_MIN = {name: float(area["access_min"]) for name, area in _RAW["areas"].items()}
READ_MIN = [float(joint["access_min"]) for joint in _RAW["joints"].values()]
RESTORE_MIN = [float(joint["restore_min"]) for joint in _RAW["joints"].values()]
PLUNGER_MIN = float(_RAW["workshop"]["read_plunger_min"])
RIGGING_MIN = float(_RAW["workshop"]["check_rigging_min"])
RETRACT_MIN = float(_RAW["workshop"]["trial_retraction_min"])
_BEGIN = datetime(2026, 3, 2, 8, 0)


@dataclass(frozen=True)
class World:
    """How gears really are: linkage, where pins rest, what the gauges do, how many of each kind."""

    name: str
    linkage: str = "A"
    pins: str = "uniform"
    gauge: float = 1.0
    slips: dict[int, float] = field(default_factory=dict)
    plunger_u_in: float = 0.002
    states_plunger_u: bool = False
    mix: tuple[float, float, float, float] = (3.0, 1.0, 4.0, 0.0)
    shut: str = ""


WORLDS = (
    *(World("A uniform"), World("A uniform 1:1:1", mix=(1.0, 1.0, 1.0, 0.0))),
    *(World("A mis-rigged", mix=(3.0, 1.0, 4.0, 1.0)), World("B loaded", "B", "loaded")),
    World("C uniform, #3 halved", "C", slips={3: 0.5}),
    World("D gravity, gauge x1.2", "D", "gravity", gauge=1.2),
    World("E axial mixed", "E", "axial mixed"),
    *(World("F uniform, #3 doubled", "F", slips={3: 2.0}), World("G axial", "G", "axial")),
    *(World("H loaded, gauge x0.8", "H", "loaded", gauge=0.8), World("I gravity", "I", "gravity")),
    *(World("J uniform, gauge x0.8", "J", gauge=0.8), World("A one joint shut", shut="joint")),
    World("A one area shut", shut="area"),
)


@dataclass
class Gear:
    """One gear as it truly is, what stands in its row, and what was done to it."""

    kind: int
    true_in: Array
    angles: Array
    offset_in: float = 0.0
    row: dict[str, Any] = field(default_factory=dict)
    opened: set[str] = field(default_factory=set)
    minutes: float = 0.0
    done: list[tuple[str, tuple[int, ...]]] = field(default_factory=list)
    restored: int = 0
    sound: int = 0
    repairs: int = 0
    end: str = ""
    promised: float = 0.0
    stale: bool = False
    shut: set[int] = field(default_factory=set)
    repaired_rows: list[dict[str, Any]] = field(default_factory=list)
    chances: list[tuple[float, bool]] = field(default_factory=list)
    first: dict[str, Any] = field(default_factory=dict)
    last: dict[str, Any] = field(default_factory=dict)

    @property
    def asked(self) -> set[int]:
        """The joints that the program asked for."""
        return {j for _action, joints in self.done for j in joints}

    @property
    def clock(self) -> str:
        return (_BEGIN + timedelta(minutes=self.minutes)).isoformat(" ", "minutes")


class Hangar:
    """The gears of one world, and the technician who works on them."""

    def __init__(self, world: World, n: int, seed: int, loads: int | None = None) -> None:
        self.world, self.rng = world, np.random.default_rng(seed)
        self.loads = seed if loads is None else loads
        self.store: Store | None = None
        self.options = CheckOptions(advice=False)
        self.load = np.random.default_rng(self.loads + 77).uniform(0.0, 2.0 * np.pi, 10)
        self.gears: list[Gear] = []
        share = np.array(world.mix) / sum(world.mix)
        for kind in range(4):
            self._draw(kind, round(n * share[kind]))
        for place, gear in enumerate(self.gears):
            gear.row["outcome"] = "RETRACTED" if gear.kind == NONE else "FAILED"
            gear.shut = self._shut()
            gear.row["cannot_reach"] = " ".join(map(str, sorted(gear.shut)))
            for j in self.rng.permutation(10)[: (0, 2, 5, 10)[place % 4]]:
                if j + 1 not in gear.shut:
                    self.read(gear, int(j) + 1)

    def _shut(self) -> set[int]:
        """Joints that nobody can reach today."""
        joint = int(self.rng.integers(10)) + 1 if self.world.shut else 0
        if self.world.shut == "area":
            return {j for j in range(1, 11) if AREA[j - 1] == AREA[joint - 1]}
        return {joint} - {0}

    def directions(self, n: int) -> Array:
        """Where the pins of n gears rest. [rad]"""
        scatter = self.rng.normal(0.0, np.radians(20.0), (n, 10))
        along = load(self.world.linkage).angles
        sense = np.pi * self.rng.integers(0, 2, (n, 1))
        match self.world.pins:
            case "uniform":
                return self.rng.uniform(0.0, 2.0 * np.pi, (n, 10))
            case "loaded":
                return self.load + scatter
            case "gravity":
                return scatter - 0.5 * np.pi
            case "axial":
                return along + sense + scatter
            case _:
                flips = np.pi * (np.cos(self.load) > 0.0)
                return along + flips + scatter

    def moved(self, gears: Sequence[Gear]) -> Array:
        """Where the plungers really stand. [in]"""
        true = np.array([gear.true_in for gear in gears])
        angles = np.array([gear.angles for gear in gears])
        offset = np.array([gear.offset_in for gear in gears])
        return displacement(true, angles, self.world.linkage) + offset

    def _draw(self, kind: int, wanted: int) -> None:
        found: list[Gear] = []
        for _ in range(400):
            if len(found) >= wanted:
                break
            share = self.rng.triangular(0.0, 0.0, 1.0, (4 * wanted, 10))
            chance = {CLEARANCE: 0.15, MISRIGGED: 0.0}.get(kind, 0.01)
            for group in GROUPS:
                hit = self.rng.random(4 * wanted) < chance
                share[hit, self.rng.choice(group, int(hit.sum())) - 1] = self.rng.uniform(
                    1.0, 2.0, int(hit.sum())
                )
            angles = self.directions(4 * wanted)
            new = [Gear(kind, LIMIT_IN * s, a) for s, a in zip(share, angles, strict=True)]
            if kind == MISRIGGED:
                for gear in new:
                    sense = 1.0 if self.rng.random() < 0.5 else -1.0
                    gear.offset_in = sense * self.rng.uniform(0.02, 0.06)
            beyond = np.abs(self.moved(new)) > MARGIN_IN
            wants = kind in (CLEARANCE, MISRIGGED)
            found += [gear for gear, out in zip(new, beyond, strict=True) if out == wants]
        self.gears += found[:wanted]

    def read(self, gear: Gear, joint: int, again_u_in: float | None = None) -> None:
        """Read one joint with a gauge that may be off; again with another one, of which the scale
        is right to 2 %, and the convention looked up.
        """
        if again_u_in is None:
            u_in, factor = GAUGE_U_IN, self.world.gauge * self.world.slips.get(joint, 1.0)
        else:
            u_in, factor = again_u_in, self.rng.normal(1.0, 0.02)
            gear.row[f"gauge_u_{joint}_in"] = u_in
        seen = factor * gear.true_in[joint - 1] + self.rng.normal(0.0, u_in)
        gear.row[f"clearance_{joint}_in"] = max(seen, 0.0)

    def open(self, gear: Gear, joints: Sequence[int]) -> None:
        """Open the areas of some joints, each once until a repair closes it."""
        needed = {AREA[j - 1] for j in joints} - gear.opened
        gear.minutes += sum(AREA_MIN[name] for name in needed)
        gear.opened |= needed

    def restore(self, gear: Gear, joints: Sequence[int]) -> None:
        """New parts, new directions, areas closed."""
        self.open(gear, joints)
        fresh = self.directions(1)[0]
        for j in joints:
            gear.minutes += RESTORE_MIN[j - 1]
            gear.restored += 1
            gear.sound += bool(gear.true_in[j - 1] <= LIMIT_IN)
            gear.true_in[j - 1] = self.rng.uniform(0.0, 0.001)
            gear.angles[j - 1] = fresh[j - 1]
            gear.row.pop(f"gauge_u_{j}_in", None)
            self.read(gear, j)
        gear.repairs += 1
        gear.opened = set()
        before = {int(word) for word in gear.row.get("restored_joints", "").split()}
        gear.row["restored_joints"] = " ".join(map(str, sorted({*before, *joints})))
        gear.row["repair_date"] = gear.clock
        gear.repaired_rows.append(dict(gear.row))
        gear.stale = True

    def read_plunger(self, gear: Gear) -> None:
        """Read the plunger: a second reading stands beside the first until a repair."""
        row = gear.row
        seen = float(self.moved([gear])[0]) + self.rng.normal(0.0, self.world.plunger_u_in)
        if gear.stale or "plunger_displacement_in" not in row:
            row.pop("plunger_displacement_2_in", None)
            row["plunger_displacement_in"] = seen
        else:
            row["plunger_displacement_2_in"] = seen
        row["plunger_date"], gear.stale = gear.clock, False
        if self.world.states_plunger_u:
            row["plunger_gauge_u_in"] = self.world.plunger_u_in

    def obey(self, gear: Gear, said: dict[str, Any]) -> None:
        """Do the next action."""
        step, row = said["next_action"], gear.row
        joints = list(step["joints"])
        gear.done.append((step["action"], tuple(joints)))
        gear.last = said
        match step["action"]:
            case "MEASURE" | "MEASURE_AGAIN":
                self.open(gear, joints)
                needed = step["gauge_u_needed_in"]
                for j in joints:
                    gear.minutes += READ_MIN[j - 1]
                    self.read(gear, j, needed)
            case "READ_PLUNGER":
                gear.minutes += PLUNGER_MIN
                self.read_plunger(gear)
            case "CHECK_RIGGING":
                gear.minutes += RIGGING_MIN
                row["rigging_checked"] = "corrected" if gear.offset_in else "yes"
                if gear.offset_in:
                    gear.offset_in, gear.stale = 0.0, True
                    row["repair_date"] = gear.clock
            case "RESTORE":
                self.restore(gear, joints)
                chance = [
                    s["second_repair_probability"]
                    for s in said["repair_sets"] or ()
                    if sorted(s["joints"]) == sorted(joints)
                ]
                if chance and chance[0] is not None and gear.kind == CLEARANCE:
                    out = bool(abs(self.moved([gear])[0]) > MARGIN_IN)
                    gear.chances.append((chance[0], out))
            case "RETRACT":
                gear.minutes += RETRACT_MIN
                out = gear.kind == OTHER or abs(self.moved([gear])[0]) > MARGIN_IN
                row["outcome"] = "FAILED" if out else "RETRACTED"
                row["outcome_date"] = gear.clock
            case _:
                gear.end = said["end"]
        gear.minutes += 0.0 if gear.end else 1e-9

    def kept(self, n: int, seed: int, folder: Path) -> Hangar:
        """Keep other gears of the same world, every joint and the plunger read on each."""
        others = Hangar(self.world, n, seed, self.loads)
        for gear in others.gears:
            for j in set(range(1, 11)) - gear.shut:
                others.read(gear, j)
            others.read_plunger(gear)
        others.judged(others.gears, folder)
        (folder / "kept.sqlite").unlink(missing_ok=True)
        self.store = Store(folder / "kept.sqlite")
        options = CheckOptions(advice=False)
        keep(told_by(check_files([folder / "row.csv"], options).judgements), self.store)
        return self

    def judged(self, gears: Sequence[Gear], folder: Path) -> list[dict[str, Any]]:
        """What the program says of some gears."""
        numbers = range(1, 11)
        header = ["record_id", "tail_no", "side", "clearance_convention", "gauge_u_in"]
        columns = [
            *("outcome", "outcome_date", "plunger_displacement_in", "plunger_displacement_2_in"),
            *("plunger_date", "plunger_gauge_u_in", "restored_joints", "repair_date"),
            *("rigging_checked", "cannot_reach", "no_spare"),
            *(f"clearance_{j}_in" for j in numbers),
            *(f"gauge_u_{j}_in" for j in numbers),
        ]
        file = folder / "row.csv"
        with file.open("w", newline="", encoding="utf-8") as out:
            writer = csv.writer(out)
            writer.writerow([*header, *columns])
            for place, gear in enumerate(gears):
                cells = [gear.row.get(name, "") for name in columns]
                writer.writerow(
                    [
                        f"R{place}",
                        f"N{place}" if self.store else f"K{place}",
                        "LH",
                        "RADIAL",
                        GAUGE_U_IN,
                        *cells,
                    ]
                )
        result = check_files([file], self.options, store=self.store)
        assert not result.problems, result.problems[0]
        return list(result.to_dict()["inspections"])

    def work(self, folder: Path) -> Hangar:
        """Do what NEXT says until every plan has ended."""
        going = list(self.gears)
        for _ in range(MOST_ROUNDS):
            if not going:
                break
            for gear, said in zip(going, self.judged(going, folder), strict=True):
                if not gear.done:
                    gear.promised = sum(step["minutes"] for step in said["plan"])
                    gear.first = said
                self.obey(gear, said)
            going = [gear for gear in going if not gear.end]
        return self

    def measure_all(self, folder: Path) -> Hangar:
        """Measure all ten joints, then the best repair and a trial retraction."""
        for gear in self.gears:
            reach = set(range(1, 11)) - gear.shut
            unread = [j for j in sorted(reach) if f"clearance_{j}_in" not in gear.row]
            self.open(gear, unread)
            for j in unread:
                gear.minutes += READ_MIN[j - 1]
                self.read(gear, j)
        for gear, said in zip(self.gears, self.judged(self.gears, folder), strict=True):
            over = [j["joint"] for j in said["joints"] if j["over_limit"]]
            over = [j for j in over if j not in gear.shut]
            sure = [s for s in said["repair_sets"] or () if s["kind"] == "sure"]
            failed = gear.row["outcome"] == "FAILED" and said["verdict"] != "WITHIN_MARGIN"
            joints = sure[0]["joints"] if failed and sure else over
            if joints:
                self.restore(gear, joints)
                gear.minutes += RETRACT_MIN
            gear.end = said["end"]
        return self


@dataclass(frozen=True)
class Counted:
    """What came of one world, by kind where it differs."""

    minutes: tuple[float, ...]
    against: tuple[float, ...]
    promised: tuple[float, ...]
    figures: dict[str, float]


def counted(
    world: World, n: int, seed: int, folder: Path, known: int = 0, accepted: float = 0.02
) -> tuple[Counted, Hangar]:
    """Work on the gears of a world, and on the same ones by measuring everything; `known` others
    were kept before, and the shop accepts that chance of a second repair.
    """
    hangar = Hangar(world, n, seed)
    gear = load_gear()
    chance = replace(gear.second_repair_chance, value=accepted)
    hangar.options = CheckOptions(gear=replace(gear, second_repair_chance=chance), advice=False)
    best = oracle(hangar) if world.mix[CLEARANCE] else Oracle(float("nan"), float("nan"))
    base = deepcopy(hangar)
    if known:
        base.store = hangar.kept(known, seed + 5000, folder).store
    base.measure_all(folder)
    hangar.work(folder)
    by = [[g for g in hangar.gears if g.kind == kind] for kind in range(4)]
    base_by = [[g for g in base.gears if g.kind == kind] for kind in range(4)]

    def mean(values: Sequence[float]) -> float:
        return float(np.mean(values)) if len(values) else float("nan")

    stands = dict(zip(map(id, hangar.gears), np.abs(hangar.moved(hangar.gears)), strict=True))
    true = np.array([g.true_in for g in hangar.gears])
    bound = dict(zip(map(id, hangar.gears), worst(true, world.linkage), strict=True))
    repaired = [g for g in hangar.gears if g.repairs]
    away = [g for g in by[CLEARANCE] if stands[id(g)] > MARGIN_IN]
    left = int((true > LIMIT_IN).sum())
    figures = {
        "ended": mean([bool(g.end) for g in hangar.gears]),
        "steps, most": float(max(len(g.done) for g in hangar.gears)),
        "second repairs": mean([g.repairs > 1 for g in repaired]),
        "cured": mean([stands[id(g)] <= MARGIN_IN for g in by[CLEARANCE]]),
        "sent away": len(away) / max(len(by[CLEARANCE]), 1),
        "oracle, minutes": best.minutes,
        "oracle, sound of restored": best.sound,
        "sound of restored": sum(g.sound for g in hangar.gears)
        / max(sum(g.restored for g in hangar.gears), 1),
        "over their limit, overlooked": left
        / max(left + sum(g.restored - g.sound for g in hangar.gears), 1),
        "other, sound restored": mean([g.sound > 0 for g in by[OTHER]]),
        "not failed, sound restored": mean([g.sound > 0 for g in by[NONE]]),
        "mis-rigged, restored": mean([g.restored > 0 for g in by[MISRIGGED]]),
        "asked for what is shut": mean([bool(g.asked & g.shut) for g in hangar.gears]),
        "wrong WITHIN": mean(
            [g.end == "WITHIN" and bound[id(g)] > 1.05 * MARGIN_IN for g in hangar.gears]
        ),
    }
    return (
        Counted(
            tuple(mean([g.minutes for g in some]) for some in by),
            tuple(mean([g.minutes for g in some]) for some in base_by),
            tuple(mean([g.promised for g in some]) for some in by),
            figures,
        ),
        hangar,
    )


def replayed(n: int, seed: int, folder: Path) -> tuple[int, int, int]:
    """Failures by clearance whose row, right after their repair, still says what was before it:
    their number; how many are sent elsewhere; the same without a word of the repair in the row
    and without being asked for one.
    """
    hangar = Hangar(WORLDS[0], n, seed).work(folder)
    repaired = [g for g in hangar.gears if g.kind == CLEARANCE and g.repaired_rows]
    for gear in repaired:
        gear.row = gear.repaired_rows[0]
    away = sum(said["end"] == "NOT_EXPLAINED" for said in hangar.judged(repaired, folder))
    for gear in repaired:
        for column in ("restored_joints", "repair_date"):
            del gear.row[column]
    unasked = sum(
        said["end"] == "NOT_EXPLAINED" and "restored_joints" not in said["plan"][0]["text"]
        for said in hangar.judged(repaired, folder)
    )
    return len(repaired), away, unasked


@dataclass(frozen=True)
class Oracle:
    """What the quickest repair of failures by clearance takes, all clearances and directions being
    known, and how many of the joints that it restores are within their limits.
    """

    minutes: float
    sound: float


def oracle(hangar: Hangar) -> Oracle:
    """Restore what is over its limit and the quickest more that hold, read the plunger, retract."""
    sets = ((np.arange(1024)[:, None] >> np.arange(10)) & 1).astype(bool)
    inside = np.array([[area == name for area in AREA] for name in AREA_MIN])
    areas = (sets[:, None, :] & inside).any(axis=2) @ np.array(list(AREA_MIN.values()))
    minutes = sets @ np.array(RESTORE_MIN) + areas + PLUNGER_MIN + RETRACT_MIN
    spent, restored, sound = [], 0, 0
    for gear in hangar.gears:
        if gear.kind != CLEARANCE:
            continue
        over = gear.true_in > LIMIT_IN
        able = np.flatnonzero(~(over & ~sets).any(axis=1))
        able = able[np.argsort(minutes[able], kind="stable")]
        for some in np.array_split(able, max(len(able) // 32, 1)):
            true = np.where(sets[some], 0.0005, gear.true_in)
            turned = np.repeat(gear.angles[None], len(some), axis=0)
            holds = np.abs(displacement(true, turned, hangar.world.linkage)) <= MARGIN_IN
            if holds.any():
                best = some[int(np.argmax(holds))]
                spent.append(float(minutes[best]))
                restored += int(sets[best].sum())
                sound += int((sets[best] & ~over).sum())
                break
    return Oracle(float(np.mean(spent)), sound / max(restored, 1))


def say(name: str, found: Counted) -> str:
    """One world in three lines."""
    kinds = [
        f"{kind} {found.minutes[k]:.0f}/{found.against[k]:.0f} ="
        f" {found.minutes[k] / found.against[k]:.0%} (promised {found.promised[k]:.0f})"
        for k, kind in enumerate(KINDS)
        if np.isfinite(found.minutes[k])
    ]
    rest = "; ".join(f"{what} {value:.3g}" for what, value in found.figures.items())
    return f"{name}: {', '.join(kinds)}\n    {rest}"
