"""Which cause explains the misfit beyond chance, which rivals are ruled out, and whether anything is left.

The alarm is a maximum over all candidates against data sets drawn with nothing wrong, which controls the
family-wise error. A name is unique only if every rival explains clearly less; otherwise the whole set is
reported. Candidates of one cause share its prior, so a cause with many targets must explain more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.diagnosis.bank import Bank
from mlg_troubleshoot.diagnosis.causes.base import Candidate
from mlg_troubleshoot.diagnosis.noise import EXPECTED_SLOPE, NoiseModel, build_noise
from mlg_troubleshoot.diagnosis.screen import Fit, Screen, fit

Array = NDArray[np.float64]
Key = tuple[str, str | None]

ALARM = 0.04
SECOND = 0.005
UNLISTED_ALARM = 0.008
# Log-likelihood by which a rival must fall behind to be ruled out.
RULED_OUT = 2.5
# A second cause below this share of the first one's effect is taken for a slip of the first one's form.
SECOND_SHARE = 1.0 / 3.0
_PAIR_POOL = 24


@dataclass(frozen=True)
class Finding:
    """What the inference found.

    Parameters
    ----------
    verdict : str
        NONE, NAMED, AMBIGUOUS or UNLISTED.
    chosen : tuple of int
        Candidates that are named, or the leading one of an ambiguous set.
    rivals : tuple of int
        The best candidate of each further cause and target that the data cannot rule out.
    p_values : tuple of float
        Chance of as much if nothing is wrong, for each of `chosen`. [1]
    variables : tuple of str
        Variables of an unlisted effect.
    remainder_p : float
        Chance of as much left if only noise is left. [1]
    noise : NoiseModel
        The noise with what is named removed.
    fit : Fit or None
        Fit of the chosen columns.
    smallest_rms_in : float
        Root mean square of the smallest effect that would be found four times in five. [in]
    ruled_out : tuple of (str, str or None)
        Causes and targets that explain clearly less, best first.
    """

    verdict: str
    chosen: tuple[int, ...]
    rivals: tuple[int, ...]
    p_values: tuple[float, ...]
    variables: tuple[str, ...]
    remainder_p: float
    noise: NoiseModel
    fit: Fit | None
    smallest_rms_in: float
    ruled_out: tuple[Key, ...]


class Inference:
    """The data of one table against the catalogue and the bank.

    Parameters
    ----------
    misfit, predicted : ndarray, shape (n,)
        Measured less predicted, and predicted. [in]
    tails : ndarray of str, shape (n,)
        Tail of each row.
    extra_in : ndarray, shape (n,)
        Further standard deviation of a row. [in]
    candidates : sequence of Candidate
        The catalogue's candidates.
    columns : ndarray, shape (n, n_candidates)
        Their effects. [in / unit]
    bank : Bank
        Shapes that are no listed cause.
    permutations : int
        Data sets drawn with nothing wrong.
    rng : numpy.random.Generator
        Source of randomness.
    progress : callable, optional
        Called with the share that is done.
    """

    def __init__(
        self,
        misfit: Array,
        predicted: Array,
        tails: NDArray[np.str_],
        extra_in: Array,
        candidates: Sequence[Candidate],
        columns: Array,
        bank: Bank,
        permutations: int,
        rng: np.random.Generator,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        self.misfit = misfit - EXPECTED_SLOPE * predicted
        self.predicted = predicted
        self.tails = tails
        self.extra = extra_in
        self.candidates = candidates
        self.columns = columns
        self.bank = bank
        self.permutations = permutations
        self.rng = rng
        self.progress = progress or (lambda _share: None)
        self.signs = np.array([c.cause.sign for c in candidates])
        names = [c.cause.name for c in candidates]
        self.penalty = np.log([float(names.count(name)) for name in names]) if names else np.empty(0)

    def run(self) -> Finding:
        """Run the inference.

        Returns
        -------
        Finding
            Verdict, names, rivals and remainder.
        """
        noise, _ = build_noise(self.misfit, self.predicted, self.tails, self.extra)
        screen = Screen(noise, self.columns, self.signs)
        gain = screen.run(self.misfit[:, None]).gain[:, 0]
        score = gain - self.penalty
        ratio, scale = screen.tail_ratio(self.misfit)
        null = self._null(noise, ratio, scale)
        at_random = np.max(screen.run(null).gain - self.penalty[:, None], axis=0)
        lead = int(np.argmax(score))
        p_alarm = _chance(at_random, score[lead])
        self.progress(0.4)
        smallest = self._smallest(at_random, scale)
        bank_screen = Screen(noise, self.bank.columns, np.zeros(self.bank.columns.shape[1]))
        bank_gain = bank_screen.run(self.misfit[:, None]).gain[:, 0]
        bank_p = _chance(np.max(bank_screen.run(null).gain, axis=0), float(np.max(bank_gain)))
        self.progress(0.6)
        if p_alarm > ALARM:
            variables = self.bank.variables[int(np.argmax(bank_gain))] if bank_p <= UNLISTED_ALARM else ()
            verdict = "UNLISTED" if variables else "NONE"
            return Finding(verdict, (), (), (), variables, min(bank_p, p_alarm), noise, None, smallest, ())
        return self._named(lead, p_alarm, smallest)

    def _null(self, noise: NoiseModel, ratio: float, scale: float) -> Array:
        normal = self.rng.standard_normal(4096)
        return noise.draw(normal, ratio, scale, self.permutations, self.rng)

    def _smallest(self, at_random: Array, scale: float) -> float:
        """Effect whose expected gain clears the alarm with four chances in five: (t − 0.84)² / 2 = bar."""
        bar = float(np.quantile(at_random, 1.0 - ALARM)) + float(np.median(self.penalty))
        return scale * (np.sqrt(2.0 * max(bar, 0.0)) + 0.84) / np.sqrt(len(self.misfit))

    def _named(self, lead: int, p_alarm: float, smallest: float) -> Finding:
        chosen, p_values = [lead], [p_alarm]
        second = self._second(chosen)
        if second is not None:
            chosen, p_second = second
            p_values.append(p_second)
        rivals: list[int] = []
        behind: dict[Key, float] = {}
        for place in range(len(chosen)):
            others = [c for k, c in enumerate(chosen) if k != place]
            better, near, rest = self._rivals(chosen[place], others)
            chosen[place] = better
            rivals += near
            behind.update(rest)
        noise, fitted = self._refit(chosen)
        remainder_p, variables, share = self._remainder(noise, chosen, fitted)
        ruled_out = tuple(sorted(behind, key=lambda key: behind[key]))
        if remainder_p <= UNLISTED_ALARM and share >= SECOND_SHARE:
            return Finding(
                "UNLISTED", (), (), tuple(p_values), variables, remainder_p, noise, None, smallest, ruled_out
            )
        verdict = "AMBIGUOUS" if rivals else "NAMED"
        return Finding(
            verdict, tuple(chosen), tuple(rivals), tuple(p_values), (), remainder_p, noise, fitted, smallest, ruled_out
        )

    def _refit(self, chosen: Sequence[int]) -> tuple[NoiseModel, Fit]:
        noise, _ = build_noise(self.misfit, self.predicted, self.tails, self.extra)
        columns = self.columns[:, list(chosen)]
        fitted = fit(noise, columns, self.misfit)
        noise, _ = build_noise(self.misfit, self.predicted, self.tails, self.extra, columns @ fitted.values)
        return noise, fit(noise, columns, self.misfit)

    def _second(self, chosen: list[int]) -> tuple[list[int], float] | None:
        """Look for the best pair, and accept it if its second cause stands out and is no slip of form."""
        noise, _fitted = self._refit(chosen)
        screen = Screen(noise, self.columns, self.signs)
        single = screen.run(self.misfit[:, None]).gain[:, 0] - self.penalty
        order = np.argsort(-single)
        pool: list[int] = []
        seen: set[Key] = set()
        for k in order:
            key = self.candidates[int(k)].key
            if key not in seen:
                seen.add(key)
                pool.append(int(k))
            if len(pool) == _PAIR_POOL:
                break
        best: tuple[float, int, int] | None = None
        for first in pool:
            partner = Screen(noise, self.columns, self.signs, self.columns[:, [first]])
            total = single[first] + partner.run(self.misfit[:, None]).gain[:, 0] - self.penalty
            for k in np.argsort(-total):
                if self.candidates[int(k)].cause.name != self.candidates[first].cause.name or (
                    self.candidates[int(k)].key != self.candidates[first].key
                ):
                    if best is None or total[k] > best[0]:
                        best = (float(total[k]), first, int(k))
                    break
        if best is None:
            return None
        pair = [best[1], best[2]]
        pair.sort(key=lambda k: -single[k])
        _noise, fitted = self._refit(pair)
        wrong = [
            self.signs[k] != 0 and np.sign(v) != self.signs[k] for k, v in zip(pair, fitted.values, strict=True)
        ]
        if any(wrong):
            return None
        sizes = [float(np.sqrt(np.mean((self.columns[:, k] * v) ** 2))) for k, v in zip(pair, fitted.values, strict=True)]
        if min(sizes) < SECOND_SHARE * max(sizes):
            return None
        held = Screen(noise, self.columns, self.signs, self.columns[:, [pair[0]]])
        ratio, scale = held.tail_ratio(self.misfit)
        null = self._null(noise, ratio, scale)
        at_random = np.max(held.run(null).gain - self.penalty[:, None], axis=0)
        observed = float(best[0] - np.max(single))
        p = _chance(at_random, observed)
        return (pair, p) if p <= SECOND else None

    def _rivals(self, lead: int, others: Sequence[int]) -> tuple[int, list[int], dict[Key, float]]:
        """Best candidate in the lead's place, the rivals that are near it, and how far the rest is behind."""
        noise, _fitted = self._refit([lead, *others])
        screen = Screen(noise, self.columns, self.signs, self.columns[:, list(others)] if others else None)
        gain = screen.run(self.misfit[:, None]).gain[:, 0]
        score = gain - self.penalty
        for k in others:
            score[[i for i, c in enumerate(self.candidates) if c.key == self.candidates[k].key]] = -np.inf
        best: dict[Key, int] = {}
        for k in np.argsort(-score):
            best.setdefault(self.candidates[int(k)].key, int(k))
        winner = int(np.argmax(score))
        near, behind = [], {}
        for key, k in best.items():
            if key == self.candidates[winner].key or not np.isfinite(score[k]):
                continue
            distance = min(score[winner] - score[k], gain[winner] - gain[k] + 2.0)
            if distance < RULED_OUT:
                near.append(k)
            elif gain[k] > 2.0:
                behind[key] = float(distance)
        return winner, near, behind

    def _remainder(self, noise: NoiseModel, chosen: Sequence[int], fitted: Fit) -> tuple[float, tuple[str, ...], float]:
        """Chance of the strongest shape in what is left, its variables, and its size beside the named effect."""
        held = self.columns[:, list(chosen)]
        screen = Screen(noise, self.bank.columns, np.zeros(self.bank.columns.shape[1]), held)
        gain = screen.run(self.misfit[:, None]).gain[:, 0]
        ratio, scale = screen.tail_ratio(self.misfit)
        at_random = np.max(screen.run(self._null(noise, ratio, scale)).gain, axis=0)
        self.progress(0.9)
        top = int(np.argmax(gain))
        both = fit(noise, np.column_stack([held, self.bank.columns[:, top]]), self.misfit)
        size = float(np.std(self.bank.columns[:, top])) * abs(float(both.values[-1]))
        named = float(np.sqrt(np.mean((held @ fitted.values) ** 2)))
        return _chance(at_random, float(gain[top])), self.bank.variables[top], size / max(named, 1e-12)


def _chance(at_random: Array, observed: float) -> float:
    return float((1 + np.sum(at_random >= observed)) / (1 + len(at_random)))
