"""A linkage as a vector of its free numbers, alone and in batches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mlg_troubleshoot.gear.design import DesignSpace
from mlg_troubleshoot.gear.gear import Gear, Linkage
from mlg_troubleshoot.geometry.mechanism import Dyad, Slider
from mlg_troubleshoot.geometry.program import write_program


def moved_as_a_whole(linkage: Linkage) -> Linkage:
    """The same linkage, shifted and turned in its base plane."""
    m = linkage.mechanism
    base, turn = m.planes[0].name, np.exp(0.3j)
    points = []
    for p in m.points:
        z = complex(p.x, p.y) * turn + (1.0 - 2.0j) if p.plane == base else complex(p.x, p.y)
        points.append(replace(p, x=z.real, y=z.imag))
    planes = tuple(
        replace(p, hinge_direction=p.hinge_direction + 0.3) if p.parent == base else p
        for p in m.planes
    )
    return replace(linkage, mechanism=replace(m, points=tuple(points), planes=planes))


def test_a_linkage_comes_back_from_its_vector(gear: Gear) -> None:
    space = DesignSpace(gear.reference)
    for member in gear.ensemble:
        again = space.linkage(space.vector(member), member.name)
        places = [[(p.x, p.y) for p in each.mechanism.points] for each in (again, member)]
        assert np.array(places[0]) == pytest.approx(np.array(places[1]), abs=1e-9)
        assert again.stroke == pytest.approx(member.stroke)


def test_branch_signs_are_those_of_the_coordinates(gear: Gear) -> None:
    space = DesignSpace(gear.reference)
    for member in gear.ensemble:
        again = space.linkage(space.vector(member), member.name)
        signs = [
            [s.sign for s in each.mechanism.steps if isinstance(s, (Dyad, Slider))]
            for each in (again, member)
        ]
        assert signs[0] == signs[1]


def test_moving_and_turning_everything_together_is_not_another_design(gear: Gear) -> None:
    space = DesignSpace(gear.reference)
    for member in gear.ensemble[:4]:
        assert space.vector(moved_as_a_whole(member)) == pytest.approx(
            space.vector(member), abs=1e-9
        )


def test_the_numbers_of_a_batch_are_those_of_each_linkage(gear: Gear) -> None:
    space = DesignSpace(gear.reference)
    vectors = np.array([space.vector(member) for member in gear.ensemble])
    together = write_program(space.assembled(vectors)).parameters
    for i, vector in enumerate(vectors):
        alone = write_program(space.assembled(vector)).parameters
        assert list(alone) == list(together)
        for name, value in alone.items():
            assert np.broadcast_to(together[name], len(vectors))[i] == pytest.approx(
                value, abs=1e-12
            ), name
