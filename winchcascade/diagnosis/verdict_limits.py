"""Every constant that decides what a diagnosis names and how sure it is, each with its reason.

Each is a convention of statistics, follows from what the true model with its noise reaches, or is
stated as assumed. Constants that only steer a computation stand beside it.
"""

# ------------------------------------------------------------------------- which causes are named
CLEARLY = 5.0
"""A further cause must bring so much more evidence, its price paid: very strong by Kass and Raftery
(1995), odds of a hundred and fifty to one."""

AS_GOOD = 3.0
"""Evidence by which a set may fall short of the best and still be an alternative: odds of twenty
to one.
"""

UNCONFUSED = 0.1
"""Two suspects of one class of look-alikes explain each other if one in place of the other loses
less than this share of what that explains: the exact form of neither is known so well. [1]"""

LAW = 0.01
"""No rig follows the law of an effect exactly: minimum standard uncertainty of what an effect does,
as a share of it. Assumed; about the scatter of twins that follow laws of their own."""

RARER = 3.0
"""Logarithm of the odds by which an effect of the rig is more likely than a given wrong entry, data
apart: 20 to 1. Most entries of a rig file are right, while every rig has effects that its model
lacks. A wrong entry that takes the place of two effects still has more evidence, as it saves the
price of one."""

AGREES = 0.03
"""A load is no suspect where Vdc over Idc deviates from it by less: more than gains and warm
resistors do. [1]
"""

MIN_RUNS = 3
"""Minimum number of runs of which a change from run to run is suspected: of two, any difference
is one.
"""

CHANCE = 1e-3
"""Trends and scatters are reported if runs that agree would show one as large, of any cause,
with a smaller probability.
"""

# ---------------------------------------------------------------- what a residual says of the fit
REACH = 3.0
"""Limit of the nuisances of a prediction, in standard uncertainties, so that only the causes can
close the gap.
"""

MIN_EXCESS = 0.2
"""Minimum excess over noise of a gap before, on average over channels and logs and in squares of
noise, to be closed.
"""

ROUGH = 2.5
"""Root mean square of whitened blocks of a stage without a model, beyond which they contain a
structure."""

SELDOM = 0.0075
"""Share of campaigns with the right model, of all sizes, rates and noises, that pass each limit of
the residual, by the distribution of the largest comparison of 65 campaigns: `benchmarks/alarms.py`.
With four of them and `FALSE_ALARM` twice, 5 % of right models have an alarm. [1]"""

STRUCTURED = 1.8
"""Root mean square of whitened blocks, of one channel in one phase over all logs, beyond which they
contain a structure."""

RESTLESS = 2.5
"""Scatter within blocks, over that of noise and discrepancy of the model, beyond which something
moves that the model lacks.
"""

UNSTEADY = 4.5
"""Scatter of the blocks about a smooth course over that of noise alone, the median of the logs,
beyond which something varies that the model lacks: an eccentric drum, teeth."""

PULLED = 5.0
"""Maximum magnitude of a nuisance, in its tolerances, that counts as within tolerance."""

WORSE = 1.5
"""Root of the mean square by which a held-out prediction makes a channel worse, over that of its
noise, beyond which it counts; the largest of 65 right models is 1.4. [1]
"""

# ------------------------------------------------- what contradicts a fit that leaves no residual
FALSE_ALARM = 0.01
"""Probability with which the right model leaves any of the energies, or of the efficiencies, of
a campaign beyond its limit.
"""

CANCELLED = 0.2
"""Two causes cancel each other in a channel if both together move it by less than this share of
what the smaller moves. [1]
"""

CANCELLED_SHARE = 0.01
"""Minimum change of a channel that is worth being cancelled, as a share of its plateau: five
discrepancies of the model. [1]
"""

OPEN = 0.9
"""Maximum posterior of a cause while something outside the catalogue acts, which a cause may
imitate. Assumed. [1]
"""

DISPENSABLE = 0.005
"""Share of the gap that a cause whose number differs from run to run must close, or it is none; and
by which a smaller set must close more on held-out logs to be preferred. [1]"""

LIKELY = 0.5
"""Minimum posterior of each cause for a verdict of `explained`: below it, the cause is more
likely another one. [1]
"""

# ------------------------------------------------------------------------------------ the verdict
HINTS = 2
"""Maximum number of hints: effects with some evidence, though less than a cause needs."""

HALF = 0.5
"""Share of the gap that must be closed for a structured residual not to make it unexplained."""

MOSTLY = 0.9
"""Share of the gap that must be closed for a verdict of `explained` while a residual without
structure remains, and for a cause to be more than a candidate while one remains."""

MARGIN = 1.5
"""Multiple of its limit up to which a sign leaves a cause more than a candidate. [1]"""
