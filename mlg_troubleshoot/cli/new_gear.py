"""``mlg gear new`` and ``mlg gear draw``: a gear from nothing, and its picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mlg_troubleshoot.cli import options, output
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.outputs import OutputKind

if TYPE_CHECKING:
    from mlg_troubleshoot.gear.gear import Gear

DRAWING = OutputKind.marked("is not a drawing", '<svg xmlns="http://www.w3.org/2000/svg" viewBox')
EPILOG = "Example: [b]mlg gear new my-gear.toml --from short-form.toml[/b]"


def new(
    file: Annotated[Path, typer.Argument(metavar="FILE.toml", help="The gear file to write.")],
    source: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="SHORT.toml|LINKAGE.json",
            help="A short form, or a mechanism of pylinkage. Without it, on a terminal, mlg asks.",
        ),
    ] = None,
    limit: Annotated[
        float | None,
        typer.Option(metavar="IN", help="For LINKAGE.json: radial limit of every joint."),
    ] = None,
    margin: Annotated[
        float | None,
        typer.Option(metavar="IN", help="For LINKAGE.json: allowed displacement of the output."),
    ] = None,
    unit: Annotated[str, typer.Option(metavar="in|mm", help="For LINKAGE.json: its unit.")] = "in",
    force: options.Force = False,
    _version: options.Version = False,
) -> None:
    """Make a gear file from points, links and joints: ground, crank, coupler, rocker, guide."""
    from mlg_troubleshoot.cli.claims import claim
    from mlg_troubleshoot.indices.index_table import INDEX_TABLE
    from mlg_troubleshoot.outputs import CONTINUED, OutputFile
    from mlg_troubleshoot.units import LengthUnit
    from mlg_troubleshoot.workflows.new_gear import NEW_GEAR, from_pylinkage, new_gear

    asked = file.with_name(f"{file.stem}-short.toml")
    outputs = [
        OutputFile("the gear", file, NEW_GEAR),
        OutputFile("its table", file.with_name(f"{file.stem}-indices.json"), INDEX_TABLE),
        OutputFile("its drawing", file.with_suffix(".svg"), DRAWING),
    ]
    if source is None:
        outputs.append(OutputFile("the answers", asked, CONTINUED))
    claim(None, [source], outputs, force=force)
    if source is not None and source.suffix.lower() == ".json":
        if limit is None or margin is None:
            raise UsageError(
                f"{source.name} states no limit and no margin", "Give --limit IN and --margin IN."
            )
        if unit not in tuple(LengthUnit):
            raise UsageError(f"--unit {unit!r} is not a unit", "Give in or mm.")
        found = from_pylinkage(source, file, limit=limit, margin=margin, unit=LengthUnit(unit))
        _say(found, file)
        return
    written = new_gear(_asked(asked) if source is None else source, file)
    for step in written.steps:
        output.write(f"  {step}")
    _say(written.gear, file)
    output.write(f"Assumed: {'; '.join(written.assumed)}. Change it in {file}.")


def _asked(answers: Path) -> Path:
    from mlg_troubleshoot.cli.gear_prompts import ask_gear
    from mlg_troubleshoot.cli.prompts import RichTerminal

    if not output.can_ask():
        raise UsageError(
            "this is not a terminal to ask on", "Give the points and links: --from SHORT.toml"
        )
    if ask_gear(answers, RichTerminal()):
        return answers
    output.say(f"Kept: {answers}. To continue, run the command again.")
    raise typer.Exit


def _say(gear: Gear, file: Path) -> None:
    picture = gear.plot().save(file.with_suffix(".svg"))
    output.write(f"Gear: {file}, {len(gear.joints)} joints. Table: {gear.indices_file}")
    output.write(f"Drawing of the gear as read: {picture}. Use it: mlg check FILE --gear {file}")


def draw(
    context: typer.Context,
    file: Annotated[
        Path, typer.Argument(metavar="FILE.svg|FILE.png|FILE.pdf", help="The picture to write.")
    ],
    force: options.Force = False,
    _version: options.Version = False,
) -> None:
    """Draw the linkage of a gear: links, supports, guides, joints with their numbers and names."""
    from mlg_troubleshoot.cli.claims import claim
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.outputs import OutputFile

    drawing = OutputFile("the drawing", file, DRAWING)
    claim(context.obj, (), [drawing], force=force)
    output.write(f"Drawn: {load_gear(context.obj).plot().save(file)}")
