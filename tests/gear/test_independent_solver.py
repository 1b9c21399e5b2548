"""The closed form agrees with a solver that closes the loops numerically in space."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.linkage import LinkageModel
from tests.gear.independent_solver import LoopClosure, read_linkages

SAMPLES_A, SAMPLES_OTHERS = 200, 20


@dataclass(frozen=True)
class Sample:
    """Strokes and virtual links of a linkage, with what the second solver gives."""

    model: LinkageModel
    stroke: np.ndarray
    links: np.ndarray
    solved: np.ndarray


def draw(model: LinkageModel, solver: LoopClosure, n: int, seed: int) -> Sample:
    rng = np.random.default_rng(seed)
    stroke = np.concatenate([np.linspace(*model.stroke, 5), rng.uniform(*model.stroke, n - 5)])
    length, direction = rng.uniform(0, 0.015, (n, 10)), rng.uniform(0, 2 * np.pi, (n, 10))
    links = np.stack([length * np.cos(direction), length * np.sin(direction)], axis=-1)
    solved = [solver.solve(s, v) for s, v in zip(stroke, links, strict=True)]
    return Sample(model, stroke, links, np.array(solved))


@pytest.fixture(scope="module")
def solvers(gear: Gear) -> dict[str, LoopClosure]:
    folder: Path = gear.path.parent
    return read_linkages(folder / "hawker-800xp.toml", folder / "hawker-800xp-ensemble.toml")


@pytest.fixture(scope="module")
def samples(gear: Gear, solvers: dict[str, LoopClosure]) -> list[Sample]:
    return [
        draw(model, solvers[linkage.name], SAMPLES_A if i == 0 else SAMPLES_OTHERS, seed=i)
        for i, (linkage, model) in enumerate(zip(gear.ensemble, gear.ensemble_models, strict=True))
    ]


def closed_form(sample: Sample) -> np.ndarray:
    flat = sample.links.reshape(len(sample.stroke), 20)
    return sample.model.kernel.output(sample.stroke, [flat[:, i] for i in range(20)])


def test_plunger_positions_agree_to_a_billionth_of_an_inch_on_every_linkage(samples):
    errors = [np.max(np.abs(closed_form(s) - s.solved[:, 4])) for s in samples]
    assert sum(len(s.stroke) for s in samples) >= 300
    assert max(errors) < 1e-9


def test_the_samples_move_the_plunger_far_more_than_the_tolerance(samples: list[Sample]) -> None:
    assert np.std(np.concatenate([s.solved[:, 4] for s in samples])) > 0.05


def test_the_calibration_rate_agrees_on_every_linkage(gear, solvers):
    for linkage, model in zip(gear.ensemble, gear.ensemble_models, strict=True):
        assert solvers[linkage.name].calibration(0.45) == pytest.approx(model.rate, rel=1e-8)


def test_lever_joints_agree_in_space(samples, solvers):
    sample, solver = samples[0], solvers["A"]
    flat = sample.links.reshape(len(sample.stroke), 20)
    place = sample.model.kernel.positions(sample.stroke, [flat[:, i] for i in range(20)])
    origin = solver.p["6"]
    worst = 0.0
    for i, (crank, release, lock, bell, _) in enumerate(sample.solved):
        v4, v8 = sample.links[i, 3], sample.links[i, 7]
        in_side = {
            "1": ("E", crank, 0.0),
            "3": ("Q", release, 0.0),
            "5": ("4", lock, v4),
            "6": ("4", lock, v4),
        }
        for joint, (pivot, angle, shift) in in_side.items():
            found = solver.turned(pivot, joint, angle)[:2] + shift
            worst = max(worst, *np.abs(found - [place[joint][0][i], place[joint][1][i]]))
        for joint in ("7", "9"):
            found = solver.assembly @ (solver.turned("8", joint, bell) - origin) + v8
            worst = max(worst, *np.abs(found - [place[joint][0][i], place[joint][1][i]]))
    assert worst < 1e-9


def test_the_second_solver_imports_nothing_of_the_package() -> None:
    source = (Path(__file__).parent / "independent_solver.py").read_text(encoding="utf-8")
    assert "mlg_troubleshoot" not in source
