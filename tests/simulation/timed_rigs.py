"""Eight rigs whose rows follow each other, static and dynamic, and noise as records have it:
nothing of the diagnosis is used here.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
from scipy.linalg import expm
from scipy.optimize import least_squares
from scipy.signal import lfilter

from tests.simulation.rigs import Array, Rig

HEADS = Path(__file__).parents[2] / "docs" / "tutorial" / "data" / "groundwater-heads.csv"
# Hours of a real record that are kept together where blocks of it are drawn.
BLOCK = 24


def mass_spring_damper(n: int, rng: np.random.Generator) -> Rig:
    """Place of a damped mass after a step of the force. [mm]"""
    t = np.linspace(0.0, rng.uniform(6.0, 10.0), n)

    def predict(p: Mapping[str, float]) -> Array:
        frequency = np.sqrt(p["stiffness"] / p["mass"])
        damping = p["damper"] / (2.0 * np.sqrt(p["stiffness"] * p["mass"]))
        since = np.maximum(t - p["delay"], 0.0)
        damped = frequency * np.sqrt(1.0 - damping**2)
        swing = np.cos(damped * since) + damping * frequency / damped * np.sin(damped * since)
        place = 1e5 / p["stiffness"] * (1.0 - np.exp(-damping * frequency * since) * swing)
        return np.asarray((place * p["gain"] + p["drift"] * t + p["zero"])[:, None])

    return Rig(
        predict,
        {
            "mass": (50.0, 1.0),
            "stiffness": (1000.0, 20.0),
            "damper": (40.0, 4.0),
            "delay": (0.5, 0.02),
            "gain": (1.0, 0.02),
            "drift": (0.0, 0.5),
        },
        {"zero": (0.0, 1.0)},
    )


def cooling_body(n: int, rng: np.random.Generator) -> Rig:
    """Temperature of a body that is heated twice and cools between. [°C]"""
    t = np.linspace(0.0, 7200.0, n)
    heated = (np.sin(t / rng.uniform(700.0, 1000.0)) > 0.0).astype(float)

    def predict(p: Mapping[str, float]) -> Array:
        step, air, now = t[1] - t[0], 293.0 + p["air"], 293.0 + p["start"]
        warm = np.empty(n)
        for k in range(n):
            warm[k] = now
            for _part in range(2):
                lost = p["loss"] * (now - air) + p["radiation"] * 5.67e-8 * (now**4 - air**4)
                now += 0.5 * step / p["capacity"] * (p["power"] * heated[k] - lost)
        return ((warm - 293.0) * p["scale"] + p["zero"])[:, None]

    return Rig(
        predict,
        {
            "loss": (0.5, 0.02),
            "radiation": (0.05, 0.005),
            "capacity": (600.0, 15.0),
            "power": (60.0, 1.0),
            "start": (5.0, 1.0),
            "scale": (1.0, 0.01),
            "air": (0.0, 1.0),
        },
        {"zero": (0.0, 0.5)},
    )


def pendulum(n: int, rng: np.random.Generator) -> Rig:
    """Angle of a pendulum that swings wide, with drag and a dry bearing. [deg]"""
    first = rng.uniform(0.6, 1.1)
    step = 0.05

    def predict(p: Mapping[str, float]) -> Array:
        def rate(angle: float, speed: float) -> float:
            return float(
                -9.81 / p["length"] * np.sin(angle)
                - p["drag"] * speed
                - p["bearing"] * np.tanh(speed / 0.05)
            )

        angle, speed, seen = first + p["start"], 0.0, np.empty(n)
        for k in range(n):
            seen[k] = angle
            middle, fast = angle + 0.5 * step * speed, speed + 0.5 * step * rate(angle, speed)
            angle, speed = angle + step * fast, speed + step * rate(middle, fast)
        return np.asarray((np.degrees(seen) * p["gain"] + p["zero"])[:, None])

    return Rig(
        predict,
        {
            "length": (1.0, 0.005),
            "drag": (0.05, 0.01),
            "bearing": (0.0, 0.01),
            "start": (0.0, 0.02),
            "gain": (1.0, 0.02),
        },
        {"zero": (0.0, 0.5)},
    )


def pump(n: int, rng: np.random.Generator) -> Rig:
    """Head of a pump while its valve is opened slowly and closed again. [m]"""
    flow = 30.0 * np.abs(np.sin(np.linspace(0.1, rng.uniform(2.6, 3.0), n)))

    def predict(p: Mapping[str, float]) -> Array:
        through = flow * p["meter_scale"] + p["leak"]
        head = 60.0 * p["speed"] ** 2 - 0.2 * p["speed"] * through
        return np.asarray(
            (head - p["throttling"] * through**2 - p["cavitation"] * (flow > 22.0) * (flow - 22.0))[
                :, None
            ]
            + p["zero"]
        )

    return Rig(
        predict,
        {
            "speed": (1.0, 0.01),
            "meter_scale": (1.0, 0.02),
            "leak": (0.0, 0.5),
            "throttling": (0.02, 0.001),
            "cavitation": (0.0, 0.1),
        },
        {"zero": (0.0, 0.5)},
    )


def rc_network(n: int, rng: np.random.Generator) -> Rig:
    """Voltage behind two resistors and two capacitors that a square wave drives. [V]"""
    t = np.linspace(0.0, 20.0, n)
    drive = np.where(np.sin(2.0 * np.pi * t / rng.uniform(6.0, 9.0)) >= 0.0, 5.0, 0.0)

    def predict(p: Mapping[str, float]) -> Array:
        first, second = 1.0 / p["r_1"], 1.0 / p["r_2"]
        rates = np.array(
            [
                [-(first + second) / p["c_1"], second / p["c_1"], first / p["c_1"]],
                [second / p["c_2"], -(second + p["leak"]) / p["c_2"], 0.0],
                [0.0, 0.0, 0.0],
            ]
        )
        move = expm(rates * (t[1] - t[0]))[:2]
        state, seen = np.zeros(2), np.empty(n)
        for k in range(n):
            seen[k] = state[1]
            state = move @ np.array([*state, drive[k]])
        return np.asarray((seen * p["gain"] + p["zero"])[:, None])

    return Rig(
        predict,
        {
            "r_1": (1.0, 0.03),
            "r_2": (2.0, 0.06),
            "c_1": (0.5, 0.02),
            "c_2": (0.4, 0.02),
            "leak": (0.0, 0.01),
            "gain": (1.0, 0.01),
        },
        {"zero": (0.0, 0.05)},
    )


def groundwater(n: int, rng: np.random.Generator) -> Rig:
    """Level in a borehole against rain, a well that is switched, and a river. [m]"""
    hour = np.arange(n)
    rain = rng.exponential(3.0, n) * (rng.random(n) < 0.08)
    pumped = (np.sin(hour / rng.uniform(8.0, 14.0)) > 0.4).astype(float)
    river = 0.5 * np.sin(2.0 * np.pi * hour / rng.uniform(40.0, 60.0))

    def predict(p: Mapping[str, float]) -> Array:
        def slow(drive: Array, hours: float) -> Array:
            stays = np.exp(-1.0 / hours)
            return np.asarray(lfilter([1.0 - stays], [1.0, -stays], drive))

        level = p["recharge"] * slow(rain, p["memory"]) - p["drawdown"] * slow(pumped, 6.0)
        level = level + p["river"] * slow(river, 3.0) + p["trend"] * hour / 100.0
        return np.asarray((level + p["level"])[:, None])

    return Rig(
        predict,
        {
            "recharge": (0.5, 0.03),
            "memory": (20.0, 1.0),
            "drawdown": (0.2, 0.01),
            "river": (0.6, 0.02),
            "trend": (0.0, 0.02),
        },
        {"level": (0.0, 0.2)},
    )


def beam(n: int, rng: np.random.Generator) -> Rig:
    """Deflection of a beam on springs under a load that crosses it. [mm]"""
    load = np.linspace(0.05, 0.95, n)
    gauge = rng.uniform(0.35, 0.65)

    def predict(p: Mapping[str, float]) -> Array:
        at = np.clip(load + p["offset"], 0.0, 1.0)
        small, large = np.minimum(at, gauge), np.maximum(at, gauge)
        bent = small * (1.0 - large) * (1.0 - small**2 - (1.0 - large) ** 2) / 6.0
        sunk = p["left"] * (1.0 - at) * (1.0 - gauge) + p["right"] * at * gauge
        return np.asarray(
            (p["load"] * (bent * 1000.0 / p["stiffness"] + sunk) + p["creep"] * load + p["zero"])[
                :, None
            ]
        )

    return Rig(
        predict,
        {
            "load": (1.0, 0.01),
            "stiffness": (2.0, 0.05),
            "left": (0.5, 0.05),
            "right": (0.5, 0.05),
            "offset": (0.0, 0.01),
            "creep": (0.0, 0.1),
        },
        {"zero": (0.0, 0.2)},
    )


def quick_return(n: int, rng: np.random.Generator) -> Rig:
    """Place of the ram of a shaper against the angle of its crank, two turns. [mm]"""
    turn = np.linspace(0.0, 4.0 * np.pi, n) + rng.uniform(0.0, 1.0)

    def predict(p: Mapping[str, float]) -> Array:
        angle = turn + np.radians(p["crank_zero_deg"])
        lever = np.arctan2(p["crank"] * np.sin(angle), p["ground"] + p["crank"] * np.cos(angle))
        way = np.tanh(np.gradient(lever, turn) / 0.05)
        ram = p["lever"] * np.sin(lever + np.radians(p["lever_zero_deg"])) + p["play"] * way
        return np.asarray((ram + p["datum"])[:, None])

    return Rig(
        predict,
        {
            "crank": (50.0, 0.3),
            "ground": (140.0, 0.8),
            "lever": (300.0, 2.0),
            "crank_zero_deg": (0.0, 0.5),
            "lever_zero_deg": (0.0, 0.5),
            "play": (0.0, 0.3),
        },
        {"datum": (0.0, 0.5)},
    )


TIMED = {
    rig.__name__: rig
    for rig in (
        mass_spring_damper,
        cooling_body,
        pendulum,
        pump,
        rc_network,
        groundwater,
        beam,
        quick_return,
    )
}


NOISES = ("iid", "t2.5", "growing", "AR .7", "AR .95", "real")


def ar1(n: int, stays: float, rng: np.random.Generator) -> Array:
    """First-order autoregressive noise of unit variance, stationary from its first row."""
    fresh = rng.standard_normal(n) * np.sqrt(1.0 - stays**2)
    fresh[0] = rng.standard_normal()
    return np.asarray(lfilter([1.0], [1.0, -stays], fresh))


def heads() -> dict[str, Array]:
    """Hours of the measured heads of a borehole, with sea level, rain and the flow of a well."""
    with HEADS.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {
        name: np.array([float(row[name] or "nan") for row in rows]) for name in list(rows[0])[1:]
    }


@cache
def real_residuals() -> Array:
    """What is left of those heads after least squares on three causes, each with a memory of its
    own; unit variance.
    """
    record = heads()
    read = np.isfinite(record["head_m"])

    def left(hours: Array) -> Array:
        slow = [
            lfilter([1.0 - np.exp(-1.0 / h)], [1.0, -np.exp(-1.0 / h)], record[name])
            for name, h in zip(("sea_m", "rain_mm_per_h", "well_m3_per_h"), hours, strict=True)
        ]
        columns = np.column_stack([*slow, np.ones(len(read))])[read]
        head = record["head_m"][read]
        return np.asarray(head - columns @ np.linalg.lstsq(columns, head, rcond=None)[0])

    hours = np.exp(least_squares(lambda x: left(np.exp(x)), np.log([2.0, 20.0, 5.0])).x)
    found = left(hours)
    return np.asarray(found / np.std(found))


def scatter(kind: str, exact: Array, rng: np.random.Generator) -> Array:
    """Noise of one series of rows, of unit variance on average."""
    n = len(exact)
    if kind == "t2.5":
        return np.asarray(rng.standard_t(2.5, n) / np.sqrt(5.0))
    if kind == "growing":
        grows = 0.2 + np.abs(exact) / np.max(np.abs(exact))
        return np.asarray(grows * rng.standard_normal(n) / np.sqrt(np.mean(grows**2)))
    if kind.startswith("AR"):
        return ar1(n, float(kind[2:]), rng)
    if kind == "real":
        record = real_residuals()
        starts = rng.integers(0, len(record) - BLOCK, -(-n // BLOCK))
        blocks = [rng.choice([-1.0, 1.0]) * record[k : k + BLOCK] for k in starts]
        return np.concatenate(blocks)[:n]
    return rng.standard_normal(n)
