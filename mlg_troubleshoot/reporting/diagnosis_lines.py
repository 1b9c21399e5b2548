"""The seven lines of a diagnosis, as a person reads them on the terminal and on paper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mlg_troubleshoot.diagnosis import Diagnosis, NamedCause
from mlg_troubleshoot.diagnosis.faults import DataFault
from mlg_troubleshoot.reporting.formats import Lengths
from mlg_troubleshoot.units import LengthUnit

NOISE_ABOVE = 0.05
_SHOWN = 8
_CELLS = 2
_KINDS = {
    "mm_as_in": "millimetres entered as inches",
    "factor_10": "decimal point slipped",
    "swapped_joints": "two joints swapped",
    "swapped_side": "left and right swapped",
    "implausible": "implausible",
    "other_convention": "the other convention",
}
_COLUMNS = {
    "temperature_c": "temperature",
    "hydraulic_pressure_psi": "hydraulic pressure",
    "gear_landings": "landings since overhaul",
    "predicted": "predicted displacement",
    "day": "date",
    "tail_no": "tail",
    "gauge_id": "gauge",
    "technician_id": "technician",
    "axial_float": "end float",
}


@dataclass(frozen=True, slots=True)
class Line:
    """One of the seven lines: its number, what it is about in one word, and what it says."""

    number: int
    word: str
    text: str


def kind_words(kind: str) -> str:
    return _KINDS.get(kind, kind.replace("_", " "))


def column_words(name: str) -> str:
    kind, _, joint = name.rpartition("_")
    if joint.isdigit() and kind in {"clearance", "axial_float"}:
        return f"{'clearance' if kind == 'clearance' else 'end float'} of joint {joint}"
    return _COLUMNS.get(name, name.replace("_", " "))


def chance_words(chance: float, permutations: int) -> str:
    """Write a chance as far as the data sets drawn with nothing wrong can tell it."""
    least = 1.0 / (permutations + 1)
    return f"{chance:.2g}" if chance > 1.001 * least else f"≤ {least:.2g}"


def name_words(cause: str) -> str:
    """Name a cause as a person would: its identifier is for files."""
    return cause.replace("_", " ")


def cause_words(cause: NamedCause) -> str:
    candidate = cause.candidate
    words = candidate.cause.words(candidate.target)
    if cause.aliases:
        others = " or ".join(name_words(other.cause.name) for other in cause.aliases)
        words += f" (these rows cannot tell it from {others})"
    if not candidate.stands_in:
        return words
    return f"{words} (not testable without {' and '.join(map(column_words, candidate.cause.needs))})"


def seven_lines(d: Diagnosis, unit: LengthUnit = LengthUnit.THOU) -> tuple[Line, ...]:
    """Say what a diagnosis found: data, misfit, cause, model, gain, what is left, what to do."""
    lengths = Lengths(unit)
    said = {
        "DATA": _data(d),
        "MISFIT": _misfit(d, lengths),
        "CAUSE": _cause(d, lengths),
        "MODEL": _model(d, lengths),
        "GAIN": _gain(d, lengths),
        "LEFT": _left(d, lengths),
        "DO": what_to_do(d),
    }
    return tuple(Line(k, word, text) for k, (word, text) in enumerate(said.items(), 1))


def _data(d: Diagnosis) -> str:
    untested = ", ".join(f"{name_words(cause)} (no {column_words(column)})" for cause, column in d.not_testable)
    parts = [f"{d.rows_read} rows, {d.rows_used} used."]
    parts.append(
        f"Most likely wrong: {_slips(d.faults)}. Repaired in this analysis only."
        if d.faults
        else "No data fault found."
    )
    if d.corrected:
        parts.append(f"Used otherwise than entered, in this analysis only: {_slips(d.corrected)}.")
    if untested:
        parts.append(f"NOT TESTABLE: {untested}.")
    return " ".join(parts)


def _slips(faults: Sequence[DataFault]) -> str:
    """The first slips of the pen, and how many more there are."""
    slips: dict[tuple[int, str], list[DataFault]] = {}
    for fault in faults:
        slips.setdefault((fault.row, fault.kind), []).append(fault)
    more = f" and {len(slips) - _SHOWN} more" if len(slips) > _SHOWN else ""
    return "; ".join(_slip(cells) for cells in list(slips.values())[:_SHOWN]) + more


def _slip(cells: Sequence[DataFault]) -> str:
    """One slip of the pen, which may be in several cells of a row."""
    changes = ", ".join(
        f"{f.column} {f.value} → {'not used' if f.suggested is None else f.suggested}" for f in cells[:_CELLS]
    )
    more = f" and {len(cells) - _CELLS} more" if len(cells) > _CELLS else ""
    return f"row {cells[0].row}, {kind_words(cells[0].kind)} ({changes}{more})"


def _misfit(d: Diagnosis, lengths: Lengths) -> str:
    gauge = (
        "repeatability unknown"
        if d.repeatability_in is None
        else f"one reading repeats to {_plain(lengths, d.repeatability_in)} ({d.repeatability_source})"
    )
    return (
        f"measured − predicted: mean {lengths.bare(d.mean_in, signed=True)}, rms {_plain(lengths, d.rms_in)}; {gauge}."
        f"{_unread(d, lengths)}"
    )


def _unread(d: Diagnosis, lengths: Lengths) -> str:
    """What joints that nobody read add, and what can no longer be tested because of them."""
    if not d.unread:
        return ""
    joints = ", ".join(f"#{joint}" for joint in d.unread)
    return (
        f" Nobody read {joints}: they count as worn like the others of their gear, {lengths.bare(d.unread_in)} ± "
        f"{_plain(lengths, d.unread_u_in)} of the prediction; their own causes cannot be tested."
    )


def _plain(lengths: Lengths, value_in: float, fine: int = 0) -> str:
    """A length for a line of the terminal, which breaks where it must."""
    return lengths.full(value_in, fine=fine).replace("\u00a0", " ")


def _cause(d: Diagnosis, lengths: Lengths) -> str:
    if d.verdict == "NONE":
        return (
            "NONE: nothing stands out beyond chance. "
            f"An effect of {_plain(lengths, d.smallest_rms_in)} rms would have been found 4 times in 5."
        )
    if d.verdict == "UNLISTED":
        return (
            f"UNLISTED: real, but not on the list; it moves with {_variables(d, ' × ')}. "
            f"Chance if nothing is wrong: {chance_words(d.remainder_p, d.permutations)}."
        )
    if d.verdict == "AMBIGUOUS":
        return f"AMBIGUOUS: the data cannot separate: {'; '.join(cause_words(c) for c in d.also_possible)}."
    named = "; ".join(
        f"{cause_words(c)}, {_plain(lengths, c.effect_rms_in)} rms (chance if nothing is wrong: {_chance(c, d)})"
        for c in d.causes
    )
    ruled = ", ".join(f"{name_words(cause)} {target or ''}".strip() for cause, target in d.ruled_out[:5])
    return " ".join([f"NAMED: {named}.", *([f"Ruled out: {ruled}."] if ruled else []), "Not ruled out: none."])


def _chance(cause: NamedCause, d: Diagnosis) -> str:
    return "not known" if cause.p_value is None else chance_words(cause.p_value, d.permutations)


def _variables(d: Diagnosis, between: str) -> str:
    return between.join(column_words(name) for name in d.unlisted_variables)


def _model(d: Diagnosis, lengths: Lengths) -> str:
    if not d.terms:
        return "not extended." + (" Band widened instead." if d.verdict in {"UNLISTED", "AMBIGUOUS"} else "")
    return f"prediction = rigid model + {'; '.join(fitted_numbers(d, lengths))}."


def fitted_numbers(d: Diagnosis, lengths: Lengths) -> tuple[str, ...]:
    """Write the fitted parameters of the named causes with their intervals, lengths in the reader's unit."""
    parts = []
    for c in d.causes:
        for name, value in c.parameters.items():
            words, _, unit = name.rpartition("_")
            is_length = unit == "in" and not isinstance(value, str)

            def said(number: float, is_length: bool = is_length) -> str:
                return lengths.bare(number, fine=1) if is_length else f"{number:.4g}"

            interval = c.interval_shown.get(name)
            band = "" if interval is None else f" (95 % {said(interval[0])} to {said(interval[1])})"
            shown = value if isinstance(value, str) else said(value) + (f" {lengths.unit}" if is_length else "")
            parts.append(f"{name_words(words if is_length else name)} {shown}{band}")
    return tuple(parts)


def _gain(d: Diagnosis, lengths: Lengths) -> str:
    g = d.gain
    if g is None:
        return "none measured: the model was not extended."
    changed = ", ".join(g.verdicts_changed[:_SHOWN]) + (" …" if len(g.verdicts_changed) > _SHOWN else "")
    return (
        f"rms on rows not used for the fit {lengths.bare(g.rms_before_in, fine=1)} → "
        f"{_plain(lengths, g.rms_after_in, fine=1)} (held out by {g.held_out_by}); "
        f"false WITHIN {g.false_within_before} → {g.false_within_after}; "
        f"false OUTSIDE {g.false_outside_before} → {g.false_outside_after} of {d.rows_used}; "
        f"side of the margin changes: {changed or 'none'}."
    )


def _left(d: Diagnosis, lengths: Lengths) -> str:
    gauges = ""
    if d.expected_scatter_in is not None:
        gauges = f" The gauges alone leave about {_plain(lengths, d.expected_scatter_in)}."
    if d.verdict == "AMBIGUOUS":
        like = "like noise" if d.remainder_p > NOISE_ABOVE else "not like noise alone"
        return (
            f"nothing is taken out: {_plain(lengths, d.residual_u_in)} rms. Without what they explain it looks {like} "
            f"(p = {d.remainder_p:.2g}).{gauges}"
        )
    looks = "looks like noise" if d.remainder_is_noise else "does not look like noise alone"
    if d.verdict == "NONE" and d.remainder_p <= NOISE_ABOVE:
        looks = "is still what chance makes of noise, but more rows would tell better"
    chance = chance_words(d.remainder_p, d.permutations)
    p = chance if "≤" in chance else f"= {chance}"
    return f"remainder {_plain(lengths, d.residual_u_in)} rms {looks} (p {p}).{gauges}"


def what_to_do(d: Diagnosis) -> str:
    if d.verdict == "NAMED":
        apart = [f"to tell it from {name_words(o.cause.name)}: {o.separates}" for c in d.causes for o in c.aliases]
        return "; ".join([*(c.candidate.cause.inspect for c in d.causes), *apart]) + "."
    if d.verdict == "AMBIGUOUS":
        return f"To split them, take: {d.also_possible[0].candidate.separates}."
    if d.verdict == "UNLISTED":
        return f"Record what else differs with {_variables(d, ' and ')}; keep the model as it is."
    return "Nothing to change. More rows would find smaller effects."
