"""``mlg gear reconstruct``, its options. Nothing heavy is imported before it runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mlg_troubleshoot.cli.boundary import Boundary

EPILOG = (
    "Example: [b]mlg gear reconstruct --seed 7 --out new-member.toml[/b] · with your own numbers: "
    "[b]mlg gear reconstruct --targets mine.toml --start A[/b]"
)


def reconstruct(
    context: typer.Context,
    targets: Annotated[
        Path | None,
        typer.Option("--targets", metavar="TOML", help="Numbers to meet, else those printed in the paper."),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the random linkages.")] = 0,
    start: Annotated[
        str | None,
        typer.Option("--start", metavar="NAME", help="Polish this linkage of the gear (A, B, …), else from scratch."),
    ] = None,
    name: Annotated[str, typer.Option("--name", help="Name of the new linkage.")] = "N",
    minutes: Annotated[float, typer.Option("--minutes", min=0.01, help="Time to give up after.")] = 15.0,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="OUT.toml", help="Write the linkage as a member of an ensemble.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Write the result as JSON to stdout.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress.")] = False,
) -> None:
    """Search a linkage that meets printed numbers: where the coordinates come from.

    Exit codes: 0 found · 1 polished, but not everything is met · 3 nothing found in time.
    """
    with Boundary():
        from mlg_troubleshoot.cli import reconstruct_run

        reconstruct_run.run(
            reconstruct_run.ReconstructArguments(
                gear=context.obj or "hawker-800xp",
                targets=targets,
                seed=seed,
                start=start,
                name=name,
                minutes=minutes,
                out=out,
                as_json=as_json,
                quiet=quiet,
            )
        )
