"""The numbers that a survey is tuned by, each with its meaning and unit.

Where no other source is named a number is a choice of this project; what moves if it changes is
shown by ``python tests/benchmarks/bench_survey.py``.
"""

from __future__ import annotations

from mlg_troubleshoot.units import MM_PER_IN, SLIPS, Slip

# The prior. Share of the ensemble's covariances that is believed: its members were sought by
# one method. [1]
COVARIANCE_SHARE = 0.5
# Standard deviations of a gear file without an ensemble: half of the linkage's size, thirty
# degrees. [1, degrees]
ALONE_SIZE = 0.5
ALONE_ANGLE = 30
# The ensemble's spread counts as at least this share of those. [1]
LEAST_SPREAD = 0.01
# Draws of the prior that give one linkage that closes. [1]
DRAWN_FOR_ONE = 5
# Draws of the prior that are starts in addition to the ensemble. [1]
STARTS = 80
# With fewer readings than this share of the numbers of the linkage few of them are determined. [1]
FEW = 0.6

# The robust fit. Uncertainties are widened by these factors in turn: a wide one sees past
# false minima. [1]
WIDENED = (300, 100, 30, 10, 3, 1)
# Steps at each, steps of the last one, dampings tried in a step, and modes that are left. [1]
STEPS_EACH = 6
LAST_STEPS = 25
DAMPINGS = 8
MOST_MODES = 6
# Loss of a reading where the linkage is open: as of ten standard uncertainties. [1]
OPEN_LOSS = 100
# Errors of sound readings have a Student distribution of so many degrees of freedom. [1]
FREEDOM = 4
# One reading in a hundred is a slip, anywhere within some twenty inches: minus twice the logarithm
# of that density over the one at no error. Without a limit one large slip would cost more than a
# wrong linkage with small ones. [1]
SLIP_LOSS = 23
# Readings within as many of their uncertainties of the robust fit are believed at first. [1]
TRUSTED = 6
# The best few are fitted again with uncertainties widened so far. [1]
REHEATED = (10, 3)
# Points around each where all readings are believed and where not, steps of each, and whitened
# distance from which two points are two. [1]
FITTED_AGAIN = 12
TRIED_AROUND = 100
REHEAT_STEPS = 4
POINTS_APART = 0.03

# Slips. The greatest of forty sound residuals exceeds 3.9 in 0.4 % of surveys, in about 1 % where
# the fit bends: a lower bar accuses sound readings. [1]
MISFIT = 3.9
# Two readings contradict each other, neither of them alone is wrong, if leaving out one or the
# other fits alike: losses within three standard deviations. [1]
ALIKE_LOSS = 9
# With more misfits than this share of the readings nobody knows which of them to believe. [1]
MOST_MISFITS = 0.1
# One reading in a hundred is exchanged, with any of twenty others: minus twice the logarithm. [1]
EXCHANGE_LOSS = 16
# In search of a slip: as many starts as make so many residuals, so many steps each; so many starts
# are left at least. [1]
MOST_RESIDUALS = 175_000
STEPS_LEFT_OUT = 3
FEWEST_STARTS = 60
# What a tape or a scale is misread by: an inch, its half, quarter and eighth, a tenth. [in]
MISREAD_IN = (1, 1 / 2, 1 / 4, 1 / 8, 1 / 10)
SURVEY_SLIPS = (
    SLIPS["unit"],
    Slip(MM_PER_IN / 10, "centimetres read as inches", "inches read as centimetres"),
    SLIPS["point"],
)

# Modes and draws. Two points of the posterior are one if they stand on the same sides and no index
# differs by more than this share; a mode below the second share of the posterior is left out. [1]
SAME_INDEX = 0.01
LEAST_WEIGHT = 0.001
# A joint's other side is tried where the readings place the joint: to a fifth of its distance from
# the line between. [1]
PLACED = 0.2
# Draws of the posterior, the steps of each, and how often one is begun. [1]
DRAWS = 150
DRAW_STEPS = 8
DRAW_ROUNDS = 3
# Shares of a mode's own pull at which a draw may begin. [1]
ALONG_PULL = (0, 0.1, 0.3, 1)
# A draw is one of the posterior if its loss is at most so many standard deviations of a chi-squared
# variable too large. [1]
FAR = 6
# Stages of a fit that are shown: the search, that of slips, misfits, the modes, the draws. [1]
STAGES = 5

# The plan. Between each two members of the ensemble a template is planned for linkages at these
# shares of the way, where they close. [1]
BETWEEN = (1 / 4, 1 / 2, 3 / 4)
# An index known to two percent needs no better reading. [1]
WELL_KNOWN = 0.02
# A reading counts as checked by the others if they predict it to three times its own uncertainty:
# 1 / (1 + 3²) of its information is its own. [1]
CHECKED = 1 / (1 + 3**2)
# Rounds in which readings of a plan are exchanged at most. [1]
SWEEPS = 8
# What a check by the others is worth compared with a well-known index, and what a reading that
# nobody checks counts as checked. [1]
BRACING = 0.2
LOOSE = 0.02
# A reading that narrows less than this is not worth taking; one that more of the draws cannot reach
# is not possible. [1]
LEAST_NARROWING = 0.01
MOST_OPEN = 0.05
