"""One difference between the supported versions of scipy."""

from __future__ import annotations

from typing import Any

from numpy.random import Generator


def seeded(rng: Generator) -> dict[str, Any]:
    """Return the keyword that hands a generator to scipy: it was called seed before scipy 1.15."""
    from scipy import __version__

    recent = tuple(int(part) for part in __version__.split(".")[:2]) >= (1, 15)
    return {"rng" if recent else "seed": rng}
