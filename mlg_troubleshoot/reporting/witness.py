"""What a report states of the log that it was made from: paper on which a later change shows."""

from __future__ import annotations

import re
import zlib
from pathlib import Path

import msgspec
from markupsafe import Markup

from mlg_troubleshoot.errors import UsageError

# A token is letters and digits alone: it stands in HTML and in PDF as it is.
_TOKEN = re.compile(rb"mlgwitness([0-9a-f]+)")
# A report and what its token says. [bytes]
_MOST_BYTES = 100_000_000
_MOST_SAID = 10_000_000


class ReportedGear(msgspec.Struct, frozen=True):
    """A gear in a report: its newest record and, where the report is about what stands of it, the
    verdict.
    """

    tail_no: str
    side: str
    record: str
    verdict: str | None = None


class Witness(msgspec.Struct, frozen=True):
    """The log behind a report: how many records, the hash of the last one, and the gears.

    extension: what a verdict of the model with an extension rests on, which the log does not hold.
    """

    count: int
    head: str
    program: str
    geometry: str
    gears: tuple[ReportedGear, ...]
    extension: str | None = None

    @property
    def token(self) -> Markup:
        return Markup("mlgwitness" + zlib.compress(msgspec.json.encode(self), 9).hex())


def read_witness(file: Path) -> Witness:
    """Read what a report in HTML or PDF states of its log."""
    try:
        with file.open("rb") as report:
            found = _TOKEN.search(report.read(_MOST_BYTES))
        if found is None:
            raise ValueError
        press = zlib.decompressobj()
        said = press.decompress(bytes.fromhex(found[1].decode()), _MOST_SAID)
        return msgspec.json.decode(said, type=Witness)
    except OSError as error:
        raise UsageError(
            f"{file} cannot be read: {error.strerror}", "Give a report that mlg wrote."
        ) from None
    except (ValueError, zlib.error, msgspec.MsgspecError):
        raise UsageError(
            f"{file} states no log",
            "Give a report of a gear that was kept: mlg check --keep --report, or mlg history"
            " TAIL SIDE --report DIR.",
        ) from None
