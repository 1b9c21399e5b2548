"""The forward model beside other libraries: ``python
tests/benchmarks/bench_studies.py``.

Not collected by pytest. Everything runs in one process on one core in turn, so that the ratios mean
something on a shared machine; each time is the least of several runs. A library that is not
installed is left out and named: ``pip install numba pylinkage python-solvespace``.
``--full`` adds the paper-size total-order study.
"""

# The number of threads must be set before numpy is imported.
# ruff: noqa: E402

from __future__ import annotations

import argparse
import os
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.geometry.kernel import Kernel, numba_is_installed
from mlg_troubleshoot.geometry.mechanism import Crank, Dyad, Mechanism, Output, Plane, Point, Slider
from mlg_troubleshoot.indices.inputs import HeldDirections, Inputs, worst_directions

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Line:
    """One line of the result."""

    what: str
    value: str
    target: str
    holds: bool | None


def least(work: Callable[[], object], runs: int = 5) -> float:
    """Least time of several runs. [s]"""
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


DYADS = (("C", "B", "D", 7.0, 9.0), ("H", "C", "G", 8.0, 9.0))
LINE, ROD = 2.0, 8.0


def chain() -> Mechanism:
    """Four-bar of the published case, another dyad and a slider behind it."""
    points = (
        Point("A", "plane", 0.0, 0.0, fixed=True),
        Point("D", "plane", 6.0, 0.0, fixed=True, virtual_link=4),
        Point("G", "plane", 12.0, 0.0, fixed=True),
        Point("B", "plane", *(2.0 * np.array([np.cos(0.5), np.sin(0.5)])).tolist()),
    )
    located = {p.name: complex(p.x, p.y) for p in points}
    for joint, start, end, first, second in DYADS:
        located[joint] = _meet(located[start], located[end], first, second)
    h = located["H"]
    located["K"] = complex(h.real + float(np.sqrt(ROD**2 - (h.imag - LINE) ** 2)), LINE)
    points += tuple(Point(j, "plane", located[j].real, located[j].imag) for j in ("C", "H", "K"))
    steps = (
        Crank("B", "A"),
        *(Dyad(j, start, end, (k + 1,)) for k, (j, start, end, _, _) in enumerate(DYADS)),
        Slider("K", "H", 0.0, (3,)),
    )
    return Mechanism((Plane("plane"),), points, steps, Output("position", "K"), 0.5)


def _meet(a: complex, b: complex, first: float, second: float) -> complex:
    apart = abs(b - a)
    along = (first**2 - second**2 + apart**2) / (2.0 * apart)
    return a + (b - a) / apart * complex(along, np.sqrt(first**2 - along**2))


def forward(response: HeldDirections) -> list[Line]:
    """Forward model on the real linkage, and the same small chain in other libraries."""
    rng = np.random.default_rng(0)
    clearance = np.ascontiguousarray(0.0075 * rng.random((10, 1 << 20)))
    kernel, stroke = response.model.kernel, response.model.stroke[1]

    def rate(compiled: bool) -> float:
        def work() -> np.ndarray:
            return kernel.batch(stroke, clearance, response.directions, compiled=compiled)

        if np.isnan(work()).any():
            raise SystemExit("the linkage does not close on the benchmark's samples")
        return clearance.shape[1] / least(work)

    lines = []
    numpy_rate = rate(compiled=False)
    lines.append(
        Line("real linkage, numpy", f"{numpy_rate / 1e6:.1f} M/s", "≥ 8 M/s", numpy_rate >= 8e6)
    )
    if numba_is_installed():
        numba_rate = rate(compiled=True)
        lines.append(
            Line(
                "real linkage, numba", f"{numba_rate / 1e6:.1f} M/s", "≥ 50 M/s", numba_rate >= 50e6
            )
        )
    return lines + _chain_rates()


def _chain_rates() -> list[Line]:
    kernel = Kernel(chain())
    count = 1 << 20
    clearance = 0.01 * np.random.default_rng(0).random((4, count))
    compiled = numba_is_installed()

    def own() -> np.ndarray:
        return kernel.batch(0.5, clearance, np.zeros(4), compiled=compiled)

    own()
    own_rate = count / least(own)
    lines = [Line("small chain, this package", f"{own_rate / 1e6:.1f} M/s", "", None)]
    here = kernel.positions(0.5, kernel.no_clearance())["K"]
    for name, peer, factor in (
        ("pylinkage simulate_batch", _pylinkage, 100),
        ("python-solvespace", _solvespace, 3000),
    ):
        try:
            peer_rate, place = peer()
        except ImportError:
            lines.append(Line(f"small chain, {name}", "not installed", "", None))
            continue
        if np.hypot(place[0] - here[0], place[1] - here[1]) > 1e-6:
            raise SystemExit(f"{name} does not solve the same chain: {place} against {here}")
        ratio = own_rate / peer_rate
        lines.append(
            Line(
                f"small chain, {name}",
                f"{peer_rate / 1e3:.1f} k/s, ratio {ratio:.0f}",
                f"≥ {factor}",
                ratio >= factor,
            )
        )
    return lines


def _pylinkage() -> tuple[float, tuple[float, float]]:
    from pylinkage import Crank as PeerCrank
    from pylinkage import Ground, Linkage, RRPDyad, RRRDyad
    from pylinkage.bridge.solver_conversion import linkage_to_solver_data
    from pylinkage.population._batch_sim import simulate_batch

    m = chain()
    ground = {p.name: Ground(p.x, p.y, name=p.name) for p in m.points if p.fixed}
    parts: dict[str, object] = dict(ground)
    parts["B"] = PeerCrank(
        ground["A"], radius=2.0, angular_velocity=0.0, initial_angle=0.5, name="B"
    )
    for joint, start, end, first, second in DYADS:
        p = m.point(joint)
        parts[joint] = RRRDyad(parts[start], parts[end], first, second, x=p.x, y=p.y, name=joint)
    k = m.point("K")
    ends = Ground(0.0, LINE, name="L1"), Ground(30.0, LINE, name="L2")
    parts |= {
        "L1": ends[0],
        "L2": ends[1],
        "K": RRPDyad(parts["H"], *ends, ROD, x=k.x, y=k.y, name="K"),
    }
    linkage = Linkage(list(parts.values()))
    data = linkage_to_solver_data(linkage)
    count = 2000
    constraints = np.tile(data.constraints, (count, 1))
    positions = np.tile(data.positions, (count, 1, 1))
    track = simulate_batch(data, constraints, positions, 1)
    place = track[0, 0, -1]
    return count / least(lambda: simulate_batch(data, constraints, positions, 1)), (
        float(place[0]),
        float(place[1]),
    )


def _solvespace() -> tuple[float, tuple[float, float]]:
    from python_solvespace import SolverSystem

    m = chain()
    system = SolverSystem()
    plane = system.create_2d_base()
    handles = {p.name: system.add_point_2d(p.x, p.y, plane) for p in m.points}
    for p in m.points:
        if p.fixed or p.name == "B":
            system.dragged(handles[p.name], plane)
    for joint, start, end, first, second in DYADS:
        system.distance(handles[joint], handles[start], first, plane)
        system.distance(handles[joint], handles[end], second, plane)
    ends = system.add_point_2d(0.0, LINE, plane), system.add_point_2d(30.0, LINE, plane)
    for end in ends:
        system.dragged(end, plane)
    system.coincident(handles["K"], system.add_line_2d(*ends, plane), plane)
    system.distance(handles["K"], handles["H"], ROD, plane)
    count = 200
    rng = np.random.default_rng(0)
    starts = [
        (m.point("K").x + dx, m.point("K").y + dy)
        for dx, dy in 0.01 * rng.standard_normal((count, 2))
    ]

    def work() -> None:
        for x, y in starts:
            system.set_params(handles["K"].params, [x, y])
            system.solve()

    rate = count / least(work, 3)
    x, y = system.params(handles["K"].params)
    return rate, (x, y)


def paper_study(response: HeldDirections) -> list[Line]:
    """The paper-size total-order study on two cores."""
    import resource
    from concurrent.futures import ThreadPoolExecutor

    from mlg_troubleshoot.paper.total_order import TotalOrderStudy, total_order

    study = TotalOrderStudy(response, Inputs(load_gear().limits_in), 0)
    start = time.perf_counter()
    # The compiled loop runs without the interpreter's lock.
    with ThreadPoolExecutor(2) as executor:
        total_order(study, executor)
    seconds = time.perf_counter() - start
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return [
        Line(
            f"total-order study, {study.evaluations / 1e9:.3f}e9 solutions",
            f"{seconds:.1f} s",
            "≤ 90 s",
            seconds <= 90,
        ),
        Line("its memory", f"{memory:.0f} MiB", "≤ 500 MiB", memory <= 500),
    ]


def main() -> int:
    """Run everything, print a table, return 1 if a target is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--full", action="store_true", help="also the paper-size total-order study")
    full = parser.parse_args().full
    warnings.simplefilter("ignore")
    gear = load_gear()
    response = worst_directions(gear.model, gear.limits_in)
    lines = paper_study(response) if full else []
    lines = [*forward(response), *lines]
    for line in lines:
        mark = "" if line.holds is None else ("holds" if line.holds else "MISSED")
        print(f"{line.what:45s} {line.value:62s} {line.target:14s} {mark}")
    return 1 if any(line.holds is False for line in lines) else 0


if __name__ == "__main__":
    sys.exit(main())
