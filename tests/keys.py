"""Keys that a person presses at a program on a pseudo-terminal."""

from __future__ import annotations

from typing import Any

import pytest

pexpect = pytest.importorskip("pexpect")


def interrupt(child: Any, until: Any = pexpect.EOF) -> None:
    """Press Ctrl-C until a text, or the end, is seen.

    One that comes between the prompt and the wait for a key is only seen with the next key: one
    presses it again.
    """
    for _ in range(6):
        child.sendintr()
        if child.expect([pexpect.TIMEOUT, until], timeout=10):
            return
    raise AssertionError(f"Ctrl-C did not lead to {until!r}: {child.before!r}")
