"""Every constant that can change a verdict or the improved model: levels and shares, then by step of a diagnosis.

Shares are of one, and levels are of p-values. What changes no verdict, no accepted effect and no number of the improved
model stands where it is used: bounds of rounding errors, how a search converges, and how a report locates a mismatch
and lists results.
"""

from typing import Final

# Levels and shares

# level at which a candidate, a force (both corrected for all tried) or a fitted amplitude is significant, and at which
# a model with more predicts better: several are compared in one diagnosis, at two horizons each
SIGNIFICANCE: Final[float] = 0.01
# level of one test: that a model predicts worse; and of confidence bounds
LEVEL: Final[float] = 0.05
# log Bayes factor from which one explanation is clearly better than another
CLEAR_LOG_BAYES: Final[float] = 3.0
# the larger share of a variance, an error or a score: above it something explains, or keeps, most
MAJORITY: Final[float] = 0.5
# share that is nearly all: of the gain in log evidence of a set, from which its best effect is first fitted by itself;
# of an effect's, which the linearised model without it must restore; of a channel's variance, which simulation in parts
# of a run must follow
NEARLY_ALL: Final[float] = 0.9

# Filter and disturbance

# ratio of rms errors above which one is far above the other: a residual and σ, or what a chosen effect leaves of a
# simulation error and what the best nonparametric force leaves
LARGE_ERROR: Final[float] = 2.0
# prior standard deviation of a coefficient that has none, in units of its size
PRIOR_WIDTH: Final[float] = 10.0
# smaller disturbances under which evidence is computed, of the one estimated without candidates, which holds what is
# missing
DISTURBANCE_SHARES: Final[tuple[float, ...]] = (0.1, 0.003)

# Candidates

# share of a candidate's sensitivity that the free parameters must leave for it to be identifiable
IDENTIFIABLE_SHARE: Final[float] = 1e-4
# length scales of a nonparametric force, of the range of its variable
LENGTH_SCALES: Final[tuple[float, ...]] = (1 / 3, 1 / 10, 1 / 30)

# Structure search

# most effects that one selection takes, with room for two columns each, and waves that are candidates in an equation
MOST_EFFECTS: Final[int] = 4
# alternatives to the best that are tried: rivals fitted in its place, forces whose evidence is computed beside the one
# that predicts most, disturbances estimated for those that lead next, narrower priors, and rounds after the first
ALTERNATIVES: Final[int] = 2
# relative error of a score by linearisation, over the root of the share that the free parameters leave
SCORE_ERROR: Final[float] = 0.03
# share of the squared simulation error that is hardly any: surrogate terms that remove no more are not accepted
MINOR_SHARE: Final[float] = 0.02

# Acceptance

# blocks of each run that the others predict, by simulation; and at least of all runs where candidates are proposed
BLOCKS: Final[int] = 4
# blocks of each run that the others predict, one step ahead: innovations are correlated for less long
BLOCKS_ONE_STEP: Final[int] = 24
# fewest samples of the parts into which a run of an unstable model is cut for simulation
FEWEST_SAMPLES: Final[int] = 8
# share of the squares that a surrogate term must explain, and that an equation in which a number acts must hold
PLACE_SHARE: Final[float] = 0.05

# Verdict

# posterior probability from which an effect is named and not ambiguous
CERTAIN: Final[float] = 0.9
# share of the mismatch that effects must explain to be its cause
EXPLAINED: Final[float] = 0.75
# level at which residuals are correlated in time, or with an input
RESIDUAL_LEVEL: Final[float] = 1e-3
# level at which a mismatch is unknown, and not none, where every effect was rejected
UNEXPLAINED_LEVEL: Final[float] = 1e-6
