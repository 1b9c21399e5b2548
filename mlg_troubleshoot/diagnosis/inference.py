"""Which cause explains the misfit beyond chance, which rivals are ruled out, and whether anything is left.

The alarm is a maximum over all candidates against data sets drawn with nothing wrong, which controls the
family-wise error. A name is unique only if every rival explains clearly less; otherwise the whole set is
reported. Candidates of one cause share its prior, so a cause with many targets must explain more.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.diagnosis.bank import Bank
from mlg_troubleshoot.diagnosis.causes.base import Candidate
from mlg_troubleshoot.diagnosis.covariance import NoiseModel
from mlg_troubleshoot.diagnosis.noise import EXPECTED_SLOPE, Rows, build_noise
from mlg_troubleshoot.diagnosis.screen import Fit, Screen, fit

Array = NDArray[np.float64]
Key = tuple[str, str | None]

ALARM = 0.012
# A name needs clearer evidence than an alarm does.
NAME = 0.002
SECOND = 0.002
UNLISTED_ALARM = 0.002
# Chance below which what is left refutes the named cause.
REFUTED = 0.001
# Log-likelihood by which a rival must fall behind to be ruled out.
RULED_OUT = 2.5
RULED_OUT_FAINT = 4.0
# Cosine from which two effects count as the same effect under two names.
ALIKE = 0.985
# A second cause below this share of the first one's effect is taken for a slip of the first one's form.
SECOND_SHARE = 1.0 / 3.0
# Where something must be left all the same, a weaker listed cause is accepted down to this share.
WEAK_SHARE = 0.12
# Log-likelihood by which a shift of all rows must lead, being no listed cause, to be believed.
CONSTANT = 1.5
# A remainder in the named cause's own variable refutes its form from this share of the effect on.
OWN_SHARE = 0.2
_PAIR_POOL = 24
_COUNTED = 10


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
    misfit : ndarray, shape (n,)
        Measured less predicted. [in]
    rows : Rows
        What is known of the rows.
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
        rows: Rows,
        candidates: Sequence[Candidate],
        columns: Array,
        bank: Bank,
        permutations: int,
        rng: np.random.Generator,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        self.misfit = misfit - EXPECTED_SLOPE * rows.predicted_in
        self.rows = rows
        self.candidates = candidates
        self.columns = columns
        self.bank = bank
        self.permutations = permutations
        self.rng = rng
        self.progress = progress or (lambda _share: None)
        self.signs = np.array([c.cause.sign for c in candidates])
        counts = Counter(c.cause.name for c in candidates)
        self.prior = np.log([float(counts[c.cause.name]) for c in candidates])
        # What cannot be tested can be a rival, never a name.
        self.penalty = np.where([c.stands_in for c in candidates], np.inf, self.prior)

    def run(self) -> Finding:
        """Run the inference.

        Returns
        -------
        Finding
            Verdict, names, rivals and remainder.
        """
        noise = build_noise(self.misfit, self.rows)
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
        # Bias and slope are lengths: a scatter below what any row has would shrink them with it.
        return noise.draw(normal, ratio, max(scale, 2.0 * noise.floor_in), self.permutations, self.rng)

    def _smallest(self, at_random: Array, scale: float) -> float:
        """Effect whose expected gain clears the alarm with four chances in five: (t − 0.84)² / 2 = bar."""
        bar = float(np.quantile(at_random, 1.0 - ALARM)) + float(np.median(self.penalty))
        return float(scale * (np.sqrt(2.0 * max(bar, 0.0)) + 0.84) / np.sqrt(len(self.misfit)))

    def _named(self, lead: int, p_alarm: float, smallest: float) -> Finding:
        constant = self._constant(lead)
        if constant is not None:
            p, variables = constant
            noise = build_noise(self.misfit, self.rows)
            return Finding("UNLISTED", (), (), (p_alarm,), variables, p, noise, None, smallest, ())
        finding = self._with([lead], [p_alarm], self._second([lead], SECOND_SHARE), smallest)
        if finding.verdict == "UNLISTED":
            # What is left may be a weaker cause of the catalogue: a listed cause goes before an unlisted one.
            weaker = self._second([lead], WEAK_SHARE)
            if weaker is not None:
                again = self._with([lead], [p_alarm], weaker, smallest)
                if again.verdict != "UNLISTED":
                    return again
        return finding

    def _with(
        self, chosen: list[int], p_values: list[float], second: tuple[list[int], float] | None, smallest: float
    ) -> Finding:
        """Check one cause, or two, against their rivals and against what they leave."""
        if second is not None:
            chosen, p_values = second[0], [p_values[0], second[1]]
        rivals: list[int] = []
        behind: dict[Key, float] = {}
        clear = p_values[0] <= NAME
        for place in range(len(chosen)):
            others = [c for k, c in enumerate(chosen) if k != place]
            better, near, rest = self._rivals(chosen[place], others, clear)
            chosen[place] = better
            rivals += near
            behind.update(rest)
        noise, fitted = self._refit(chosen)
        remainder_p, variables, refuted = self._remainder(noise, chosen, fitted)
        ruled_out = tuple(sorted(behind, key=lambda key: behind[key]))
        if refuted:
            return Finding(
                "UNLISTED", (), (), tuple(p_values), variables, remainder_p, noise, None, smallest, ruled_out
            )
        rivals = list(dict.fromkeys(rivals))
        verdict = "AMBIGUOUS" if rivals or not clear else "NAMED"
        return Finding(
            verdict, tuple(chosen), tuple(rivals), tuple(p_values), (), remainder_p, noise, fitted, smallest, ruled_out
        )

    def _constant(self, lead: int) -> tuple[float, tuple[str, ...]] | None:
        """Tell whether a shift of all rows alike explains clearly more than any cause; no listed cause does that.

        What moves besides is looked for with the shift taken out.
        """
        noise = build_noise(self.misfit, self.rows)
        everywhere = np.ones((len(self.misfit), 1))
        both = Screen(noise, np.hstack([everywhere, self.columns[:, [lead]]]), np.array([0, self.signs[lead]]))
        gain = both.run(self.misfit[:, None]).gain[:, 0]
        if gain[0] < gain[1] - self.penalty[lead] + CONSTANT:
            return None
        screen = Screen(noise, self.bank.columns, np.zeros(self.bank.columns.shape[1]), everywhere)
        shapes = screen.run(self.misfit[:, None]).gain[:, 0]
        ratio, scale = screen.tail_ratio(self.misfit)
        p = _chance(np.max(screen.run(self._null(noise, ratio, scale)).gain, axis=0), float(np.max(shapes)))
        variables = self.bank.variables[int(np.argmax(shapes))] if p <= ALARM else ("all rows",)
        return min(p, ALARM), variables

    def _refit(self, chosen: Sequence[int]) -> tuple[NoiseModel, Fit]:
        noise = build_noise(self.misfit, self.rows)
        columns = self.columns[:, list(chosen)]
        fitted = fit(noise, columns, self.misfit)
        noise = build_noise(self.misfit, self.rows, columns @ fitted.values)
        return noise, fit(noise, columns, self.misfit)

    def _second(self, chosen: list[int], least_share: float) -> tuple[list[int], float] | None:
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
        together = screen.pairs(self.misfit, np.array(pool)) - self.penalty[:, None] - self.penalty[pool]
        for place, first in enumerate(pool):
            same = [i for i, c in enumerate(self.candidates) if c.key == self.candidates[first].key]
            together[same, place] = -np.inf
        partner, beside = divmod(int(np.argmax(together)), together.shape[1])
        best = float(together[partner, beside])
        if not np.isfinite(best):
            return None
        pair = [pool[beside], partner]
        pair.sort(key=lambda k: -single[k])
        _noise, fitted = self._refit(pair)
        wrong = [self.signs[k] != 0 and np.sign(v) != self.signs[k] for k, v in zip(pair, fitted.values, strict=True)]
        if any(wrong):
            return None
        sizes = [
            float(np.sqrt(np.mean((self.columns[:, k] * v) ** 2))) for k, v in zip(pair, fitted.values, strict=True)
        ]
        if min(sizes) < least_share * max(sizes):
            return None
        held = Screen(noise, self.columns, self.signs, self.columns[:, [pair[0]]])
        ratio, scale = held.tail_ratio(self.misfit)
        null = self._null(noise, ratio, scale)
        at_random = np.max(held.run(null).gain - self.penalty[:, None], axis=0)
        observed = best - float(np.max(single))
        p = _chance(at_random, observed)
        return (pair, p) if p <= SECOND else None

    def _rivals(self, lead: int, others: Sequence[int], clear: bool) -> tuple[int, list[int], dict[Key, float]]:
        """Best candidate in the lead's place, the rivals that are near it, and how far the rest is behind."""
        noise, _fitted = self._refit([lead, *others])
        screen = Screen(noise, self.columns, self.signs, self.columns[:, list(others)] if others else None)
        gain = screen.run(self.misfit[:, None]).gain[:, 0]
        score = gain - self.prior
        for k in others:
            score[[i for i, c in enumerate(self.candidates) if c.key == self.candidates[k].key]] = -np.inf
        best: dict[Key, int] = {}
        variants: dict[Key, list[int]] = {}
        for k in np.argsort(-score):
            best.setdefault(self.candidates[int(k)].key, int(k))
            variants.setdefault(self.candidates[int(k)].key, []).append(int(k))
        winner = int(np.argmax(np.where(np.isfinite(self.penalty), score, -np.inf)))
        near, behind = [], {}
        for key, k in best.items():
            if key == self.candidates[winner].key or not np.isfinite(score[k]):
                continue
            distance = score[winner] - score[k]
            alike = [gain[i] for i in variants[key] if self._alike(winner, i)]
            if alike:
                # The data hardly tell these two apart: which one has more targets must not decide.
                distance = min(distance, gain[winner] - max(alike))
            # A rival that explains more is never ruled out, however many targets its cause has.
            if gain[k] > gain[winner] or distance < (RULED_OUT if clear else RULED_OUT_FAINT):
                near.append(k)
            elif gain[k] > 2.0:
                behind[key] = float(distance)
        if not clear and not near:
            # Faint evidence never leaves one cause alone: the next best stays possible.
            near = [k for key, k in best.items() if key != self.candidates[winner].key and np.isfinite(score[k])][:1]
            for k in near:
                behind.pop(self.candidates[k].key, None)
        return winner, near, behind

    def _alike(self, a: int, b: int) -> bool:
        first, second = self.columns[:, a], self.columns[:, b]
        return abs(float(first @ second)) > ALIKE * float(np.linalg.norm(first) * np.linalg.norm(second))

    def _remainder(self, noise: NoiseModel, chosen: Sequence[int], fitted: Fit) -> tuple[float, tuple[str, ...], bool]:
        """Chance of the strongest shape in what is left, its variables, and whether it refutes what is named.

        A large remainder of any shape does; a smaller one does if it moves with the named cause's own variable.
        """
        held = self.columns[:, list(chosen)]
        screen = Screen(noise, self.bank.columns, np.zeros(self.bank.columns.shape[1]), held)
        gain = screen.run(self.misfit[:, None]).gain[:, 0]
        ratio, scale = screen.tail_ratio(self.misfit)
        random_gain = screen.run(self._null(noise, ratio, scale)).gain
        self.progress(0.9)
        top = int(np.argmax(gain))
        p = _chance(np.max(random_gain, axis=0), float(gain[top]))
        named = float(np.sqrt(np.mean((held @ fitted.values) ** 2)))
        if p <= REFUTED and self._size(noise, held, top) >= SECOND_SHARE * named:
            return p, self.bank.variables[top], True
        needs = {name for k in chosen for name in self.candidates[k].cause.needs}
        own = [i for i, names in enumerate(self.bank.variables) if set(names) <= needs]
        if own:
            strongest = own[int(np.argmax(gain[own]))]
            p_own = _chance(np.max(random_gain[own], axis=0), float(gain[strongest]))
            if p_own <= REFUTED and self._size(noise, held, strongest) >= OWN_SHARE * named:
                return min(p, p_own), self.bank.variables[strongest], True
        return p, self.bank.variables[top], False

    def _size(self, noise: NoiseModel, held: Array, shape: int) -> float:
        """Standard deviation over the rows of a fitted shape, what is named fitted with it. [in]"""
        both = fit(noise, np.column_stack([held, self.bank.columns[:, shape]]), self.misfit)
        return float(np.std(self.bank.columns[:, shape])) * abs(float(both.values[-1]))


def _chance(at_random: Array, observed: float) -> float:
    """Chance that the largest of many gains is as large by chance.

    Counted where enough drawn maxima lie beyond; further out from the extreme-value distribution (Gumbel) that
    fits them, so that a small chance needs no more drawn sets than a large one.
    """
    beyond = int(np.sum(at_random >= observed))
    if beyond >= _COUNTED:
        return (1 + beyond) / (1 + len(at_random))
    width = max(float(np.std(at_random)) * np.sqrt(6.0) / np.pi, 1e-9)
    place = float(np.mean(at_random)) - np.euler_gamma * width
    fitted = float(-np.expm1(-np.exp(-(observed - place) / width)))
    return max(min(fitted, (1 + beyond) / (1 + len(at_random))), 1e-12)
