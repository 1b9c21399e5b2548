"""The seven lines of a diagnosis, as a person reads them on the terminal and on paper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mlg_troubleshoot.diagnosis import Diagnosis, NamedCause
from mlg_troubleshoot.diagnosis.faults import DataFault
from mlg_troubleshoot.reporting.formats import number

THOU_PER_IN = 1000.0
NOISE_ABOVE = 0.05
_SHOWN = 8
_CELLS = 2
_KINDS = {
    "mm_as_in": "millimetres entered as inches",
    "factor_10": "decimal point slipped",
    "swapped_joints": "two joints swapped",
    "swapped_side": "left and right swapped",
    "implausible": "implausible",
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
    """One of the seven lines.

    Parameters
    ----------
    number : int
        1 to 7.
    word : str
        What the line is about, in one word.
    text : str
        What it says.
    """

    number: int
    word: str
    text: str


def thou(value_in: float, decimals: int = 1) -> str:
    """Write a length in thousandths of an inch.

    Parameters
    ----------
    value_in : float
        Length. [in]
    decimals : int
        Digits after the point.

    Returns
    -------
    str
        The number without its unit.
    """
    return f"{THOU_PER_IN * value_in:.{decimals}f}"


def kind_words(kind: str) -> str:
    """Say a kind of data fault in words.

    Parameters
    ----------
    kind : str
        The kind in the contract.

    Returns
    -------
    str
        The words.
    """
    return _KINDS.get(kind, kind.replace("_", " "))


def column_words(name: str) -> str:
    """Name a column as a person would.

    Parameters
    ----------
    name : str
        Name of the column.

    Returns
    -------
    str
        Its quantity, without its unit.
    """
    kind, _, joint = name.rpartition("_")
    if joint.isdigit() and kind in {"clearance", "axial_float"}:
        return f"{'clearance' if kind == 'clearance' else 'end float'} of joint {joint}"
    return _COLUMNS.get(name, name.replace("_", " "))


def chance_words(chance: float, permutations: int) -> str:
    """Write a chance as far as the data sets drawn with nothing wrong can tell it.

    Parameters
    ----------
    chance : float
        Chance of as much if nothing is wrong. [1]
    permutations : int
        Data sets drawn.

    Returns
    -------
    str
        The number, or what it lies below.
    """
    least = 1.0 / (permutations + 1)
    return f"{chance:.2g}" if chance > 1.001 * least else f"≤ {least:.2g}"


def cause_words(cause: NamedCause) -> str:
    """Say a cause in the words of its sentence.

    Parameters
    ----------
    cause : NamedCause
        The cause.

    Returns
    -------
    str
        The sentence, its target included; of a cause that cannot be tested, that its column is missing.
    """
    candidate = cause.candidate
    words = candidate.cause.words(candidate.target)
    return f"{words} (not testable without {' and '.join(candidate.cause.needs)})" if candidate.stands_in else words


def seven_lines(d: Diagnosis) -> tuple[Line, ...]:
    """Say what a diagnosis found: data, misfit, cause, model, gain, what is left, what to do.

    Parameters
    ----------
    d : Diagnosis
        The diagnosis.

    Returns
    -------
    tuple of Line
        The seven lines.
    """
    said = {
        "DATA": _data(d),
        "MISFIT": _misfit(d),
        "CAUSE": _cause(d),
        "MODEL": _model(d),
        "GAIN": _gain(d),
        "LEFT": _left(d),
        "DO": what_to_do(d),
    }
    return tuple(Line(k, word, text) for k, (word, text) in enumerate(said.items(), 1))


def _data(d: Diagnosis) -> str:
    slips: dict[tuple[int, str], list[DataFault]] = {}
    for fault in d.faults:
        slips.setdefault((fault.row, fault.kind), []).append(fault)
    faults = "; ".join(_slip(cells) for cells in list(slips.values())[:_SHOWN])
    more = f" and {len(slips) - _SHOWN} more" if len(slips) > _SHOWN else ""
    untested = ", ".join(f"{cause} (no {column})" for cause, column in d.not_testable)
    parts = [f"{d.rows_read} rows, {d.rows_used} used."]
    parts.append(
        f"Most likely wrong: {faults}{more}. Repaired in this analysis only." if faults else "No data fault found."
    )
    if untested:
        parts.append(f"NOT TESTABLE: {untested}.")
    return " ".join(parts)


def _slip(cells: Sequence[DataFault]) -> str:
    """One slip of the pen, which may be in several cells of a row."""
    changes = ", ".join(
        f"{f.column} {f.value} → {'not used' if f.suggested is None else f.suggested}" for f in cells[:_CELLS]
    )
    more = f" and {len(cells) - _CELLS} more" if len(cells) > _CELLS else ""
    return f"row {cells[0].row}, {kind_words(cells[0].kind)} ({changes}{more})"


def _misfit(d: Diagnosis) -> str:
    gauge = (
        "repeatability unknown"
        if d.repeatability_in is None
        else f"one reading repeats to {thou(d.repeatability_in)} thou ({d.repeatability_source})"
    )
    mean = number(THOU_PER_IN * d.mean_in, 1, signed=True)
    return f"measured − predicted: mean {mean}, rms {thou(d.rms_in)} thou; {gauge}."


def _cause(d: Diagnosis) -> str:
    if d.verdict == "NONE":
        return (
            "NONE: nothing stands out beyond chance. "
            f"An effect of {thou(d.smallest_rms_in)} thou rms would have been found 4 times in 5."
        )
    if d.verdict == "UNLISTED":
        return (
            f"UNLISTED: real, but not on the list; it moves with {_variables(d, ' × ')}. "
            f"Chance if nothing is wrong: {chance_words(d.remainder_p, d.permutations)}."
        )
    if d.verdict == "AMBIGUOUS":
        return f"AMBIGUOUS: the data cannot separate: {'; '.join(cause_words(c) for c in d.also_possible)}."
    named = "; ".join(
        f"{cause_words(c)}, {thou(c.effect_rms_in)} thou rms (chance if nothing is wrong: {_chance(c, d)})"
        for c in d.causes
    )
    ruled = ", ".join(f"{cause} {target or ''}".strip() for cause, target in d.ruled_out[:5])
    return " ".join([f"NAMED: {named}.", *([f"Ruled out: {ruled}."] if ruled else []), "Not ruled out: none."])


def _chance(cause: NamedCause, d: Diagnosis) -> str:
    return "not known" if cause.p_value is None else chance_words(cause.p_value, d.permutations)


def _variables(d: Diagnosis, between: str) -> str:
    return between.join(column_words(name) for name in d.unlisted_variables)


def _model(d: Diagnosis) -> str:
    if not d.terms:
        return "not extended." + (" Band widened instead." if d.verdict in {"UNLISTED", "AMBIGUOUS"} else "")
    return f"prediction = rigid model + {'; '.join(fitted_numbers(d))}."


def fitted_numbers(d: Diagnosis) -> tuple[str, ...]:
    """Write the fitted parameters of the named causes with their intervals.

    Parameters
    ----------
    d : Diagnosis
        The diagnosis.

    Returns
    -------
    tuple of str
        One text for each parameter.
    """
    parts = []
    for c in d.causes:
        for name, value in c.parameters.items():
            interval = c.interval_shown.get(name)
            band = "" if interval is None else f" (95 % {interval[0]:.4g} to {interval[1]:.4g})"
            parts.append(f"{name} {value if isinstance(value, str) else f'{value:.4g}'}{band}")
    return tuple(parts)


def _gain(d: Diagnosis) -> str:
    g = d.gain
    if g is None:
        return "none measured: the model was not extended."
    changed = ", ".join(g.verdicts_changed[:_SHOWN]) + (" …" if len(g.verdicts_changed) > _SHOWN else "")
    return (
        f"rms on rows not used for the fit {thou(g.rms_before_in, 2)} → {thou(g.rms_after_in, 2)} thou (held out by "
        f"{g.held_out_by}); false WITHIN {g.false_within_before} → {g.false_within_after}; false OUTSIDE "
        f"{g.false_outside_before} → {g.false_outside_after} of {d.rows_used}; "
        f"side of the margin changes: {changed or 'none'}."
    )


def _left(d: Diagnosis) -> str:
    gauges = ""
    if d.expected_scatter_in is not None:
        gauges = f" The gauges alone leave about {thou(d.expected_scatter_in)} thou."
    if d.verdict == "AMBIGUOUS":
        like = "like noise" if d.remainder_p > NOISE_ABOVE else "not like noise alone"
        return (
            f"nothing is taken out: {thou(d.residual_u_in)} thou rms. Without what they explain it looks {like} "
            f"(p = {d.remainder_p:.2g}).{gauges}"
        )
    looks = "looks like noise" if d.remainder_is_noise else "does not look like noise alone"
    if d.verdict == "NONE" and d.remainder_p <= NOISE_ABOVE:
        looks = "is still what chance makes of noise, but more rows would tell better"
    chance = chance_words(d.remainder_p, d.permutations)
    return (
        f"remainder {thou(d.residual_u_in)} thou rms {looks} (p {chance if '≤' in chance else f'= {chance}'}).{gauges}"
    )


def what_to_do(d: Diagnosis) -> str:
    """Say what to do next.

    Parameters
    ----------
    d : Diagnosis
        The diagnosis.

    Returns
    -------
    str
        One or two sentences.
    """
    if d.verdict == "NAMED":
        return "; ".join(c.candidate.cause.inspect for c in d.causes) + "."
    if d.verdict == "AMBIGUOUS":
        return f"To split them, take: {d.also_possible[0].candidate.separates}."
    if d.verdict == "UNLISTED":
        return f"Record what else differs with {_variables(d, ' and ')}; keep the model as it is."
    return "Nothing to change. More rows would find smaller effects."
