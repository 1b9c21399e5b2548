"""A survey as the values of a gear file and of its ensemble, and the assemblies that it allows."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from typing import Any

import numpy as np

from mlg_troubleshoot.gear.design import member_values
from mlg_troubleshoot.surveying.survey import Survey
from mlg_troubleshoot.units import Length, Sentence

# Further members of the ensemble of a surveyed gear file: their range holds most of the posterior.
_MEMBERS = 11
# Decimals of a length in a gear file: a thousandth of what the best gauge reads. [1]
_DECIMALS = 6
# A second assembly with less than this share of the posterior is not worth naming. [1]
_WORTH_NAMING = 0.02


def surveyed_members(found: Survey) -> dict[str, Any]:
    """Draws of the posterior as members of an ensemble file."""
    return {
        f"S{k}": member_values(found.linkage.linkage(np.round(v, _DECIMALS), f"S{k}"))
        for k, v in enumerate(found.draws[:_MEMBERS], start=1)
    }


def surveyed_values(before: Mapping[str, Any], found: Survey, source: str) -> dict[str, Any]:
    """The values of a gear file with the surveyed numbers in them, each with a source that says its
    uncertainty.
    """
    values = deepcopy(dict(before))
    linkage = found.linkage
    mode = found.modes[0]
    new = member_values(linkage.linkage(np.round(mode.vector, _DECIMALS), "A"))
    deviations = np.std(found.draws, axis=0)
    spread = dict(zip(linkage.names, deviations, strict=True))
    sources = values["sources"]

    def put(
        entry: dict[str, Any],
        numbers: dict[str, Any],
        what: str,
        *parts: tuple[str, str, float, str],
    ) -> None:
        entry.update(numbers)
        known = [
            f"{label} ± {spread[name] * scale:.2g} {unit}"
            for name, label, scale, unit in parts
            if name in spread
        ]
        text = (
            f"Survey {source}: {what}, standard uncertainty"
            f" {', '.join(known) or 'none: held in place'}."
        )
        entry["source"] = f"survey_{len(sources)}"
        sources[entry["source"]] = {"kind": "measured", "text": text}

    turned = float(np.degrees(1.0))
    stroke = {"range": new["range"], "reference": new["reference"]}
    put(
        values["input"],
        stroke,
        "actuator extension",
        ("extension", "extension", 1.0, linkage.driven_in),
    )
    for plane in values["planes"]:
        if plane["name"] in new.get("planes", {}):
            name = plane["name"]
            parts = (
                (f"{name}.direction", "hinge", turned, "°"),
                (f"{name}.dihedral", "dihedral", turned, "°"),
            )
            put(plane, new["planes"][name], f"plane {name}", *parts)
    for point in values["points"]:
        name = point["name"]
        axes = [(f"{name}.{axis}", axis, 1.0, "in") for axis in ("x", "y", "r")]
        put(point, {"at": new["points"][name]}, f"point {name}", *axes)
    for step in values["steps"]:
        step.update(new["steps"].get(step["joint"], {}))
        if "axis_deg" in step:
            put(
                step, {}, f"axis of {step['joint']}", (f"{step['joint']}.axis", "axis", turned, "°")
            )
    if linkage.travel is not None:
        old = sources[values["calibration"]["source"]]["text"]
        travel = {"travel": float(round(mode.vector[-1], _DECIMALS))}
        put(
            values["calibration"],
            travel,
            f"travel; the rest as before: {old}",
            ("travel", "travel", 1.0, "in"),
        )
    return values


def assemblies(found: Survey) -> tuple[str, ...]:
    """Both assemblies, or both shapes of one assembly, where the survey allows two."""
    steps = [s for s in found.linkage.space.mechanism.steps if hasattr(s, "sign")]
    modes = [mode for mode in found.modes if mode.weight >= _WORTH_NAMING]
    places = [
        f"joint {s.joint} on the {{}} of the line between its links' other ends" for s in steps
    ]
    places += ["the rest on the {} of the crank"] * (len(found.modes[0].sides) - len(steps))
    shares: dict[str, float] = {}
    for mode in modes:
        parts = [
            place.format("left" if mode.sides[i] > 0 else "right")
            for i, place in enumerate(places)
            if len({m.sides[i] for m in modes}) > 1
        ]
        if len({m.sides for m in modes}) == 1:
            moved = np.abs(mode.vector - modes[0].vector)
            moved[found.linkage.angles] = 0.0
            farthest = int(np.argmax(moved))
            name = found.linkage.names[farthest].split(".")[0]
            parts = [
                (
                    Sentence.of(
                        "one with point {} elsewhere by {}", name, Length(float(moved.max()))
                    )
                    if moved.any()
                    else "as written"
                )
            ]
        text = Sentence.joined(parts, ", ")
        shares[text] = shares.get(text, 0.0) + mode.weight
    if len(shares) < 2:
        return ()
    each = (Sentence.of("{} ({} %)", text, f"{100 * share:.0f}") for text, share in shares.items())
    texts = Sentence.joined(each, "; ")
    return (Sentence.of("the survey allows {} assemblies: {}", len(shares), texts),)
