"""A second solver of the down-lock linkage that shares nothing with the package but the
coordinates.

Each loop of the mechanism is closed numerically in three dimensions: five unknowns (four lever
angles and the plunger's travel), five residuals (one per loop), a general root finder. It needs
neither the law of cosines nor a reduction to a plane, and knows no order of the mechanism.
"""

from __future__ import annotations

import tomllib
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar, root

Z = np.array([0.0, 0.0, 1.0])
Flat = dict[str, tuple[float, float]]


def _norm(vector: np.ndarray) -> complex:
    # Not numpy's norm, whose absolute values would lose the complex step.
    return np.sqrt(vector @ vector)


class LoopClosure:
    """One linkage, solved by closing its loops, from its coordinates at mid-position, each in its
    own plane, and the actuator's extension there. [in]
    """

    def __init__(
        self, points: Flat, hinge_deg: float, dihedral_deg: float, axis_deg: float, release: float
    ) -> None:
        tau, delta, alpha = np.radians([hinge_deg, dihedral_deg, axis_deg])
        self.release = release
        hinge = np.array([np.cos(tau), np.sin(tau), 0.0])
        across = np.cos(delta) * np.array([-np.sin(tau), np.cos(tau), 0.0]) + np.sin(delta) * Z
        self.side = np.eye(3)[:2]
        self.assembly = np.array([hinge, across])
        self.normal = np.cross(hinge, across)
        flat = {name: np.array(at) for name, at in points.items()}
        origin = flat["6"] @ self.side
        self.p = {n: flat[n] @ self.side for n in ("F", "E", "Q", "4", "1", "2", "3", "5", "6")}
        self.p |= {n: origin + flat[n] @ self.assembly for n in ("7", "8", "9", "10")}
        self.axis = np.cos(alpha) * hinge + np.sin(alpha) * across
        self.length = {
            pair: float(np.linalg.norm(self.p[pair[0]] - self.p[pair[1]]))
            for pair in (("F", "1"), ("3", "5"), ("6", "7"), ("9", "10"))
        }
        # The same for every call: arms of the levers and what turning them by 90° gives.
        self.arm = {
            (pivot, joint): (
                self.p[joint] - self.p[pivot],
                np.cross(normal, self.p[joint] - self.p[pivot]),
            )
            for pivot, joints, normal in (
                ("E", "12", Z),
                ("Q", "23", Z),
                ("4", "56", Z),
                ("8", "79", self.normal),
            )
            for joint in joints
        }

    def turned(self, pivot: str, joint: str, angle: float) -> np.ndarray:
        arm, left = self.arm[pivot, joint]
        return self.p[pivot] + np.cos(angle) * arm + np.sin(angle) * left

    def residuals(self, unknown: np.ndarray, stroke: float, v: np.ndarray) -> np.ndarray:
        """Errors of the five loops; complex unknowns give derivatives. [in]"""
        crank, release, lock, bell, travel = unknown
        shift = [*(v[:5] @ self.side), *(v[5:] @ self.assembly)]
        one, two = self.turned("E", "1", crank), self.turned("E", "2", crank)
        three = self.turned("Q", "3", release)
        five, six = (self.turned("4", n, lock) + shift[3] for n in ("5", "6"))
        seven, nine = (self.turned("8", n, bell) + shift[7] for n in ("7", "9"))
        ten = self.p["10"] + travel * self.axis
        slot, pin = self.turned("Q", "2", release) - self.p["Q"], two + shift[1] - self.p["Q"]
        return np.array(
            [
                _norm(one - self.p["F"] - shift[0]) - self.length["F", "1"] - stroke + self.release,
                (slot[0] * pin[1] - slot[1] * pin[0]) / _norm(slot),
                _norm(five - three - shift[2] - shift[4]) - self.length["3", "5"],
                _norm(seven - six - shift[5] - shift[6]) - self.length["6", "7"],
                _norm(ten - nine - shift[8] - shift[9]) - self.length["9", "10"],
            ]
        )

    def jacobian(self, unknown: np.ndarray, stroke: float, v: np.ndarray) -> np.ndarray:
        """Derivatives of the residuals by the complex step. [in/rad and 1]"""
        columns = [
            self.residuals(unknown + 1e-30j * row, stroke, v).imag / 1e-30 for row in np.eye(5)
        ]
        return np.array(columns).T

    @cached_property
    def without_clearance(self) -> tuple[np.ndarray, np.ndarray]:
        """Strokes and unknowns, followed from mid-position to Down Lock so that no branch is
        changed.
        """
        strokes = np.linspace(self.release, 0.0, 13)
        followed = [np.zeros(5)]
        for stroke in strokes[1:]:
            followed.append(self._root(followed[-1], stroke, np.zeros((10, 2))))
        return strokes, np.array(followed)

    def solve(self, stroke: float, v: np.ndarray | None = None) -> np.ndarray:
        """Unknowns at one stroke: four angles [rad] and the plunger's travel from mid-position
        [in].
        """
        strokes, followed = self.without_clearance
        start = followed[np.argmin(np.abs(strokes - stroke))]
        return self._root(start, stroke, np.zeros((10, 2)) if v is None else v)

    def _root(self, start: np.ndarray, stroke: float, v: np.ndarray) -> np.ndarray:
        # Counted from 1 and not from 0: the root finder scales its first step by the size of its
        # start.
        found = root(
            lambda x: self.residuals(x - 1.0, stroke, v),
            start + 1.0,
            jac=lambda x: self.jacobian(x - 1.0, stroke, v),
            options={"xtol": 1e-15},
        )
        if np.max(np.abs(found.fun)) > 1e-11:
            raise ArithmeticError(f"loops stay open by {np.max(np.abs(found.fun)):.1e} in")
        return found.x - 1.0

    def calibration(self, travel: float) -> float:
        """Rate that gives the prescribed travel from the least displacement to mid-position. [1]"""
        down_lock = self.solve(0.0)[4]
        sense = np.sign(-down_lock)
        least = minimize_scalar(
            lambda s: sense * self.solve(s)[4],
            bounds=(0.0, self.release),
            method="bounded",
            options={"xatol": 1e-7},
        )
        return float(travel / min(least.fun, sense * down_lock) * -sense)


def read_linkages(gear_file: Path, ensemble_file: Path) -> dict[str, LoopClosure]:
    """The ten linkages from the numbers of the two files alone."""
    reference = tomllib.loads(gear_file.read_text(encoding="utf-8"))
    members = tomllib.loads(ensemble_file.read_text(encoding="utf-8"))["members"]
    linkages = {}
    for name, m in {"A": reference, **members}.items():
        plane = m["planes"]["link_assembly"]
        places = m["ground"] | m["moving"] | plane["ground"] | plane["moving"]
        linkages[name] = LoopClosure(
            {n: tuple(at) for n, at in places.items()},
            plane["hinge_direction_deg"],
            plane["dihedral_deg"],
            m["guides_deg"]["10"],
            m["input"]["travel"][1],
        )
    return linkages
