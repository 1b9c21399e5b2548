"""``mlg gear reconstruct``, its work: search a linkage, show what it meets and what stays unknown."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import typer

from mlg_troubleshoot.cli.progress import stages
from mlg_troubleshoot.errors import OutputError, UsageError
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.studies.reconstruct import Reconstruction, member_toml, reconstruct
from mlg_troubleshoot.studies.targets import load_targets, targets_file


@dataclass(frozen=True, slots=True)
class ReconstructArguments:
    """What the command line asks for.

    Parameters
    ----------
    gear : str
        Shipped gear or gear file: the topology.
    targets : Path or None
        Targets file, else the gear's.
    seed : int
        Seed.
    start : str or None
        Linkage to polish, else from scratch.
    name : str
        Name of the new linkage.
    minutes : float
        Time to give up after.
    out : Path or None
        Write the linkage here.
    as_json, quiet : bool
        Write JSON; be quiet.
    """

    gear: str
    targets: Path | None
    seed: int
    start: str | None
    name: str
    minutes: float
    out: Path | None
    as_json: bool
    quiet: bool


def run(arguments: ReconstructArguments) -> None:
    """Search and show a linkage; exit 1 if a polished one does not meet everything.

    Parameters
    ----------
    arguments : ReconstructArguments
        What the command line asks for.
    """
    gear = load_gear(arguments.gear)
    wanted = load_targets(targets_file(gear) if arguments.targets is None else arguments.targets)
    if not arguments.name.isidentifier():
        raise UsageError(f"name {arguments.name!r}", "Use letters and digits, beginning with a letter.")
    linkages = {linkage.name: linkage for linkage in gear.ensemble}
    if arguments.start is not None and arguments.start not in linkages:
        raise UsageError(f"{gear.name} has no linkage {arguments.start!r}", f"Give one of {', '.join(linkages)}.")
    start = None if arguments.start is None else linkages[arguments.start]
    with stages(quiet=arguments.quiet) as advance:
        found = reconstruct(
            gear, wanted, np.random.default_rng(arguments.seed), arguments.seed, start, arguments.minutes, advance
        )
    text = member_toml(found.linkage, arguments.name)
    if arguments.as_json:
        typer.echo(json.dumps(_as_json(found, text), indent=1, allow_nan=False))
    else:
        _show(found, text, show_member=arguments.out is None)
    if arguments.out is not None:
        head = 'source = "Found by mlg gear reconstruct (reconstructed): chosen to meet numbers, not measured."\n\n'
        try:
            arguments.out.write_text(head + text, encoding="utf-8")
        except OSError as error:
            raise OutputError(f"{arguments.out}: cannot be written: {error}", "Choose another file.") from error
        typer.echo(f"Linkage written: {arguments.out}", err=True)
    raise typer.Exit(0 if found.meets_all else 1)


def _as_json(found: Reconstruction, text: str) -> dict[str, object]:
    return {
        "schema_version": 1,
        "seed": found.seed,
        "linkages_tried": found.evaluations,
        "meets_all": found.meets_all,
        "numbers": found.numbers,
        "determined": found.determined,
        "free": found.numbers - found.determined,
        "loosest": [{"number": name, "free_part": part} for name, part in found.loosest],
        "targets": [
            {
                "quantity": each.target.quantity,
                "printed": each.target.printed,
                "accepted": each.target.tolerance,
                "computed": each.computed,
                "unit": each.target.unit,
                "holds": each.holds,
                "binds": each.binds,
            }
            for each in found.met
        ],
        "member_toml": text,
    }


def _show(found: Reconstruction, text: str, *, show_member: bool) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=120)
    table = Table(box=None, pad_edge=False, header_style="bold")
    for heading in ("target", "printed", "linkage", "accepted", "", ""):
        table.add_column(heading, justify="right" if heading == "linkage" else "left")
    for each in found.met:
        table.add_row(
            each.target.quantity,
            each.target.printed,
            f"{each.computed:.5g} {each.target.unit}".strip(),
            each.target.tolerance,
            "met" if each.holds else "NOT MET",
            "binds" if each.binds else "slack",
        )
    console.print(table)
    free = found.numbers - found.determined
    loosest = ", ".join(name for name, _ in found.loosest)
    console.print(
        Text(
            f"{found.numbers} numbers describe the linkage; the binding targets determine {found.determined} "
            f"directions among them, {free} stay free. Least determined: {loosest}. "
            f"{found.evaluations} linkages tried, seed {found.seed}."
        )
    )
    console.print(Text("This linkage is chosen to meet numbers; it is not measured and not drawing data."))
    if show_member:
        typer.echo("\n" + text)
