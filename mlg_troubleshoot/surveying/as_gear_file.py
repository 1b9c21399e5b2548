"""A survey as the values of a gear file and of its ensemble, and the assemblies that it allows."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from typing import Any

import numpy as np

from mlg_troubleshoot.gear.design import member_values
from mlg_troubleshoot.gear.gear_file import with_changes
from mlg_troubleshoot.geometry.mechanism import Dyad, Slider
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
    linkage = found.linkage
    mode = found.modes[0]
    new = member_values(linkage.linkage(np.round(mode.vector, _DECIMALS), "A"))
    values = with_changes(deepcopy(dict(before)), new)
    deviations = np.std(found.draws, axis=0)
    spread = dict(zip(linkage.names, deviations, strict=True))
    sources = values["sources"]

    def source_of(what: str, *parts: tuple[str, str, float, str]) -> str:
        known = [
            f"{label} ± {spread[name] * scale:.2g} {unit}"
            for name, label, scale, unit in parts
            if name in spread
        ]
        text = (
            f"Survey {source}: {what}, standard uncertainty"
            f" {', '.join(known) or 'none: held in place'}."
        )
        key = f"survey_{len(sources)}"
        sources[key] = {"kind": "measured", "text": text}
        return key

    turned = float(np.degrees(1.0))
    stroke = ("extension", "extension", 1.0, linkage.driven_in)
    values["input"]["source"] = source_of("actuator extension", stroke)
    for name, plane in values.get("planes", {}).items():
        parts = (
            (f"{name}.direction", "hinge", turned, "°"),
            (f"{name}.dihedral", "dihedral", turned, "°"),
        )
        plane["source"] = source_of(f"plane {name}", *parts)
    for point in linkage.space.mechanism.points:
        name = point.name
        own = values.get("planes", {}).get(point.plane, values).setdefault("source_of", {})
        axes = [(f"{name}.{axis}", axis, 1.0, "in") for axis in ("x", "y", "r")]
        guide = (f"{name}.axis", "axis", turned, "°")
        own[name] = source_of(f"point {name}", *axes, guide)
    if linkage.travel is not None:
        calibration = values["calibration"]
        old = sources[calibration.get("source", values["source"])]["text"]
        calibration["travel"] = float(round(mode.vector[-1], _DECIMALS))
        calibration["source"] = source_of(
            f"travel; the rest as before: {old}", ("travel", "travel", 1.0, "in")
        )
    return values


def assemblies(found: Survey) -> tuple[str, ...]:
    """Both assemblies, or both shapes of one assembly, where the survey allows two."""
    steps = [s for s in found.linkage.space.mechanism.steps if isinstance(s, (Dyad, Slider))]
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
