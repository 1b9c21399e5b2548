"""What may explain a misfit: effects, each a column (M3), and contexts of many rows (M4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlg_troubleshoot.arrays import Array, Wholes
from mlg_troubleshoot.misfit.columns import EffectColumns
from mlg_troubleshoot.misfit.covariance import NoiseModel

# What is wrong, and in what: a cause with its target.
Key = tuple[str, str | None]
# What moves with a variable that no list has goes by this name.
UNLISTED = "unlisted"


_OF_EACH = ("listed", "log_prior", "size", "scales", "least", "sign", "mean", "rarity")


@dataclass(frozen=True)
class Effects:
    """Effects that may act, several variants under one name; each has a size that is not known.

    Attributes
    ----------
    columns : ndarray or EffectColumns, shape (n, p)
        Effect of each per unit of its size.
    names : sequence of Key or None
        What each is a variant of; None where it is an entry error, nothing that anybody has to
        correct.
    listed : ndarray of bool, shape (p,)
        True if it stands on the list of causes.
    log_prior : ndarray, shape (p,)
        Logarithm of how often each is expected in a set of data.
    size : ndarray, shape (p,)
        Standard deviation of its size.
    scales : ndarray of bool, shape (p,)
        True where that standard deviation is one of several that are tried.
    least : ndarray, shape (p,)
        A smaller standard deviation is not tried: so small an effect does not matter.
    sign : ndarray, shape (p,)
        +1 or −1 where the size can have one sign only, else 0.
    mean : ndarray, shape (p,)
        The only size that it can have, 0 where it is free.
    rarity : ndarray, shape (p,), or float
        The part of `log_prior` that is not belief: variants that the rows were searched for and
        that are not listed.
    """

    columns: Array | EffectColumns
    names: Sequence[Key | None]
    listed: Array
    log_prior: Array
    size: Array
    scales: Array
    least: Array
    sign: Array
    mean: Array
    rarity: Array | float = 0.0

    @staticmethod
    def joined(parts: Sequence[Effects]) -> Effects:
        """All effects of several lists in one."""
        return Effects(
            EffectColumns.joined([e.kept for e in parts]),
            [name for e in parts for name in e.names],
            *(
                np.concatenate([np.broadcast_to(getattr(e, what), len(e.names)) for e in parts])
                for what in _OF_EACH
            ),
        )

    @staticmethod
    def free(
        columns: Array | EffectColumns,
        names: Sequence[Key | None],
        log_prior: Array | float,
        size: float,
    ) -> Effects:
        """Effects that are on no list and may have any sign."""
        p = len(names)
        none = np.zeros(p)
        return Effects(
            columns,
            names,
            none.astype(bool),
            np.full(p, log_prior),
            np.full(p, size),
            np.array([name is not None for name in names], bool),
            none,
            none,
            none,
        )

    @cached_property
    def kept(self) -> EffectColumns:
        """The columns, as short as they can be kept."""
        return EffectColumns.of(self.columns)

    @property
    def numbered(self) -> tuple[list[Key | None], Wholes]:
        """Each name once, None first, and the place of each effect's name among them."""
        once: dict[Key | None, int] = {None: 0}
        places = [once.setdefault(name, len(once)) for name in self.names]
        return list(once), np.array(places, np.int64)


@dataclass(frozen=True)
class Context:
    """Effects that act all together or not at all, with what is known of them beforehand.

    Attributes
    ----------
    name : Key or None
        What is wrong if it acts; None where nothing does.
    log_prior : float
        Logarithm of how often it is expected.
    shared_in : ndarray, shape (n, j)
        Its effects, each per unit of its size.
    root : ndarray, shape (j, k), optional
        Root of the covariance of the sizes; None if they are independent, with one standard
        deviation each.
    changes : ndarray, shape (m,), optional
        Equally likely values of each size, where they are not normal about zero; `root` is of
        their variance.
    listed : bool
        True if it stands on the list of causes.
    of_tails_in : ndarray, shape (n, w), optional
        Effects that each tail has in a size of its own, at one standard deviation. [in]
    """

    name: Key | None
    log_prior: float
    shared_in: Array
    root: Array | None = None
    changes: Array | None = None
    listed: bool = True
    of_tails_in: Array | None = None

    @property
    def mean(self) -> float:
        """Expected size of each."""
        return 0.0 if self.changes is None else float(np.mean(self.changes))

    @property
    def root_of(self) -> Array:
        """Root of the covariance of the sizes, shape (j, k)."""
        return np.eye(self.shared_in.shape[1]) if self.root is None else self.root

    @property
    def independent_in(self) -> Array:
        """Independent effects about zero with the second moments of these, shape (n, k)."""
        mean = self.mean * self.shared_in.sum(axis=1, keepdims=True)
        return np.hstack([self.shared_in @ self.root_of, mean][: 1 + bool(self.mean)])

    @property
    def covariance(self) -> Array:
        """Second moments of the sizes, shape (j, j)."""
        return self.root_of @ self.root_of.T + self.mean**2

    def behind(self, noise: NoiseModel) -> NoiseModel:
        """Noise with what each tail has in a size of its own."""
        return noise if self.of_tails_in is None else noise.with_tails_apart(self.of_tails_in)

    def within(self, noise: NoiseModel) -> NoiseModel:
        """Noise with all its effects."""
        return self.behind(noise).with_effects(self.independent_in)

    def share_of(self, noise: NoiseModel, data: Array) -> Array:
        """What its effects most likely explain of data (BLUP). [in]"""
        wide = self.within(noise)
        found = wide.share_of(self.independent_in, data)
        for scatter in () if self.of_tails_in is None else self.of_tails_in.T:
            found += wide.share_of_groups(scatter, noise.tails, data)
        return found

    @staticmethod
    def none(n: int) -> Context:
        """Nothing acts in all rows at once."""
        return Context(None, 0.0, np.empty((n, 0)))


@dataclass(frozen=True)
class Explanation:
    """A context with some effects in it, and how likely it is.

    Attributes
    ----------
    context : int
        Place of the context.
    members : tuple of int
        Places of the effects.
    log_posterior : float
        Up to a constant that all explanations of the same data share.
    values : ndarray, shape (k,)
        Expected size of each member.
    """

    context: int
    members: tuple[int, ...]
    log_posterior: float
    values: Array
