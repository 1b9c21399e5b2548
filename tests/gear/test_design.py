"""A linkage as a vector of its free numbers, alone and in batches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import tomli_w

from mlg_troubleshoot.gear.assembly import DesignSpace, member_values
from mlg_troubleshoot.gear.gear import Gear, Linkage
from mlg_troubleshoot.gear.gear_file import load_gear
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
        branches = [
            {k: v for k, v in write_program(each.mechanism).parameters.items() if k[:4] == "sign"}
            for each in (again, member)
        ]
        assert branches[0] == branches[1]


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


def test_a_linkage_written_as_a_member_reads_back_from_the_ensemble(gear, tmp_path):
    for file in gear.path.parent.glob("hawker-800xp*"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    ensemble = tmp_path / "hawker-800xp-ensemble.toml"
    ensemble.write_text(
        ensemble.read_text()
        + "\n"
        + tomli_w.dumps({"members": {"K": member_values(gear.ensemble[3])}})
    )
    enlarged = load_gear(tmp_path / "hawker-800xp.toml")
    assert [linkage.name for linkage in enlarged.ensemble][-1] == "K"
    links = [0.001 * (-1) ** i for i in range(20)]
    again = enlarged.ensemble_models[-1].displacement(links)
    assert float(again) == pytest.approx(
        float(gear.ensemble_models[3].displacement(links)), abs=1e-12
    )
