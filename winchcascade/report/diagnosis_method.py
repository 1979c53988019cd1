"""The method of a diagnosis in short, for its report; `docs/diagnosis.md` tells all of it."""

from __future__ import annotations

from winchcascade.diagnosis.block_means import BLOCK
from winchcascade.diagnosis.causes import AS_GOOD
from winchcascade.diagnosis.remainder import PULLED, RESTLESS, ROUGH
from winchcascade.diagnosis.selection import CLEARLY
from winchcascade.diagnosis.solve import HUBER

METHOD = (
    "Model. Each log's line motion drives a model of the rig with the numbers of the rig file (Hsu et al. 2026, Tables 3 "
    "and 4; the diode bridge as a switched circuit). The file is taken as given and never calibrated first.",
    f"Blocks. Logs and simulations are averaged over blocks of about {BLOCK:g} s within one phase, a period of the "
    "tether's ringing, which cancels with most of the correlation between samples. The noise of a block comes from the "
    "log itself: fourth differences of its samples, the velocity's noise carried through the model, and second "
    "differences from block to block.",
    "Tolerances. Numbers of the rig file, loads, gains, timing and zeros of the sensors are known only so well. Every fit "
    "adjusts them too, each held to its stated value by its standard uncertainty (a normal prior); so it does a little dry "
    "friction that no rig is free of. A deviation within them is not a cause.",
    f"Fit. Residuals over their noise count by Huber's loss (Huber 1964, corner at {HUBER:g}) plus half the squares of those "
    "adjustments in standard uncertainties; steps by Gauss and Newton within bounds (Lawson and Hanson 1974).",
    "Choice. A set of effects is worth the logarithm of its evidence (Laplace; MacKay 2003, ch. 28): minus the loss, minus "
    "what its free numbers cost over their plausible range, minus ln 28 for each effect. Sets are screened by the slopes of "
    "one fit and the best are fitted anew. The smallest set wins unless a larger one has more by "
    f"{CLEARLY:g}. The probabilities are those among the sets that were fitted; an effect that falls short by less than "
    f"{AS_GOOD:g} in place of a cause is its rival.",
    "Closure. Each withheld log is predicted by a fit that did not know it. With mean squares of blocks, share = 1 − "
    "Σ(after² − noise²)/noise² ÷ Σ(before² − noise²)/noise² over channels and logs; the zeros of each log's sensors are "
    "estimated alike on either side. The interval resamples the cycles.",
    f"Alarms. A remainder is called structured if blocks of a channel and phase exceed {ROUGH:g} times their noise, if the "
    f"scatter within blocks exceeds {RESTLESS:g} times what noise explains, or if a number with a tolerance had to "
    f"move by more than {PULLED:g} of its standard uncertainties.",
    "Limits. Only effects of the catalogue can be named; what none of them explains is told as a remainder. The "
    "intervals assume that the stated tolerances hold. Two effects that do the same to these logs are rivals, whatever "
    "the probability of each. At rest force and torque say next to nothing.",
)
"""Paragraphs: what is done, by which formula, and what that leaves open."""
