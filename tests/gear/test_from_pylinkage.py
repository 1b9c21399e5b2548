"""Linkages of pylinkage 1.3.0, moved by it and by a gear made of them: every point of its examples.

The examples are those of its documentation (`docs/examples`) and of its server (`api/routers`).
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from pylinkage.actuators import ArcCrank, Crank, LinearActuator
from pylinkage.cam.motion_laws import HarmonicMotionLaw
from pylinkage.cam.profiles import FunctionProfile
from pylinkage.components import Ground, PointTracker
from pylinkage.dyads import FixedDyad, PPDyad, RRPDyad, RRRDyad, TranslatingCamFollower
from pylinkage.mechanism import MechanismBuilder, fourbar, slider_crank
from pylinkage.mechanism.serialization import mechanism_to_json
from pylinkage.simulation import Linkage
from pylinkage.synthesis import fourbar_from_lengths

from mlg_troubleshoot.errors import GearFileError
from mlg_troubleshoot.gear.from_pylinkage import short_form_of
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.gear.short_form import short_form
from mlg_troubleshoot.units import LengthUnit

LIMITS = {"limit": 0.001, "margin": 0.01}


def server_four_bar() -> Any:
    return (
        MechanismBuilder("Four-Bar Linkage")
        .add_ground_link("ground", ports={"O1": (0, 0), "O2": (100, 0)})
        .add_driver_link("crank", length=25, motor_port="O1", omega=0.1, initial_angle=math.pi / 4)
        .add_link("coupler", length=70)
        .add_link("rocker", length=60)
        .connect("crank.tip", "coupler.0")
        .connect("coupler.1", "rocker.0")
        .connect("rocker.1", "ground.O2")
        .build()
    )


def server_chebyshev() -> Any:
    low, high = math.acos(0.8), math.acos(-0.2)
    return (
        MechanismBuilder("Chebyshev Linkage")
        .add_ground_link("ground", ports={"O1": (0, 0), "O2": (100, 0)})
        .add_arc_driver_link(
            "crank",
            length=125,
            motor_port="O1",
            omega=0.05,
            arc_start=low,
            arc_end=high,
            initial_angle=(low + high) / 2,
        )
        .add_link("coupler", length=50)
        .add_link("rocker", length=125)
        .connect("crank.tip", "coupler.0")
        .connect("coupler.1", "rocker.0")
        .connect("rocker.1", "ground.O2")
        .add_point_tracker("coupler_midpoint", "coupler.0", "coupler.1")
        .build()
    )


def server_crank_slider() -> Any:
    return (
        MechanismBuilder("Crank-Slider Mechanism")
        .add_ground_link("ground", ports={"O": (0, 0)})
        .add_driver_link(
            "crank", length=50, motor_port="O", omega=0.1, initial_angle=math.atan2(40, 30)
        )
        .add_link("connecting_rod", length=100)
        .add_slide_axis("rail", through=(0, 0), direction=(1, 0))
        .connect("crank.tip", "connecting_rod.0")
        .connect_prismatic("connecting_rod.1", "rail")
        .build()
    )


def server_pantograph() -> Any:
    return (
        MechanismBuilder("Pantograph")
        .add_ground_link("ground", ports={"O": (0, 0)})
        .add_driver_link("crank", length=50, motor_port="O", omega=0.1, initial_angle=0.01)
        .add_link("arm", length=50)
        .connect("crank.tip", "arm.0")
        .connect("arm.1", "ground.O")
        .build()
    )


def documented_four_bar() -> Linkage:
    """Crank and rocker alike: flat at the start, so it is moved on before it is read."""
    a, d = Ground(0.0, 0.0, name="A"), Ground(3.0, 0.0, name="D")
    crank = Crank(anchor=a, radius=1.0, angular_velocity=math.tau / 20, name="B")
    pin = RRRDyad(anchor1=crank.output, anchor2=d, distance1=3.0, distance2=1.0, name="C")
    linkage = Linkage([a, d, crank, pin], name="My four-bar linkage")
    list(linkage.step(iterations=2))
    return linkage


def stroke_engine() -> Linkage:
    anchor, a, b = (Ground(x, 0.0, name=n) for x, n in ((0.0, "O"), (0.0, "a"), (1.0, "b")))
    crank = Crank(anchor=anchor, radius=1.0, angular_velocity=0.1, name="Crank")
    slider = RRPDyad(crank.output, a, b, distance=1.5, name="Slider")
    return Linkage([anchor, a, b, crank, slider], name="Simple four-stroke engine")


def strider() -> Linkage:
    """With a tenth of its steps: at 36 degrees a step its solver takes foot I to the other side."""
    a, y = Ground(0.0, 0.0, name="A"), Ground(0.0, 1.0, name="Y")
    right = FixedDyad(a, y, distance=2, angle=-math.pi / 4, name="B")
    left = FixedDyad(a, y, distance=2, angle=math.pi / 4, name="Bp")
    crank = Crank(anchor=a, radius=1, angular_velocity=-math.tau / 100, name="C")
    d = RRRDyad(left, crank.output, 1.8, 2.6, name="D")
    e = RRRDyad(right, crank.output, 1.8, 2.6, name="E")
    f = FixedDyad(crank.output, e, distance=1.4, angle=-math.pi - 0.2, name="F")
    g = FixedDyad(crank.output, d, distance=1.4, angle=math.pi + 0.2, name="G")
    h = RRRDyad(d, f, 2.5, 1.8, name="H")
    i = RRRDyad(e, g, 2.5, 1.8, name="I")
    linkage = Linkage([a, y, right, left, crank, d, e, f, g, h, i], name="Strider")
    places = [(0, 0), (0, 1), (1.41, 1.41), (-1.41, 1.41), (0, -1), (-2.25, 0), (2.25, 0)]
    places += [(-1.4, -1.2), (1.4, -1.2), (-2.7, -2.7), (2.7, -2.7)]
    linkage.set_coords([(float(x), float(y)) for x, y in places])
    return linkage


def arc_crank_with_arm() -> Linkage:
    """A tracker whose two points lie on no link together."""
    o, d = Ground(0.0, 0.0, name="O"), Ground(3.0, 0.0, name="D")
    crank = ArcCrank(o, 1.0, 0.05, arc_start=0.4, arc_end=1.6, initial_angle=0.9, name="A")
    pin = RRRDyad(crank.output, d, 3.2, 2.0, name="B")
    arm = PointTracker(d, crank.output, distance=0.7, angle=0.3, name="T")
    return Linkage([o, d, crank, pin, arm], name="arm")


def moving_guides() -> Linkage:
    """A slider on the coupler of a four-bar, and where the coupler's line crosses the rocker's."""
    o, d, e = (Ground(x, y, name=n) for x, y, n in ((0, 0, "O"), (3, 0, "D"), (2, 2.5, "E")))
    crank = Crank(o, 1.0, angular_velocity=0.05, initial_angle=0.9, name="A")
    pin = RRRDyad(crank.output, d, 3.6, 2.6, name="B")
    slider = RRPDyad(e, crank, pin, distance=1.2, name="C")
    crossing = PPDyad(crank, slider, pin, d, name="P")
    corner = PPDyad(crank, pin, o, e, name="Q")
    return Linkage([o, d, e, crank, pin, slider, crossing, corner], name="moving guides")


def toggle_press() -> Linkage:
    """A cylinder whose rod moves a toggle: its lower link pushes a ram down a guide."""
    base, top = Ground(-2.0, 0.4, name="base"), Ground(0.6, 2.0, name="top")
    low, high = Ground(0.5, -3.0, name="low"), Ground(0.5, 3.0, name="high")
    rod = LinearActuator(
        base, angle=0.3, stroke=1.5, speed=0.07, initial_extension=0.4, name="cylinder"
    )
    knee = RRRDyad(rod.output, top, distance1=1.6, distance2=1.9, name="knee")
    ram = RRPDyad(knee, high, low, distance=2.1, name="ram")
    return Linkage([base, top, low, high, rod, knee, ram], name="press")


def pushed_rocker() -> Linkage:
    """From the retracted end, where the end of the actuator is at its anchor."""
    base, pivot = Ground(0.0, 0.0, name="base"), Ground(3.0, 1.0, name="pivot")
    rod = LinearActuator(base, angle=-0.2, stroke=1.2, speed=0.1, name="rod")
    pin = RRRDyad(rod.output, pivot, distance1=2.0, distance2=1.7, name="pin")
    return Linkage([base, pivot, rod, pin], name="rocker")


EXAMPLES: dict[str, tuple[Callable[[], Any], int]] = {
    "server four-bar": (server_four_bar, 62),
    "server Chebyshev": (server_chebyshev, 10),
    "server crank-slider": (server_crank_slider, 62),
    "server pantograph": (server_pantograph, 62),
    "fourbar_linkage": (documented_four_bar, 7),
    "fourbar_from_lengths_demo": (
        lambda: fourbar_from_lengths(1.0, 3.5, 3.0, 4.0, initial_crank_angle=math.pi / 4),
        100,
    ),
    "inverted_stroke_engine": (stroke_engine, 62),
    "strider": (strider, 100),
    "mechanism.fourbar": (lambda: fourbar(1.0, 3.0, 3.0, 4.0, initial_angle=0.5), 100),
    "mechanism.slider_crank": (lambda: slider_crank(1.0, 3.0, initial_angle=0.3), 100),
    "arc crank with an arm": (arc_crank_with_arm, 13),
    "moving guides": (moving_guides, 20),
    "linear actuator": (toggle_press, 60),
    "linear actuator at its retracted end": (pushed_rocker, 30),
}


def gear_of(linkage: Any, folder: Path, **how: Any) -> Any:
    """The gear of a linkage, through its file."""
    file = folder / "gear.toml"
    file.write_text(tomli_w.dumps(short_form(short_form_of(linkage, **LIMITS | how)).values))
    return load_gear(file)


def parts_of(linkage: Any) -> list[tuple[str, Any]]:
    if isinstance(linkage, Linkage):
        return [(part.name, part) for part in linkage.components]
    return [(joint.id, joint) for joint in linkage.joints]


def driven(linkage: Any) -> Callable[[], float]:
    """The angle of their crank, from its two points, or the extension of their actuator."""
    if isinstance(linkage, Linkage):
        for part in linkage.components:
            if isinstance(part, LinearActuator):
                return lambda: part.extension
        crank = next(p for p in linkage.components if isinstance(p, Crank | ArcCrank))
        pivot, tip = crank.anchor, crank
    else:
        driver = next(x for x in linkage.links if hasattr(x, "motor_joint"))
        pivot, tip = driver.motor_joint, driver.output_joint
    return lambda: math.atan2(tip.y - pivot.y, tip.x - pivot.x)


def largest_distance(linkage: Any, steps: int, gear: Any) -> float:
    angle = driven(linkage)
    start, kernel = angle(), gear.model.kernel
    largest = 0.0
    for _ in linkage.step(iterations=steps):
        places = kernel.positions(angle() - start, kernel.no_clearance())
        for name, part in parts_of(linkage):
            if name in places:
                largest = max(largest, math.dist(part.position, map(float, places[name])))
    return largest


@pytest.mark.parametrize("name", EXAMPLES)
def test_every_point_of_an_example_is_where_pylinkage_puts_it(name: str, tmp_path: Path) -> None:
    make, steps = EXAMPLES[name]
    linkage = make()
    gear = gear_of(linkage, tmp_path, travel_deg=(-1.0, 0.0))
    assert len(gear.reference.mechanism.points) >= 2
    assert largest_distance(linkage, steps, gear) < 1e-9


def test_every_pin_and_every_point_on_guides_that_move_is_a_joint() -> None:
    found = short_form_of(moving_guides(), **LIMITS)
    assert set(found["joints"]) == {"O", "D", "E", "A", "B", "C", "P", "Q"}
    assert found["output"] == {"position_of": "Q"}


def test_a_json_file_gives_the_gear_of_its_mechanism(tmp_path: Path) -> None:
    linkage = server_crank_slider()
    mechanism_to_json(linkage, tmp_path / "theirs.json")
    gear = gear_of(tmp_path / "theirs.json", tmp_path)
    assert largest_distance(linkage, 62, gear) < 1e-9


def test_the_slider_of_the_crank_slider_moves_as_printed(tmp_path: Path) -> None:
    gear = gear_of(server_crank_slider(), tmp_path)
    place = gear.model.kernel.positions(0.1, gear.model.kernel.no_clearance())
    assert float(place["connecting_rod.1"][0]) == pytest.approx(-64.523373, abs=1e-6)


def test_coordinates_in_millimetres_become_inches(tmp_path: Path) -> None:
    gear = gear_of(server_four_bar(), tmp_path, unit=LengthUnit.MILLIMETRE)
    pivot = gear.reference.mechanism.point("ground.O2_rocker.1")
    assert pivot.x == pytest.approx(100 / 25.4)


def test_an_actuator_is_driven_over_its_stroke_from_its_present_extension(tmp_path: Path) -> None:
    assert gear_of(toggle_press(), tmp_path).model.stroke == pytest.approx((-0.4, 1.1))


def test_the_stroke_of_an_actuator_in_millimetres_becomes_inches(tmp_path: Path) -> None:
    gear = gear_of(toggle_press(), tmp_path, unit=LengthUnit.MILLIMETRE)
    assert gear.model.stroke == pytest.approx((-0.4 / 25.4, 1.1 / 25.4))


def test_the_housing_of_an_actuator_is_not_a_joint_and_its_end_is_one() -> None:
    found = short_form_of(toggle_press(), **LIMITS)
    assert set(found["joints"]) == {"cylinder", "knee", "top", "ram"}


def test_the_end_of_an_actuator_is_not_the_output() -> None:
    assert short_form_of(toggle_press(), **LIMITS)["output"] == {"position_of": "ram"}
    assert short_form_of(pushed_rocker(), **LIMITS)["output"] == {"angle_of": "pivot-pin"}


def test_clearance_of_the_end_of_an_actuator_moves_it_as_far(tmp_path: Path) -> None:
    gear = gear_of(toggle_press(), tmp_path)
    kernel = gear.model.kernel
    number = next(j.number for j in gear.joints if j.point == "cylinder")
    links = kernel.no_clearance()
    links[2 * number - 2 : 2 * number] = [3e-3, 4e-3]
    place, rest = (kernel.positions(0.1, v)["cylinder"] for v in (links, kernel.no_clearance()))
    assert [float(a - b) for a, b in zip(place, rest, strict=True)] == pytest.approx([3e-3, 4e-3])


def actuator_file() -> dict[str, Any]:
    """A file with what theirs cannot hold: an actuator that pushes a rocker."""
    joints = [
        {"id": "base", "position": [0, 0], "type": "ground"},
        {"id": "pivot", "position": [3, 1], "type": "ground"},
        {"id": "rod", "position": [0.5, 0], "type": "prismatic", "axis": [1, 0]},
        {"id": "pin", "position": [2, 2]},
    ]
    ram = {"id": "ram", "joints": ["base", "rod"], "type": "linear_actuator", "travel": [-0.2, 0.3]}
    links = [{"id": f"{p}-pin", "joints": [p, "pin"]} for p in ("rod", "pivot")]
    return {"name": "theirs", "joints": joints, "links": [ram, *links]}


def test_a_json_file_may_have_an_actuator_as_a_link_with_its_travel(tmp_path: Path) -> None:
    (tmp_path / "theirs.json").write_text(json.dumps(actuator_file()))
    kernel = gear_of(tmp_path / "theirs.json", tmp_path).model.kernel
    place = kernel.positions(0.25, kernel.no_clearance())["rod"]
    assert [float(v) for v in place] == pytest.approx([0.75, 0.0], abs=1e-15)


def test_an_actuator_of_a_file_without_travel_is_refused() -> None:
    file = actuator_file()
    del file["links"][0]["travel"]
    with pytest.raises(GearFileError, match=r"theirs: links\[1\]\.travel: expected two numbers"):
        short_form_of(file, **LIMITS)


def test_several_inputs_are_refused_by_name() -> None:
    linkage = toggle_press()
    crank = Crank(linkage.components[1], 1.0, name="handle")
    both = Linkage([*linkage.components, crank], name="press")
    words = "one input, instead of cylinder actuator, handle crank"
    with pytest.raises(GearFileError, match=words):
        short_form_of(both, **LIMITS)


def test_an_actuator_that_is_retracting_goes_on_retracting() -> None:
    linkage = toggle_press()
    list(linkage.step(iterations=20))
    rod = linkage.components[4]
    before = rod.extension
    short_form_of(linkage, **LIMITS)
    next(iter(linkage.step(iterations=1)))
    assert rod.extension < before


def test_a_linkage_is_left_as_it_was() -> None:
    linkage = strider()
    before = linkage.get_coords()
    short_form_of(linkage, **LIMITS)
    assert linkage.get_coords() == before


def test_a_flat_position_is_refused_because_it_fits_two_assemblies() -> None:
    a, d = Ground(0.0, 0.0, name="A"), Ground(3.0, 0.0, name="D")
    crank = Crank(anchor=a, radius=1.0, name="B")
    pin = RRRDyad(crank.output, d, 3.0, 1.0, name="C")
    with pytest.raises(GearFileError, match=r"moving\.C.*off the line from B to D"):
        short_form(short_form_of(Linkage([a, d, crank, pin], name="flat"), **LIMITS))


def test_a_part_without_counterpart_is_named() -> None:
    o = Ground(0.0, 0.0, name="O")
    crank = Crank(o, 1.0, name="shaft")
    lift = FunctionProfile(HarmonicMotionLaw(), base_radius=1.0, total_lift=0.5)
    follower = TranslatingCamFollower(crank, lift, o, name="valve")
    words = "valve: a TranslatingCamFollower has no counterpart in a gear, whose parts are rigid"
    with pytest.raises(GearFileError, match=words):
        short_form_of(Linkage([o, crank, follower], name="engine"), **LIMITS)


def test_lines_that_stand_still_meet_in_a_point_on_the_ground() -> None:
    corners = [
        Ground(x, y, name=n) for x, y, n in ((0, 0, "a"), (2, 2, "b"), (0, 2, "c"), (2, 0, "e"))
    ]
    meeting = PPDyad(*corners, name="P")
    crank = Crank(corners[0], 1.0, name="K")
    found = short_form_of(Linkage([*corners, meeting, crank], name="lines"), **LIMITS)
    assert found["ground"]["P"] == pytest.approx([1.0, 1.0])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"links": [{"id": "x", "joints": ["nobody", "A"]}]}, r"links\[1\].joints.*nobody"),
        ({"joints": [{"id": "A", "position": [None, None]}]}, r"joints\[1\].position.*None"),
        (
            {"joints": [{"id": "A", "position": [0, 0], "type": "Static"}]},
            "ground, prismatic, revolute or tracker, found 'Static'",
        ),
        ({"links": []}, "links: expected one driver.* instead of none"),
        ({"joints": 3}, "joints: expected an array of tables, found 3"),
    ],
)
def test_a_bad_file_of_theirs_is_refused_with_key_and_value(
    change: dict[str, Any], words: str, tmp_path: Path
) -> None:
    file = tmp_path / "theirs.json"
    good = {"joints": [{"id": "A", "position": [0, 0]}], "links": []}
    file.write_text(json.dumps(good | change))
    with pytest.raises(GearFileError, match=words) as caught:
        short_form_of(file, **LIMITS)
    assert caught.value.message.startswith("theirs.json")


def test_clearance_of_both_ends_of_a_coupler_that_carries_a_point_moves_the_point(
    tmp_path: Path,
) -> None:
    gear = gear_of(server_chebyshev(), tmp_path)
    moved = gear.model.kernel.positions(0.0, np.full(8, 1e-3).tolist())
    rest = gear.model.kernel.positions(0.0, gear.model.kernel.no_clearance())
    ends = "coupler.0_crank.tip", "coupler.1_rocker.0"
    middle = [sum(float(moved[e][k] - rest[e][k]) for e in ends) / 2 for k in (0, 1)]
    tracked = [float(moved["coupler_midpoint"][k] - rest["coupler_midpoint"][k]) for k in (0, 1)]
    assert tracked == pytest.approx(middle, abs=1e-12)
