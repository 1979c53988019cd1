"""The method of a diagnosis in short, for its report; `docs/diagnosis.md` has all of it."""

from __future__ import annotations

from winchcascade.core.rig_file import ModelAccuracy
from winchcascade.diagnosis.block_means import BLOCK, LEAST_SAMPLES
from winchcascade.diagnosis.causes import AS_GOOD
from winchcascade.diagnosis.closure import PULLED, RESTLESS, ROUGH
from winchcascade.diagnosis.evidence import CLEARLY
from winchcascade.diagnosis.line.line_diagnose import SLOW, LineDiagnosis
from winchcascade.diagnosis.line.line_selection import DRAWS, FOLDS, MATERIAL
from winchcascade.diagnosis.solve import HUBER
from winchcascade.diagnosis.stability import CHANCE
from winchcascade.report.line_words import slope_words
from winchcascade.rig.effects.catalogue import OF_THE_RIG

METHOD = (
    "Model. Each log's line motion drives a model of the rig with the numbers of the rig file (Hsu et al. 2026, Tables 3 "
    "and 4; the diode bridge as a switched circuit). The numbers of the file enter unchanged; none is calibrated first.",
    f"Blocks. Logs and simulations are averaged over blocks of about {BLOCK:g} s within one phase, a period of the "
    f"tether's ringing, which cancels with most of the correlation between samples; below {LEAST_SAMPLES / BLOCK:.0f} Hz a "
    f"block is longer and holds about {LEAST_SAMPLES:.0f} samples. The noise of a block comes from the "
    "log itself: fourth differences of its samples, the velocity's noise carried through the model, and second "
    "differences from block to block.",
    "Tolerances. Numbers of the rig file, loads, gains, timing and zeros of the sensors are known only so well. Every fit "
    "adjusts them too, each held to its stated value by its standard uncertainty (a normal prior); so it does a little dry "
    "friction that no rig is free of. No model is exact: a channel may deviate by a share of its plateau in the log that "
    f"the rig file states ({100.0 * ModelAccuracy().discrepancy:g} % by default) and that more data do not average. A "
    "deviation within these is not a cause.",
    f"Fit. Residuals over their noise count by Huber's loss (Huber 1964, corner at {HUBER:g}) plus half the squares of those "
    "adjustments in standard uncertainties; steps by Gauss and Newton within bounds (Lawson and Hanson 1974).",
    "Choice. A set of effects is worth the logarithm of its evidence (Laplace; MacKay 2003, ch. 28): minus the loss, minus "
    f"what its free numbers cost over their plausible range, minus ln {len(OF_THE_RIG)} for each effect. Sets are screened "
    "by the slopes of one fit and the best are fitted anew. The smallest set wins unless a larger one has more by "
    f"{CLEARLY:g}. The probabilities are those among the sets that were fitted; an effect that falls short by less than "
    f"{AS_GOOD:g} in place of a cause is an alternative to it.",
    "Run by run. About the joint fit the objective is a quadratic; one linear solve per run gives the number of a cause from "
    "that run alone. Straight lines over the order of the runs and over the conductance of the load, and the scatter, are "
    f"tested by generalised least squares with what the runs share in their covariance, at a probability of {CHANCE:g}.",
    "Intervals. 95 % with equal tails: the number found ± 1.96 standard uncertainties of the joint fit (normal distribution, "
    "infinitely many degrees of freedom), which contain the tolerances; at a bound one-sided, 1.645 standard uncertainties.",
    "Closure. Each withheld log is predicted by a fit without it. With mean squares of blocks, share = 1 − "
    "Σ(after² − noise²)/noise² ÷ Σ(before² − noise²)/noise² over channels and logs; the zeros of each log's sensors are "
    "estimated alike on either side. The interval resamples the cycles.",
    f"Alarms. A residual counts as structured if blocks of a channel and phase exceed {ROUGH:g} times their noise, if the "
    f"scatter within blocks exceeds {RESTLESS:g} times what noise explains, or if a number with a tolerance had to "
    f"move by more than {PULLED:g} of its standard uncertainties.",
    "Limits. Only effects of the catalogue can be named; what none of them explains is reported as a residual. The "
    "intervals assume that the stated tolerances hold. Two effects that do the same to these logs are alternatives, whatever "
    "the probability of each. At rest, line tension and torque contain almost no information.",
)
"""Paragraphs: what is done, by which formula, and what that leaves open."""


STAGE_BY_STAGE = (
    "The map reads end to end: the motion of the line alone drives the model. A deviation of one stage therefore shows in "
    "those behind it, and upstream through torque and line tension. Stage by stage each stage has its own inputs from the log "
    "instead, which shows where the gap arises. A deviating sensor shows in every stage that it feeds or ends."
)
"""What the two maps of the gap show."""

YARDSTICKS = (
    "A difference counts only against what could make it by chance. Three yardsticks make up its standard uncertainty: "
    "the noise of the sensors and the zero of each log's sensor; how the cycles of a log repeat; and how well the "
    "numbers of the rig file, the loads and the gains of the sensors are known, carried through the simulation. Line "
    "tension and torque are compared only while the line moves: at rest friction just bounds them."
)
"""What the standard uncertainty of a place of the gap is made of."""


def line_method(found: LineDiagnosis) -> tuple[str, ...]:
    """Paragraphs on the method without a model."""
    return (
        "Balance. The power of the shaft follows from the line by P = v (F − m dv/dt − F₀ sgn v − b v), with the line's speed "
        "v and force F, positive in reel-out: m is what turns with the line, as a mass on it, F₀ a constant friction and b a "
        "drag over speed. A gain or a zero of the force cell changes F. The power is linear in all of them, and none is known "
        "beforehand: no drum radius, inertia or loss of the rig file enters.",
        f"Acceleration. It is the {slope_words(found)}; at most 0.4 s, as more would blur what the winch does. Withheld "
        "cycles do not take part in that choice.",
        "Choice. Each of the sets of suspects is fitted by least squares within its bounds (m, F₀, b not negative; the force "
        "cell within the catalogue) without each cycle in turn, and predicts that cycle. Of the sets whose error is within one "
        f"standard error over cycles of the minimum (Breiman et al. 1984), or within {100.0 * MATERIAL:g} % of the gap, the "
        f"smallest is chosen; a cause that closes less than {100.0 * MATERIAL:g} % is left out. With fewer than {FOLDS} cycles "
        "each is cut into pieces.",
        f"Probability. The cycles are resampled {DRAWS} times, with the errors that each set made of them, and the same rule "
        "chooses: the probability of a set is how often it is chosen, that of a cause how often a set with it is. It shows how "
        "far the choice depends on which cycles were logged, not whether the list of suspects is complete.",
        "Intervals. 95 %, from the scatter of each cycle's scores, so correlation within a cycle is allowed for (Liang and "
        "Zeger 1986), with Student's t. The effect of the width of the slope is estimated with another width and added.",
        "Closure. 1 − Σ after² ÷ Σ before² over the samples of held-out cycles; its interval resamples them.",
        f"Structure. The residual has a structure if more than {100.0 * SLOW:.0f} % of its squares last longer than a "
        f"second, or if means of blocks are more than {ROUGH:g} times their noise by second differences in a phase, and "
        "either makes more than 1 % of the squared gap.",
        "Limits. A loss that grows with the line tension alone looks like a gain of the force cell. Inertia that changes with "
        "the tether on the drum, and losses that change with temperature, are reported as a mean; the numbers of the withheld "
        "cycles alone show how far they move. What is faster than the samples is seen as noise.",
    )
