"""``mlg gear``: which model is in use, and whether it still gives the printed numbers."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import asdict

import typer
from rich.table import Table
from rich.text import Text

from mlg_troubleshoot import workflows
from mlg_troubleshoot.cli import output
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear


def show(name: str, *, as_json: bool) -> None:
    """Show the gear: identity, provenance, joints, coordinates, retraction cycle.

    Parameters
    ----------
    name : str
        Shipped gear or gear file.
    as_json : bool
        Write JSON instead.
    """
    gear = load_gear(name)
    if as_json:
        output.write(json.dumps(_as_json(gear), indent=1))
        return
    console = output.console()
    console.print(Text(f"{gear.name} ({gear.id})", style="bold"))
    console.print(Text(f"Geometry: {gear.provenance}. File {gear.path.name}, hash {gear.geometry_sha256[:12]}."))
    kinds = Counter(str(number.kind) for number in gear.numbers)
    listed = ", ".join(f"{count} {kind}" for kind, count in kinds.most_common())
    console.print(Text(f"Numbers behind a prediction: {listed}. Linkages in the ensemble: {len(gear.ensemble)}."))
    console.print(
        Text(
            f"Margin {gear.margin.value:g} in ({gear.margin.kind}) · release stroke {gear.reference.stroke[1]:g} in · "
            f"calibration rate {gear.model.rate:.5f}"
        )
    )
    joints = Table(box=None, pad_edge=False, header_style="bold")
    for heading in ("#", "joint", "where", "limit in", "acts like", "mid-position x, y in"):
        joints.add_column(heading, justify="right" if heading in {"#", "limit in"} else "left")
    for joint in gear.joints:
        point = gear.reference.mechanism.point(joint.point)
        alike = ", ".join(f"#{n}" for n in gear.alike[joint.number]) or "-"
        joints.add_row(
            str(joint.number),
            joint.name,
            joint.location,
            f"{joint.limit.value:.4f}",
            alike,
            f"{point.x:.3f}, {point.y:.3f}",
        )
    console.print(joints)
    if gear.cycle is not None:
        cycle = Table(box=None, pad_edge=False, header_style="bold", title="Reversing valve", title_justify="left")
        for heading in ("plunger", "oil flow", "stage", "what follows"):
            cycle.add_column(heading)
        for state in gear.cycle.valve:
            cycle.add_row(state.plunger, state.flow, state.stage, state.result)
        console.print(cycle)
        console.print(Text(f"{gear.cycle.source}; what it does not state is shown as not stated."))


def _as_json(gear: Gear) -> dict[str, object]:
    return {
        "id": gear.id,
        "name": gear.name,
        "provenance": gear.provenance,
        "geometry_sha256": gear.geometry_sha256,
        "ensemble": [linkage.name for linkage in gear.ensemble],
        "calibration_rate": gear.model.rate,
        "margin": asdict(gear.margin),
        "release_stroke_in": gear.reference.stroke[1],
        "joints": [
            {
                "joint": joint.number,
                "name": joint.name,
                "location": joint.location,
                "limit": asdict(joint.limit),
                "new_part": asdict(joint.new_part),
                "access": asdict(joint.access),
                "area": joint.area,
                "critical": joint.critical,
                "acts_like": list(gear.alike[joint.number]),
            }
            for joint in gear.joints
        ],
        "points": {
            point.name: {"plane": point.plane, "at_in": [point.x, point.y], "fixed": point.fixed}
            for point in gear.reference.mechanism.points
        },
        "numbers": [asdict(number) for number in gear.numbers],
    }


def verify(name: str, *, as_json: bool) -> None:
    """Print every printed number beside the computed one; exit 1 if one that should hold does not.

    Parameters
    ----------
    name : str
        Shipped gear or gear file.
    as_json : bool
        Write JSON instead.
    """
    gear = load_gear(name)
    numbers = workflows.verify_gear(name)
    failed = [n for n in numbers if n.should_hold and not n.holds]
    if as_json:
        output.write(json.dumps({"gear": gear.id, "numbers": [asdict(n) for n in numbers]}, indent=1))
    else:
        console = output.console()
        console.print(Text(f"{gear.name}: geometry {gear.provenance}", style="bold"))
        table = Table(box=None, pad_edge=False, header_style="bold")
        table.add_column("what the paper prints (section)")
        table.add_column("printed", justify="right", max_width=14 if console.width < 100 else 26)
        table.add_column("model", justify="right")
        table.add_column("status", no_wrap=True)
        for n in numbers:
            mark = "" if n.holds else (": DOES NOT HOLD" if n.should_hold else ", known")
            style = "bold red" if n in failed else ""
            table.add_row(
                f"{n.quantity} ({n.section})",
                n.printed,
                f"{n.computed:.4g} {n.unit}".strip(),
                n.status + mark,
                style=style,
            )
        console.print(table)
        verdict = "all that should hold hold" if not failed else f"{len(failed)} that should hold do not"
        console.print(Text(f"{len(numbers)} numbers: {verdict}."))
    raise typer.Exit(1 if failed else 0)
