"""What rows can tell before a measured value is looked at: what they show of each suspect, and
which suspects are one to them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask

# Share of its effect that a suspect keeps given the nuisance parameters, below which it cannot be
# tested; given another suspect, below which the two are one.
TESTABLE = 0.03


@dataclass(frozen=True)
class Design:
    """Testable suspects in classes that these rows cannot distinguish, by their places."""

    classes: tuple[tuple[int, ...], ...]

    @property
    def testable(self) -> frozenset[int]:
        """All suspects that these rows can test."""
        return frozenset(k for members in self.classes for k in members)

    def within(self, seen: Mask) -> Design:
        """Leave out what cannot be tested after all."""
        classes = (tuple(k for k in members if seen[k]) for members in self.classes)
        return Design(tuple(members for members in classes if members))

    def class_of(self, k: int) -> tuple[int, ...]:
        """Class that a suspect is in."""
        return next(members for members in self.classes if k in members)


def basis_of(columns: Array, tolerance: float = 1e-7) -> Array:
    """Orthonormal basis of what some columns of equal worth span."""
    size = np.linalg.norm(columns, axis=0)
    if not np.any(size > 0.0):
        return np.empty((len(columns), 0))
    left, values, _right = np.linalg.svd(
        columns[:, size > 0.0] / size[size > 0.0], full_matrices=False
    )
    return left[:, values > tolerance * values[0]]


def project_out(columns: Array, fixed: Array) -> tuple[Array, Mask]:
    """Whitened columns less what fixed ones absorb, and whether enough is left to be tested."""
    basis = basis_of(fixed)
    left = columns - basis @ (basis.T @ columns)
    size = np.linalg.norm(columns, axis=0)
    return left, (np.linalg.norm(left, axis=0) > TESTABLE * size) & (
        size > 1e-9 * size.max(initial=0.0)
    )


def design_of(columns: Array, nuisance: Array) -> Design:
    """Find untestable suspects and alias classes from whitened sensitivities."""
    left, seen = project_out(columns, nuisance)
    own = np.linalg.norm(left, axis=0)
    testable = [int(k) for k in np.flatnonzero(seen)]
    unit = left / np.where(own > 0.0, own, 1.0)
    alike = 1.0 - (unit.T @ unit) ** 2 < TESTABLE**2
    classes: list[tuple[int, ...]] = []
    for k in testable:
        if not any(k in members for members in classes):
            members = [k]
            for j in members:
                members += [i for i in testable if alike[i, j] and i not in members]
            classes.append(tuple(sorted(members)))
    return Design(tuple(classes))
