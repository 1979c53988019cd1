"""Every constant that decides what a diagnosis names and how sure it is, each with its reason.

Each is a convention of statistics, follows from what the true model with its noise reaches, or is
stated as assumed. Constants that only steer a computation stand beside it.
"""

# ------------------------------------------------------------------------- which causes are named
CLEARLY = 5.0
"""Evidence that a further cause must bring beyond its price. This is very strong evidence by Kass
and Raftery (1995): odds of a hundred and fifty to one."""

AS_GOOD = 3.0
"""Evidence by which a set may fall short of the best one and still be an alternative: odds of
twenty to one."""

UNCONFUSED = 0.1
"""Share of what a suspect explains that may be lost if another one of its class of look-alikes
replaces it, for the two to count as look-alikes. The exact form of neither is known so well. [1]"""

LAW = 0.01
"""Minimum standard uncertainty of what an effect does, as a share of it, because no rig follows the
law of an effect exactly. Assumed; it is about the scatter of twins that follow laws of their
own."""

RARER = 3.0
"""Logarithm of the odds by which an effect of the rig is more likely than a given wrong entry
before the logs are seen: 20 to 1. Most entries of a rig file are right, while every rig has effects
that its model lacks. A wrong entry that replaces two effects still has more evidence, because it
saves the price of one."""

AGREES = 0.03
"""Share by which Vdc over Idc may deviate from a stated load before the load becomes a suspect. It
is more than gains and warm resistors change. [1]"""

MIN_RUNS = 3
"""Minimum number of runs in which a change from run to run is looked for. Of two runs, any
difference would be one."""

CHANCE = 1e-3
"""Probability below which a trend or scatter of a cause is reported: that runs which agree would
show one as large by chance, for any cause."""

# ---------------------------------------------------------------- what a residual says of the fit
REACH = 3.0
"""Limit of the nuisances of a prediction, in standard uncertainties, so that only the causes can
close the gap.
"""

MIN_EXCESS = 0.2
"""Minimum excess of a gap over noise for a closure to be stated: the mean over channels and logs
before the correction, in squares of the noise. [1]"""

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
"""Maximum deviation of a nuisance from its stated value, in its standard uncertainties, that raises
no alarm."""

WORSE = 1.5
"""Root of the increase of the mean square of a channel on held-out logs, over that of its noise,
beyond which the prediction counts as worse; the largest of 65 right models is 1.4. [1]"""

# ------------------------------------------------- what contradicts a fit that leaves no residual
FALSE_ALARM = 0.01
"""Probability with which the right model has any of the energies, or of the efficiencies, of a
campaign beyond its limit."""

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
"""Share of the gap that a cause must close if its number differs from run to run; otherwise it is
dropped. A smaller set of causes must also close this much more on held-out logs to replace a larger
one. [1]"""

LIKELY = 0.5
"""Minimum posterior of each cause for a verdict of `explained`: below it, the cause is more
likely another one. [1]
"""

# ------------------------------------------------------------------------------------ the verdict
HINTS = 2
"""Maximum number of effects that are listed as undecided: they have some evidence, but less than a
cause needs."""

HALF = 0.5
"""Share of the gap that must be closed for the verdict `partly_explained` and not `unexplained`, if
the residual has a structure."""

MOSTLY = 0.9
"""Share of the gap that must be closed for the verdict `explained` if a residual without structure
remains. If a structured residual remains, it is the share from which on a name is a cause and not a
candidate."""

MARGIN = 1.5
"""Multiple of its limit up to which an alarm leaves a name a cause and not a candidate. [1]"""
