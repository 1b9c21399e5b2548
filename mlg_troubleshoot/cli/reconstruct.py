"""``mlg gear reconstruct``: what a linkage meets and what stays unknown. Nothing heavy is imported
before it runs.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mlg_troubleshoot.cli import options, output
from mlg_troubleshoot.errors import ExitCode
from mlg_troubleshoot.gear import DEFAULT_GEAR

EPILOG = (
    "Example: [b]mlg gear reconstruct --seed 7 --out new-member.toml[/b] · with your own numbers: "
    "[b]mlg gear reconstruct --targets mine.toml --start A[/b]"
)


def reconstruct(
    context: typer.Context,
    targets: Annotated[
        Path | None,
        typer.Option(
            metavar="TOML",
            help="Numbers to meet; those printed in the paper if not given.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the random linkages.")] = 0,
    start: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Start from this linkage of the gear (A, B, …); if not given, from random ones.",
        ),
    ] = None,
    name: Annotated[str, typer.Option(help="Name of the new linkage.")] = "N",
    minutes: Annotated[float, typer.Option(min=0.01, help="Time limit in minutes.")] = 15.0,
    out: Annotated[
        Path | None,
        typer.Option(metavar="OUT.toml", help="Write the linkage as a member of an ensemble."),
    ] = None,
    force: options.Force = False,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
    _version: options.Version = False,
) -> None:
    """Search for a linkage that meets printed numbers: the origin of the coordinates.

    Exit codes: 0 found · 1 improved, but not every number is met · 3 nothing found in time.
    """
    from mlg_troubleshoot.cli.claims import claim
    from mlg_troubleshoot.cli.progress import stages
    from mlg_troubleshoot.outputs import OutputFile
    from mlg_troubleshoot.workflows import reconstruct as task

    gear = context.obj or DEFAULT_GEAR
    claim(gear, [targets], [OutputFile("--out", out, task.LINKAGE)], force=force)
    with stages(quiet=quiet) as advance:
        found, text = task.reconstruct_linkage(
            gear,
            targets=targets,
            seed=seed,
            start=start,
            name=name,
            minutes=minutes,
            out=out,
            progress=advance,
        )
    if as_json:
        from mlg_troubleshoot.reporting.model_json import reconstruction_as_json

        output.write_json(reconstruction_as_json(found, text))
    else:
        output.show_page("reconstruct", output.console(elsewhere=output.WIDEST), found=found)
        if out is None:
            output.write("\n" + text)
    if out is not None:
        output.say(f"Linkage written: {out}")
    raise typer.Exit(ExitCode.FINE if found.meets_all else ExitCode.ATTENTION)
