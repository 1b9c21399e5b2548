"""The seven lines of a diagnosis, as a person reads them on the terminal and on paper."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from mlg_troubleshoot.decision.columns import AXIAL_FLOAT, BY_NAME, CLEARANCE, COVARIATES
from mlg_troubleshoot.diagnosis import Candidate, Diagnosis, NamedCause
from mlg_troubleshoot.diagnosis.faults import DataFault
from mlg_troubleshoot.reporting.formats import Lengths
from mlg_troubleshoot.reporting.html import environment
from mlg_troubleshoot.units import LengthUnit

_WORDS = ("DATA", "MISFIT", "CAUSE", "MODEL", "GAIN", "LEFT", "DO")
_KINDS = {
    "mm_as_in": "millimetres entered as inches",
    "factor_10": "misplaced decimal point",
    "swapped_joints": "two joints swapped",
    "implausible": "implausible",
    "restored_joint": "joint restored between its reading and the plunger's",
    "other_convention": "the other convention",
}
_CONDITIONS = {
    "rounded": "Rounded values",
    "censored": "Values at an end",
    "blank_not_at_random": "Blanks not at random",
    "copied": "Copied from the inspection before",
    "duplicate": "Written twice",
    "limit_written": "Limits in place of readings",
    "selected": "Selected gears",
    "landings_fall": "Landings that fall",
    "identical_cells": "Identical cells",
}
_VARIABLES = {c.variable: c.said for c in (*COVARIATES, AXIAL_FLOAT)}


# What is less likely than this is not worth a word, and more than so many are not read.
_LEAST_SAID = 0.01
_MOST_SAID = 3


@dataclass(frozen=True, slots=True)
class DiagnosisLine:
    """One of the seven lines: its number, what it is about in one word, and what it says."""

    number: int
    word: str
    text: str


def kind_words(kind: str) -> str:
    return _KINDS.get(kind, kind.replace("_", " "))


def condition_words(kind: str) -> str:
    return _CONDITIONS[kind]


def column_words(name: str) -> str:
    kind, _, joint = name.rpartition("_")
    if joint.isdigit() and kind in (CLEARANCE.name, AXIAL_FLOAT.name):
        return f"{BY_NAME[kind].said} of joint {joint}"
    if name == "predicted":
        return "predicted displacement"
    return _VARIABLES.get(name, name.replace("_", " "))


def chance_words(chance: float) -> str:
    """Write a probability in percent, as far as it means something."""
    if chance < 0.0005:
        return "< 0.1 %"
    if chance > 0.9995:
        return "> 99.9 %"
    return (
        f"{100.0 * chance:.1f} %"
        if min(chance, 1.0 - chance) < 0.0995
        else f"{chance:.0%}".replace("%", " %")
    )


def name_words(cause: str) -> str:
    """Name a cause as a person would: its identifier is for files."""
    return cause.replace("_", " ")


def target_words(candidate: Candidate) -> str:
    """Name a cause with its target."""
    return " ".join(filter(None, (name_words(candidate.cause.name), candidate.target)))


def cause_words(cause: NamedCause) -> str:
    candidate = cause.candidate
    words = candidate.cause.words(candidate.target)
    if not candidate.stands_in:
        return words
    needed = " and ".join(map(column_words, candidate.cause.needs)) or "every joint as read"
    return f"{words} (not testable without {needed})"


def seven_lines(d: Diagnosis, unit: LengthUnit = LengthUnit.THOU) -> tuple[DiagnosisLine, ...]:
    """Say what a diagnosis found: data, misfit, cause, model, gain, residual, what to do."""
    # Blanks of every kind break a line of the terminal, and long words where they must.
    texts = [" ".join(text.split()) for text in _said(d, unit, *_WORDS)]
    return tuple(
        DiagnosisLine(k, word, text)
        for k, (word, text) in enumerate(zip(_WORDS, texts, strict=True), 1)
    )


def headline(d: Diagnosis, unit: LengthUnit) -> str:
    """Say the verdict of a diagnosis in one or two sentences."""
    return next(_said(d, unit, "HEADLINE")).strip()


def _said(d: Diagnosis, unit: LengthUnit, *parts: str) -> Iterator[str]:
    words = {
        "kind_words": kind_words,
        "fitted_numbers": fitted_numbers,
    }
    context = {
        **words,
        "d": d,
        "by_slip": by_slip,
        "likeliest": likeliest(d),
        "lengths": Lengths(unit),
    }
    said = environment().get_template("diagnosis.txt.j2").make_module(context)
    return (str(getattr(said, part)).replace("\u200b", "") for part in parts)


def likeliest(d: Diagnosis) -> list[tuple[str, float]]:
    """What may be wrong and is not said already, likeliest first, each with its probability."""
    said = {c.candidate.key for c in (*d.causes, *d.also_possible, *d.beside)}
    found = [
        (f"{name_words(cause)}{f' {target}' if target else ''}", chance)
        for (cause, target), chance in d.probabilities.items()
        if (cause, target) not in said and chance >= _LEAST_SAID
    ]
    return found[:_MOST_SAID]


def by_slip(faults: Sequence[DataFault]) -> list[list[DataFault]]:
    """Gather the cells of one entry error in a row."""
    slips: dict[tuple[int, str], list[DataFault]] = {}
    for fault in faults:
        slips.setdefault((fault.row, fault.kind), []).append(fault)
    return list(slips.values())


def fitted_numbers(d: Diagnosis, lengths: Lengths) -> tuple[str, ...]:
    """Write the fitted parameters of the named causes with their intervals, lengths in the reader's
    unit.
    """
    parts = []
    for c in d.causes:
        for name, value in c.parameters.items():
            words, _, per = name.partition("_in_per_")
            is_length = name.endswith("_in") and not isinstance(value, str)

            def said(number: float, is_length: bool = is_length) -> str:
                return lengths.bare(number, fine=1) if is_length else f"{number:.4g}"

            interval = c.interval_shown.get(name)
            band = "" if interval is None else f" (95 % {said(interval[0])} to {said(interval[1])})"
            unit = f" {lengths.unit}" if is_length else f" in per {per}" if per else ""
            shown = value if isinstance(value, str) else said(value) + unit
            parts.append(f"{name_words(words.removesuffix('_in'))} {shown}{band}")
    return tuple(parts)


environment().filters.update(
    chance_words=chance_words,
    name_words=name_words,
    cause_words=cause_words,
    target_words=target_words,
    column_words=column_words,
    condition_words=condition_words,
)
