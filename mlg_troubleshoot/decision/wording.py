"""How the decision writes probabilities and what stands on them."""

from __future__ import annotations

from mlg_troubleshoot.decision.assessment import Confidence, Rigging


def percent(share: float) -> str:
    """Write a probability as a percentage that is never rounded to a 0 or a 100 that it is not.

    Parameters
    ----------
    share : float
        Probability. [1]

    Returns
    -------
    str
        ``0 %``, ``< 0.1 %``, ``2.5 %``, ``25 %``, ``97.5 %``, ``> 99.9 %``, ``100 %``.
    """
    if 0.0 < share < 0.001:
        return "< 0.1 %"
    if 0.999 < share < 1.0:
        return "> 99.9 %"
    near_an_end = 0.0 < share < 0.1 or 0.9 < share < 1.0
    return f"{100.0 * share:.{1 if near_an_end else 0}f} %"


def confidence_words(confidence: Confidence | None) -> str:
    """Say beside a probability what Monte Carlo with the curved response gives.

    Parameters
    ----------
    confidence : Confidence or None
        The check; None if there is none.

    Returns
    -------
    str
        Words in brackets, or nothing.
    """
    if confidence is None:
        return ""
    error = max(100.0 * confidence.standard_error, 0.01)
    return f" (Monte Carlo {100.0 * confidence.monte_carlo:.2f} ± {error:.2f} %)"


def rigging_sentence(rigging: Rigging) -> str:
    """Say what re-rigging alone would do.

    Parameters
    ----------
    rigging : Rigging
        The alternative.

    Returns
    -------
    str
        One sentence.
    """
    return (
        f"Re-rigging alone (plunger shifted by {rigging.shift_in:+.4f} in) would leave a worst case of "
        f"{rigging.predicted_displacement_in:.4f} in: probability within the margin "
        f"{percent(rigging.probability_within_margin)}, chance of leaving it with random directions "
        f"{percent(rigging.probability_exceed_random_directions)}; the joints stay worn."
    )
