"""Simulated rigs with known errors: nothing of the diagnosis is used here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.diagnosis import Suspect

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rig:
    """A simulation with its parameters: name → (nominal, trial)."""

    predict: Callable[[Mapping[str, float]], Array]
    suspects: dict[str, tuple[float, float]]
    nuisance: dict[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def suspected(self) -> list[Suspect]:
        return [Suspect(name, nominal, trial) for name, (nominal, trial) in self.suspects.items()]

    @property
    def unknown(self) -> list[Suspect]:
        return [Suspect(name, nominal, trial) for name, (nominal, trial) in self.nuisance.items()]

    @property
    def nominal(self) -> dict[str, float]:
        return {name: value[0] for name, value in {**self.suspects, **self.nuisance}.items()}

    def seen(self, name: str, change: float) -> float:
        """Root mean square of what a change does beside the nuisance parameters."""
        here = self.nominal
        base = self.predict(here)
        effect = (self.predict({**here, name: here[name] + change}) - base).ravel()
        free = [
            (self.predict({**here, k: here[k] + t}) - base).ravel() / np.sqrt(base.size)
            for k, (_v, t) in self.nuisance.items()
        ]
        if free:
            columns = np.column_stack(free)
            effect = effect - columns @ np.linalg.lstsq(columns, effect, rcond=1e-9)[0]
        return float(np.sqrt(np.mean(effect**2)))


def four_bar(n: int, rng: np.random.Generator) -> Rig:
    """Angle of the rocker of a four-bar linkage against the angle of its crank. [deg]"""
    crank = rng.uniform(0.0, 2.0 * np.pi, n)

    def predict(p: Mapping[str, float]) -> Array:
        turned = crank + np.radians(p["crank_zero_deg"])
        x, y = p["crank"] * np.cos(turned) - p["ground"], p["crank"] * np.sin(turned)
        apart = np.hypot(x, y)
        inner = (p["rocker"] ** 2 + apart**2 - p["coupler"] ** 2) / (2.0 * p["rocker"] * apart)
        angle = np.arctan2(y, x) - np.arccos(np.clip(inner, -1.0, 1.0))
        return (
            np.degrees(np.unwrap(np.sort(angle))[np.argsort(np.argsort(angle))])[:, None]
            * p["gain"]
            + p["zero"]
        )

    return Rig(
        predict,
        {
            "crank": (30.0, 0.3),
            "coupler": (90.0, 0.3),
            "rocker": (70.0, 0.3),
            "ground": (100.0, 0.3),
            "crank_zero_deg": (0.0, 0.3),
            "gain": (1.0, 0.01),
        },
        {"zero": (0.0, 0.5)},
    )


def two_link(n: int, rng: np.random.Generator) -> Rig:
    """Place of a planar arm's end by its two encoders, the camera's frame unknown. [mm]"""
    a, b = rng.uniform(-1.5, 1.5, n), rng.uniform(0.3, 2.4, n)

    def predict(p: Mapping[str, float]) -> Array:
        first = a * p["scale_1"] + np.radians(p["offset_1"])
        both = first + b * p["scale_2"] + np.radians(p["offset_2"]) - p["sag"] * np.cos(first)
        x = p["length_1"] * np.cos(first) + p["length_2"] * np.cos(both)
        y = p["length_1"] * np.sin(first) + p["length_2"] * np.sin(both)
        turn = np.radians(p["frame_turn"])
        return np.column_stack(
            [
                x * np.cos(turn) - y * np.sin(turn) + p["frame_x"],
                x * np.sin(turn) + y * np.cos(turn) + p["frame_y"],
            ]
        )

    return Rig(
        predict,
        {
            "length_1": (300.0, 1.0),
            "length_2": (250.0, 1.0),
            "offset_1": (0.0, 0.3),
            "offset_2": (0.0, 0.3),
            "scale_1": (1.0, 0.01),
            "scale_2": (1.0, 0.01),
            "sag": (0.0, 0.005),
        },
        {"frame_x": (0.0, 2.0), "frame_y": (0.0, 2.0), "frame_turn": (0.0, 0.3)},
    )


def slider_crank(n: int, rng: np.random.Generator) -> Rig:
    """Place of a piston against the angle of the crank, read up and down. [mm]"""
    turn, way = rng.uniform(0.0, 2.0 * np.pi, n), rng.choice([-1.0, 1.0], n)

    def predict(p: Mapping[str, float]) -> Array:
        angle = turn + np.radians(p["zero_deg"] + p["play_deg"] * way)
        side = p["radius"] * np.sin(angle) - p["desaxe"]
        place = p["radius"] * np.cos(angle) + np.sqrt(p["rod"] ** 2 - side**2)
        return (place * (1.0 + p["scale_ppm"] * 1e-6) + p["datum"])[:, None]

    return Rig(
        predict,
        {
            "radius": (40.0, 0.1),
            "rod": (140.0, 0.5),
            "desaxe": (0.0, 0.3),
            "zero_deg": (0.0, 0.2),
            "play_deg": (0.0, 0.1),
            "scale_ppm": (0.0, 500.0),
        },
        {"datum": (0.0, 0.2)},
    )


def thermal(n: int, rng: np.random.Generator) -> Rig:
    """Growth of a spindle at three places against speed and time. [µm]"""
    speed, time = rng.uniform(1.0, 10.0, n), rng.uniform(0.1, 6.0, n)

    def predict(p: Mapping[str, float]) -> Array:
        warm = (p["loss"] * speed**1.5 + p["drag"] * speed**2) * (
            1.0 - np.exp(-time / p["time_constant"])
        )
        places = np.array([0.2, 0.5, 1.0])
        return (
            p["expansion"] * warm[:, None] * places * np.exp(-p["decay"] * places)
            + p["pretension"] * speed[:, None] ** 2 * np.array([1.0, 0.0, -1.0])
            + np.array([p["zero_1"], p["zero_2"], p["zero_3"]])
        )

    return Rig(
        predict,
        {
            "loss": (1.0, 0.05),
            "drag": (0.2, 0.02),
            "time_constant": (1.5, 0.1),
            "expansion": (1.2, 0.05),
            "decay": (0.4, 0.05),
            "pretension": (0.0, 0.02),
        },
        {"zero_1": (0.0, 1.0), "zero_2": (0.0, 1.0), "zero_3": (0.0, 1.0)},
    )


def camera(n: int, rng: np.random.Generator) -> Rig:
    """Pixels at which a camera of unknown pose sees targets. [px]"""
    target = np.column_stack(
        [rng.uniform(-1.0, 1.0, n), rng.uniform(-0.8, 0.8, n), rng.uniform(2.0, 4.0, n)]
    )

    def predict(p: Mapping[str, float]) -> Array:
        x, y, z = (target + np.array([p["x"], p["y"], p["z"]])).T
        x, z = (
            x * np.cos(p["yaw"]) + z * np.sin(p["yaw"]),
            z * np.cos(p["yaw"]) - x * np.sin(p["yaw"]),
        )
        u, v = x / z, y / z
        bend = 1.0 + p["k1"] * (u**2 + v**2) + p["k2"] * (u**2 + v**2) ** 2
        return np.column_stack(
            [
                p["focal"] * bend * u + p["centre_u"] + p["skew"] * v,
                p["focal"] * p["aspect"] * bend * v + p["centre_v"],
            ]
        )

    return Rig(
        predict,
        {
            "focal": (1000.0, 5.0),
            "aspect": (1.0, 0.005),
            "centre_u": (640.0, 3.0),
            "centre_v": (480.0, 3.0),
            "k1": (0.0, 0.02),
            "k2": (0.0, 0.02),
            "skew": (0.0, 3.0),
        },
        {"x": (0.0, 0.01), "y": (0.0, 0.01), "z": (0.0, 0.02), "yaw": (0.0, 0.005)},
    )


RIGS = {rig.__name__: rig for rig in (four_bar, two_link, slider_crank, thermal, camera)}


def readings(
    rig: Rig,
    values: Mapping[str, float],
    noise: float,
    rng: np.random.Generator,
    groups: NDArray[np.int64] | None = None,
    group_scatter: float = 0.0,
    outliers: float = 0.0,
    missing: float = 0.0,
    heavy: bool = False,
) -> Array:
    """Readings of a rig whose parameters are not nominal, with everything that readings have."""
    true = {
        **rig.nominal,
        **{name: trial * rng.uniform(-1.0, 1.0) + v for name, (v, trial) in rig.nuisance.items()},
    }
    exact = rig.predict({**true, **values})
    scatter = (
        rng.standard_t(3, exact.shape) / np.sqrt(3.0) if heavy else rng.standard_normal(exact.shape)
    )
    if groups is not None:
        scatter += group_scatter * rng.standard_normal((groups.max() + 1, exact.shape[1]))[groups]
    far = rng.random(exact.shape) < outliers
    scatter[far] += rng.choice([-8.0, 8.0], far.sum())
    read = exact + noise * scatter
    read[rng.random(exact.shape) < missing] = np.nan
    return np.asarray(read)
