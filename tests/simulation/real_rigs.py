"""Real mechanisms whose measured data the tutorials ship, as simulations to be diagnosed."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.diagnosis import Suspect

Array = NDArray[np.float64]


DATA = Path(__file__).parents[2] / "docs" / "tutorial" / "data"


class Gear:
    """Runout of a gear on two eccentric sleeves against the eccentricity that was set. [mm]"""

    def __init__(self) -> None:
        table = np.genfromtxt(DATA / "gear-eccentricity.csv", delimiter=",", skip_header=1)
        self.session, self.set_mm, self.runout_mm = (
            table[:, 0].astype(int),
            table[:, 1],
            table[:, 2:],
        )

    def predict(self, p: Mapping[str, float]) -> Array:
        # Sleeves of one size turned so that, by drawing, the sum of both vectors is what was set.
        sleeves = p["sleeve_size"] * self.set_mm / 0.1
        return (p["dial_scale"] * sleeves + p.get("dial_zero", 0.0))[:, None]

    suspects = (
        Suspect("sleeve_size", 0.1, 0.01, "mm", separates="the dial against a gauge block"),
        Suspect("dial_scale", 1.0, 0.05, separates="the dial against a gauge block"),
        # A dial is set to within one of its divisions.
        Suspect("dial_zero", 0.0, 0.005, "mm", prior_sd=0.01),
    )


class Plotter:
    """Pulse width at which each of two servos stands at an angle, from either side. [µs]"""

    def __init__(self) -> None:
        with (DATA / "brachiograph-servos.csv").open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        self.servo = np.array([int(row["servo"]) for row in rows])
        self.angle_deg = np.array([float(row["angle_deg"]) for row in rows])
        self.way = np.array([1.0 if row["direction"] == "cw" else -1.0 for row in rows])
        self.pulse_us = np.array([[float(row["pulse_us"])] for row in rows])

    def predict(self, p: Mapping[str, float]) -> Array:
        pulse = np.empty(len(self.servo))
        for servo, turn in ((1, -1.0), (2, 1.0)):
            own = self.servo == servo
            angle = self.angle_deg[own] + p[f"hysteresis_{servo}"] * self.way[own]
            pulse[own] = p[f"centre_{servo}"] + turn * p[f"slope_{servo}"] * angle
        return pulse[:, None]

    suspects = tuple(
        Suspect(f"{name}_{servo}", nominal, trial, unit)
        for servo in (1, 2)
        for name, nominal, trial, unit in (
            ("slope", 10.0, 0.5, "µs/deg"),
            ("hysteresis", 0.0, 0.3, "deg"),
        )
    )
    nuisance = (Suspect("centre_1", 1050.0, 20.0, "µs"), Suspect("centre_2", 600.0, 20.0, "µs"))


class Panda:
    """Place of the ball on an arm's flange less the place of the socket that it sits in. [mm]"""

    A_MM = (0.0, 0.0, 0.0, 82.5, -82.5, 0.0, 88.0)
    D_MM = (333.0, 0.0, 316.0, 0.0, 384.0, 0.0, 0.0)
    ALPHA_DEG = (0.0, -90.0, 90.0, 90.0, -90.0, 90.0, 90.0)

    def __init__(self, session: int, places: Callable[[str], bool] = lambda _place: True) -> None:
        with (DATA / "panda-sockets.csv").open(encoding="utf-8") as file:
            rows = [
                r
                for r in csv.DictReader(file)
                if r["session"] == str(session) and places(r["place"])
            ]
        self.angles = np.array([[float(row[f"q{j}_rad"]) for j in range(1, 8)] for row in rows])
        self.place = np.array([row["place"] for row in rows])
        self.socket = np.array([f"{row['place']}/{row['socket']}" for row in rows])
        self.measured = np.zeros((len(self.angles), 3))
        ball = self.ball({"tool_x": 0.0, "tool_y": 0.0, "tool_z": 120.0})
        self.nuisance = [Suspect(f"tool_{x}", 120.0 if x == "z" else 0.0, 5.0, "mm") for x in "xyz"]
        for name in sorted(set(self.socket)):
            middle = ball[self.socket == name].mean(axis=0)
            self.nuisance += [
                Suspect(f"{name}/{x}", float(v), 5.0, "mm")
                for x, v in zip("xyz", middle, strict=True)
            ]

    def ball(self, p: Mapping[str, float]) -> Array:
        """Place of the ball by modified Denavit–Hartenberg parameters, changes of them in mm and
        degrees. [mm]
        """
        n = len(self.angles)
        turn, at = np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3))
        for j in range(7):
            a = self.A_MM[j] + p.get(f"a_{j + 1}", 0.0)
            d = self.D_MM[j] + p.get(f"d_{j + 1}", 0.0)
            twist = np.radians(self.ALPHA_DEG[j] + p.get(f"alpha_{j + 1}", 0.0))
            joint = self.angles[:, j] + np.radians(p.get(f"joint_{j + 1}", 0.0))
            c, s, ct, st = np.cos(joint), np.sin(joint), np.cos(twist), np.sin(twist)
            at = at + turn @ np.array([a, -d * st, d * ct])
            step = np.zeros((n, 3, 3))
            step[:, 0, 0], step[:, 0, 1] = c, -s
            step[:, 1, 0], step[:, 1, 1], step[:, 1, 2] = s * ct, c * ct, -st
            step[:, 2, 0], step[:, 2, 1], step[:, 2, 2] = s * st, c * st, ct
            turn = turn @ step
        return np.asarray(at + turn @ np.array([p["tool_x"], p["tool_y"], p["tool_z"]]))

    def predict(self, p: Mapping[str, float]) -> Array:
        left = self.ball(p)
        for name in set(self.socket):
            left[self.socket == name] -= [p[f"{name}/{x}"] for x in "xyz"]
        return left

    offsets = tuple(Suspect(f"joint_{j}", 0.0, 0.5, "deg") for j in range(1, 8))
    every = offsets + tuple(
        Suspect(f"{name}_{j}", 0.0, trial, unit)
        for j in range(1, 8)
        for name, trial, unit in (("a", 1.0, "mm"), ("d", 1.0, "mm"), ("alpha", 0.5, "deg"))
    )
