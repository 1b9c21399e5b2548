"""A linkage of pylinkage (1.3) as a short form: its mechanism, its `simulation.Linkage`, its JSON.

Their file has positions and no lengths, units or assembly branch: all follow from the positions. A
tracker, or a fixed dyad, keeps its distance along a direction that two points set: it belongs to
the link that both points are on, else it is an arm that a pin turns, as a slot does.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal

import msgspec

from mlg_troubleshoot.datafile import DataFile, Name, Pair, Table, decode, read_json
from mlg_troubleshoot.errors import GearFileError
from mlg_troubleshoot.gear.gear import SourceKind
from mlg_troubleshoot.units import LengthUnit

_ONE_DRIVER = "Keep the one that moves the output and replace the others by points on the ground."
_NO_COUNTERPART = "Replace it by a crank, a linear actuator, links between pins, or a guide."


class TheirJoint(Table, forbid_unknown_fields=False):
    """A joint of their file; what is not needed is not read. lines: that it slides on and that
    move, which their file cannot hold.
    """

    id: Name
    position: Pair
    type: Literal["ground", "revolute", "prismatic", "tracker"] = "revolute"
    axis: Pair = (1.0, 0.0)
    lines: tuple[tuple[str, str], ...] = ()
    ref_joint1_id: str = ""
    ref_joint2_id: str = ""


class TheirLink(Table, forbid_unknown_fields=False):
    """A link of their file; a driver turns about its motor joint.

    travel: of a linear actuator, which their file cannot hold, from the present position. Its
    moving end is a prismatic joint.
    """

    id: Name
    joints: tuple[str, ...]
    type: Literal["ground", "driver", "arc_driver", "linear_actuator", "link"] = "link"
    motor_joint: str | None = None
    travel: Pair | None = None


class TheirMechanism(Table, forbid_unknown_fields=False):
    """A mechanism as `pylinkage.mechanism.mechanism_to_json` writes it."""

    joints: tuple[TheirJoint, ...]
    links: tuple[TheirLink, ...]
    name: str = ""


def short_form_of(
    linkage: Any,
    *,
    limit: float,
    margin: float,
    travel_deg: tuple[float, float] = (-10.0, 0.0),
    output: Mapping[str, str] | None = None,
    unit: LengthUnit = LengthUnit.INCH,
) -> dict[str, Any]:
    """Return the short form of a linkage of pylinkage, of the values of its file, or of the file.

    limit, margin: of all joints, and of the output. [in, in or rad]
    travel_deg: the crank, from its present position; an actuator has its stroke. [deg]
    output: as in a short form; else the last guide, or the last link on the ground.
    unit: of their coordinates, which have none.
    """
    file = _read(linkage)
    theirs = _Theirs(file)
    inches = unit.per_inch
    driver = theirs.driver()
    drive = {"crank": driver.id, "travel": list(travel_deg)}
    if driver.travel is not None:
        drive = {"actuator": driver.id, "travel": [end / inches for end in driver.travel]}
    return {
        "name": theirs.mechanism.name[:40] or "linkage",
        "source": {"kind": str(SourceKind.ASSUMED), "text": "Positions of a pylinkage linkage."},
        "ground": {p: [c / inches for c in theirs.places[p]] for p in theirs.ground},
        "moving": {
            p: [c / inches for c in at] for p, at in theirs.places.items() if p not in theirs.ground
        },
        "links": theirs.links,
        "guides_deg": theirs.guides,
        "guides": theirs.lines,
        "slots": theirs.slots,
        "input": drive,
        "output": dict(output or theirs.output()),
        "joints": dict.fromkeys(theirs.pins(), limit),
        "margin": margin,
    }


def _read(linkage: Any) -> DataFile[TheirMechanism]:
    if isinstance(linkage, str | Path):
        return read_json(Path(linkage), TheirMechanism, "Give the JSON file of a mechanism.")
    values = linkage
    if hasattr(linkage, "components"):
        values = _of_components(linkage)
    elif hasattr(linkage, "joints"):
        from pylinkage.mechanism.serialization import mechanism_to_dict

        values = mechanism_to_dict(linkage)
    path = Path(str(values.get("name") or "linkage"))
    values = msgspec.to_builtins(values)
    return DataFile(path, values, decode(path, values, TheirMechanism))


class _Theirs:
    """Their joints and links as points, rigid links, guides and arms."""

    def __init__(self, file: DataFile[TheirMechanism]) -> None:
        self.file = file
        self.mechanism = m = file.content
        self.places = {joint.id: joint.position for joint in m.joints}
        self.guides: dict[str, float] = {}
        self.lines = {joint.id: joint.lines for joint in m.joints if joint.lines}
        self.slots: dict[str, str] = {}
        self.links: dict[str, list[str]] = {}
        for i, link in enumerate(m.links):
            for k, end in enumerate(link.joints):
                if end not in self.places:
                    place = ("links", i, "joints", k)
                    raise file.fail(place, f"one of the joints {', '.join(self.places)}")
        fixed = [j.id for j in m.joints if j.type == "ground"]
        fixed += [j for link in m.links if link.type == "ground" for j in link.joints]
        fixed += [link.motor_joint for link in m.links if link.motor_joint in self.places]
        self.ground = list(dict.fromkeys(fixed))
        for link in m.links:
            self._add_link(link)
        for index, joint in enumerate(m.joints):
            if joint.type == "prismatic":
                x, y = joint.axis
                self.guides[joint.id] = math.degrees(math.atan2(y, x))
            if joint.type == "tracker":
                self._add_tracker(joint, index)

    def _add_link(self, link: TheirLink) -> None:
        ends = list(dict.fromkeys(link.joints))
        moving = [p for p in ends if p not in self.ground]
        still = [p for p in ends if p in self.ground]
        if link.type == "link" and len(still) == 2 and len(moving) == 1:
            # Their guide of a dyad RRP: two points on the ground and what slides between them.
            first, second = (complex(*self.places[p]) for p in still)
            along = second - first
            angle = math.atan2(along.imag, along.real)
            self.guides[moving[0]] = math.degrees(angle)
        elif moving and link.type != "ground":
            self.links[link.id] = ends

    def _add_tracker(self, joint: TheirJoint, index: int) -> None:
        ends = [joint.ref_joint1_id, joint.ref_joint2_id]
        for key, end in zip(("ref_joint1_id", "ref_joint2_id"), ends, strict=True):
            if end not in self.places:
                raise self.file.fail(("joints", index, key), "the id of another joint")
        body = next((link for link, on in self.links.items() if set(ends) <= set(on)), None)
        if set(ends) <= set(self.ground):
            self.ground.append(joint.id)
        elif body is not None:
            self.links[body].append(joint.id)
        else:
            arm = f"arm of {joint.id}"
            self.links[arm] = [ends[0], joint.id]
            self.slots[arm] = ends[1]

    def driver(self) -> TheirLink:
        drivers = [x for x in self.mechanism.links if x.type not in ("ground", "link")]
        if len(drivers) != 1:
            named = ", ".join(link.id for link in drivers) or "none"
            expected = f"one driver, because a gear has one input, instead of {named}"
            raise GearFileError(f"{self.file.path.name}: links: expected {expected}", _ONE_DRIVER)
        (driver,) = drivers
        if (driver.type == "linear_actuator") != (driver.travel is not None):
            place = ("links", self.mechanism.links.index(driver), "travel")
            raise self.file.fail(place, "two numbers, of a linear_actuator only")
        return driver

    def output(self) -> dict[str, str]:
        driver = self.driver()
        guided = [p for p in (*self.lines, *self.guides) if p not in driver.joints]
        if guided:
            return {"position_of": guided[-1]}
        others = [link for link in self.links if link != driver.id]
        on_ground = [x for x in others if set(self.links[x]) & set(self.ground)]
        return {"angle_of": [*(others or self.links), *on_ground][-1]}

    def pins(self) -> list[str]:
        """Points where one link turns on another or on the ground, or slides."""
        driver = self.driver()
        # The housing of an actuator is fixed to the ground.
        fixed = driver.id if driver.travel else None
        turning = [ends for link, ends in self.links.items() if link != fixed]
        on = {p: sum(p in ends for ends in turning) for p in self.places}
        on_lines = {p: len(own) for p, own in self.lines.items()}
        slides = dict.fromkeys(self.guides, 1) | on_lines
        arms = {self.links[arm][1] for arm in self.slots}
        return [
            p
            for p in self.places
            if on[p] + slides.get(p, 0) + (p in self.ground) > 1 and p not in arms
        ]


def _of_components(linkage: Any) -> dict[str, Any]:
    """A `simulation.Linkage` in the form of their file, where its own dimensions put its points."""
    linkage = copy.deepcopy(linkage)
    next(iter(linkage.step(iterations=1, dt=0)))
    places = linkage.get_coords()
    joints: list[dict[str, Any]] = []
    links: list[dict[str, Any]] = []
    for part, place in zip(linkage.components, places, strict=True):
        joint = {"id": part.name, "position": list(place)}
        joints.append(joint)
        match type(part).__name__:
            case "Ground":
                joint["type"] = "ground"
            case "Crank" | "ArcCrank":
                (pivot,) = _names([part.anchor])
                link = {"id": f"{part.name} crank", "joints": [pivot, part.name]}
                links.append(link | {"type": "driver", "motor_joint": pivot})
            case "LinearActuator":
                (base,) = _names([part.anchor])
                axis = [math.cos(part.angle), math.sin(part.angle)]
                joint |= {"type": "prismatic", "axis": axis}
                travel = [-part.extension, part.stroke - part.extension]
                link = {"id": f"{part.name} actuator", "joints": [base, part.name]}
                links.append(link | {"type": "linear_actuator", "travel": travel})
            case "RRRDyad":
                ends = _names([part.anchor1, part.anchor2])
                links += [{"id": f"{p}-{part.name}", "joints": [p, part.name]} for p in ends]
            case "RRPDyad" if _stand_still(part.line_anchor1, part.line_anchor2):
                (end,) = _names([part.revolute_anchor])
                a = part.line_anchor1
                b = part.line_anchor2
                axis = [b.x - a.x, b.y - a.y]
                joint |= {"type": "prismatic", "axis": axis}
                links.append({"id": f"{end}-{part.name}", "joints": [end, part.name]})
            case "RRPDyad":
                (end,) = _names([part.revolute_anchor])
                joint["lines"] = [_names([part.line_anchor1, part.line_anchor2])]
                links.append({"id": f"{end}-{part.name}", "joints": [end, part.name]})
            case "PPDyad" if _stand_still(*part.anchors):
                joint["type"] = "ground"
            case "PPDyad":
                first, second, third, fourth = _names(part.anchors)
                joint["lines"] = [[first, second], [third, fourth]]
            case "FixedDyad" | "PointTracker":
                first, second = _names([part.anchor1, part.anchor2])
                joint |= {"type": "tracker", "ref_joint1_id": first, "ref_joint2_id": second}
            case kind:
                raise GearFileError(
                    f"{linkage.name}: {part.name}: a {kind} has no counterpart in a gear, whose"
                    " parts are rigid links, guides and one input",
                    _NO_COUNTERPART,
                )
    return {"name": str(linkage.name), "joints": joints, "links": links}


def _parent(anchor: Any) -> Any:
    """The component of an anchor, which may stand for a crank's output."""
    return getattr(anchor, "_parent", anchor)


def _names(anchors: Iterable[Any]) -> list[str]:
    return [str(_parent(anchor).name) for anchor in anchors]


def _stand_still(*anchors: Any) -> bool:
    return all(type(_parent(anchor)).__name__ == "Ground" for anchor in anchors)
