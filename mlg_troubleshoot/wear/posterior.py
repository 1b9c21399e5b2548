"""Posterior draws of the wear model, over its kinds in the measure of their evidence.

For each kind the mode of the posterior is found, and the posterior is sampled from a Student
distribution about it with importance weights, whose mean is the evidence. The draws of all kinds
are then resampled together: Bayesian model averaging. Plugged-in estimates would make forecasts of
few units far too sure.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import gammaln, logsumexp

from mlg_troubleshoot.arrays import Array, central_slopes, central_steps
from mlg_troubleshoot.wear.model import Draws, Scale, Steps, follow

# Mean and standard deviation of the normal prior of each parameter: weak on purpose, and the same
# for all kinds so that evidence compares. A scale by its logarithm, in units of the whole usage and
# the whole rise that was read.
_PRIOR = {
    # Where paths begin, and how far apart they begin. [rise; log rise]
    "start": (0, 2),
    "start_sd": (np.log(0.1), 1.5),
    # Pace of the population, and how far units differ from it. [rise per usage; its logarithm]
    "drift": (1, 1),
    "drift_sd": (np.log(0.25), 1),
    # Wiener increments over the whole usage, and wandering of the drift. [log rise]
    "increment_sd": (np.log(0.15), 1.2),
    "wander_sd": (np.log(0.5), 1.2),
    # Error of a reading. [log rise]
    "reading_sd": (np.log(0.05), 1.5),
    # Power of usage that wear follows; 0 is in proportion. [logarithm]
    "power": (0, 0.35),
    # Share of its pace that a restored unit keeps. [log odds]
    "kept": (1, 1.5),
}
_KINDS = ("wiener", "integrated")
# Importance samples of each kind of increments, and the degrees of freedom of the Student
# distribution that they are drawn from: wider tails than the posterior's. [1]
_SAMPLES = 800
_FREEDOM = 6
# Readings times samples that are worked out at once: as many stay in the cache. [1]
_CHUNK = 40_000


@dataclass(frozen=True, slots=True)
class Member:
    """One kind of increments, with or without a power of usage, and the parameters that it has."""

    kind: str
    names: tuple[str, ...]

    def draws(self, theta: Array, resolution: float) -> Draws:
        """Turn rows of transformed parameters into draws."""
        column = {name: theta[:, [i]] for i, name in enumerate(self.names)}
        none = np.zeros((len(theta), 1))
        one = np.ones((len(theta), 1))

        def positive(name: str) -> Array:
            return np.exp(np.clip(column[name], -15.0, 8.0)) if name in column else none

        return Draws(
            start=column["start"],
            start_sd=positive("start_sd"),
            drift=column["drift"],
            drift_sd=positive("drift_sd"),
            increment_sd=positive("increment_sd"),
            wander_sd=positive("wander_sd"),
            # Rounding to the resolution is the least error that a reading has.
            reading_sd=np.hypot(positive("reading_sd"), resolution / np.sqrt(12.0)),
            power=positive("power") if "power" in column else one,
            kept=1.0 / (1.0 + np.exp(-column["kept"])) if "kept" in column else one,
        )


def members(*, estimate_reading: bool, restored: bool) -> list[Member]:
    """List the kinds that the data can be asked about."""
    found = []
    for kind in _KINDS:
        names = ["start", "start_sd", "drift", "drift_sd"]
        names.append("wander_sd" if kind == "integrated" else "increment_sd")
        names += ["reading_sd"] * estimate_reading + ["kept"] * restored
        found += [Member(kind, tuple(names)), Member(kind, (*names, "power"))]
    return found


def _log_posterior(member: Member, steps: Steps, resolution: float) -> Callable[[Array], Array]:
    mean, sd = np.array([_PRIOR[name] for name in member.names]).T
    size = max(1, _CHUNK // max(steps.seen.shape[1], 1))

    def value(theta: Array) -> Array:
        parts = []
        for i in range(0, len(theta), size):
            draws = member.draws(theta[i : i + size], resolution)
            parts.append(follow(steps, draws)[0].sum(axis=1))
        likelihood = np.nan_to_num(np.concatenate(parts), nan=-1e12, neginf=-1e12)
        z = (theta - mean) / sd
        prior = -0.5 * z**2
        prior = prior - np.log(sd) - 0.5 * np.log(2.0 * np.pi)
        posterior: Array = likelihood + prior.sum(axis=1)
        return posterior

    return value


def _mode(value: Callable[[Array], Array], start: Array) -> tuple[Array, Array]:
    """Find the mode and the curvature there; differences of both sides are computed in one
    batch.
    """
    n = len(start)
    step = 1e-4

    def descent(theta: Array) -> tuple[float, Array]:
        found = value(np.vstack([theta, theta + central_steps(n, step)]))
        return -float(found[0]), -central_slopes(found[1:], step)

    mode = np.asarray(
        minimize(descent, start, jac=True, method="L-BFGS-B", options={"maxiter": 80}).x
    )
    h = 0.02
    offsets = h * np.eye(n)
    pairs = [
        a * offsets[i] + b * offsets[j]
        for i in range(n)
        for j in range(n)
        for a in (1, -1)
        for b in (1, -1)
    ]
    found = value(mode + np.array(pairs)).reshape(n, n, 4)
    both_up, first_up, second_up, both_down = np.moveaxis(found, -1, 0)
    mixed = both_up - first_up - second_up + both_down
    return mode, -mixed / (4.0 * h * h)


def _student(centre: Array, root: Array, n: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Draw from a multivariate Student distribution; return the draws and their log density."""
    p = len(centre)
    z = rng.standard_normal((n, p))
    chi = rng.chisquare(_FREEDOM, n)
    widened = z * np.sqrt(_FREEDOM / chi)[:, None]
    theta = centre + widened @ root.T
    return theta, _student_density(theta, centre, root)


def _student_density(theta: Array, centre: Array, root: Array) -> Array:
    p = len(centre)
    off = np.linalg.solve(root, (theta - centre).T)
    half = (_FREEDOM + p) / 2.0
    constant = gammaln(half) - gammaln(_FREEDOM / 2.0)
    constant -= 0.5 * p * np.log(_FREEDOM * np.pi)
    log_det = np.log(np.abs(np.diag(root))).sum()
    squares = (off**2).sum(axis=0)
    density: Array = constant - log_det - half * np.log1p(squares / _FREEDOM)
    return density


def _sample(
    member: Member, value: Callable[[Array], Array], rng: np.random.Generator
) -> tuple[Array, Array]:
    """Sample one kind's posterior; return the draws and their log weights, the mean of which is the
    evidence.
    """
    mean, sd = np.array([_PRIOR[name] for name in member.names]).T
    mode, hessian = _mode(value, mean)
    # No direction is taken for wider than its prior, nor for exactly known.
    per_prior = np.outer(sd, sd)
    size, vectors = np.linalg.eigh(per_prior * (hessian + hessian.T) / 2.0)
    covariance = per_prior * ((vectors / np.clip(size, 0.5, 1e8)) @ vectors.T)
    root = np.asarray(np.linalg.cholesky(covariance), float)
    theta, density = _student(mode, root, _SAMPLES, rng)
    first = value(theta)
    weight = first - density
    # Once more about what was found: the mode is not the middle of a skew posterior.
    share = np.exp(weight - logsumexp(weight))
    centre = share @ theta
    spread = (share * (theta - centre).T) @ (theta - centre)
    widened = 0.9 * spread + 0.1 * root @ root.T
    second = np.asarray(np.linalg.cholesky(widened), float)
    again, _density = _student(centre, second, _SAMPLES, rng)
    both = np.vstack([theta, again])
    mixture = np.logaddexp(
        _student_density(both, mode, root), _student_density(both, centre, second)
    ) - np.log(2.0)
    return both, np.concatenate([first, value(again)]) - mixture


def posterior(
    steps: Steps,
    scale: Scale,
    count: int,
    rng: np.random.Generator,
    kinds: Sequence[Member],
    progress: Callable[[int, int], None],
) -> tuple[Draws, dict[str, float]]:
    """Draw parameters over all kinds; return them and the posterior probability of each kind."""
    resolution = scale.resolution / abs(scale.value)
    found = []
    for done, member in enumerate(kinds):
        progress(done, len(kinds))
        found.append(_sample(member, _log_posterior(member, steps, resolution), rng))
    weights = np.concatenate([weight for _theta, weight in found])
    share = np.exp(weights - logsumexp(weights))
    counts = [len(weight) for _theta, weight in found]
    owner = np.repeat(np.arange(len(kinds)), counts)
    # Systematic resampling.
    quantiles = (np.arange(count) + rng.uniform()) / count
    chosen = np.searchsorted(np.cumsum(share), quantiles)
    chosen = chosen.clip(max=len(share) - 1)
    first = np.cumsum([0, *counts])
    parts = []
    for k, member in enumerate(kinds):
        rows = chosen[owner[chosen] == k] - first[k]
        parts.append(member.draws(found[k][0][rows], resolution))
    draws = Draws(
        *(np.concatenate([getattr(p, name) for p in parts]) for name in Draws.__dataclass_fields__)
    )
    names = [f"{member.kind}{' power' if 'power' in member.names else ''}" for member in kinds]
    probability = {name: float(share[owner == k].sum()) for k, name in enumerate(names)}
    return draws, probability
