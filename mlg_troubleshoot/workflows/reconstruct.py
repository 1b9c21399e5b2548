"""Where coordinates come from: a linkage that meets printed numbers, and the ensemble's text for
it.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import tomli_w

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.design import member_values
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.outputs import OutputKind, write_text
from mlg_troubleshoot.paper.targets import load_targets, targets_file
from mlg_troubleshoot.parallel import StageProgress

if TYPE_CHECKING:
    from mlg_troubleshoot.paper.reconstruct import Reconstruction

_SOURCE = "Found by mlg gear reconstruct (reconstructed): chosen to meet numbers, not measured."
_HEADING = tomli_w.dumps({"source": _SOURCE}) + "\n"
LINKAGE = OutputKind.marked("is not a linkage that was reconstructed", _HEADING)


def reconstruct_linkage(
    gear: str,
    *,
    targets: Path | None,
    seed: int,
    start: str | None,
    name: str,
    minutes: float,
    out: Path | None,
    progress: StageProgress | None,
) -> tuple[Reconstruction, str]:
    """Search a linkage, or polish the one named `start`; return it with its text for an ensemble
    file.
    """
    from mlg_troubleshoot.paper.reconstruct import reconstruct

    if not name.isidentifier():
        raise UsageError(f"name {name!r}", "Use letters and digits, beginning with a letter.")
    known = load_gear(gear)
    wanted = load_targets(targets_file(known) if targets is None else targets)
    linkages = {linkage.name: linkage for linkage in known.ensemble}
    if start is not None and start not in linkages:
        raise UsageError(
            f"{known.name} has no linkage {start!r}", f"Give one of {', '.join(linkages)}."
        )
    begin = None if start is None else linkages[start]
    rng = np.random.default_rng(seed)
    found = reconstruct(known, wanted, rng, seed, begin, minutes, progress)
    text = tomli_w.dumps({"members": {name: member_values(found.linkage)}})
    if out is not None:
        write_text(out, _HEADING + text)
    return found, text
