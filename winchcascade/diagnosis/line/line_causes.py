"""What is reported of each cause: its number with an interval, how sure it is, and which suspects would do in its place."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np
from scipy.special import stdtrit

from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.diagnosis_result import Alternative, NamedCause, Reported, Spot
from winchcascade.diagnosis.line.line_data import NUMBERS, POWER, beside, with_span
from winchcascade.diagnosis.line.line_selection import coefficients, moments_of

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.line.line_data import Lines
    from winchcascade.diagnosis.line.line_selection import Choice, Moments, Names
    from winchcascade.diagnosis.suspects import Suspects

RIVALS = 2
"""So many rivals of each cause are named at most."""

LIKELY = 0.05
"""A set that resampled cycles choose this often is a rival even where the cycles at hand tell it from the chosen one."""


def causes_of(lines: Lines, m: Moments, choice: Choice, suspects: Suspects) -> tuple[NamedCause, ...]:
    """Every cause of the chosen set, the one that closes most first."""
    x = coefficients(m, lines, choice.chosen)
    u = uncertainty_of(lines, m, choice.chosen)
    causes = []
    for name in choice.chosen:
        without = tuple(n for n in choice.chosen if n != name)
        causes.append(
            NamedCause(
                effect=name,
                stage=suspects[name].stage,
                probability=sum(p for names, p in choice.probability.items() if name in names),
                parameters={NUMBERS[name][0]: reported(lines, name, x, u)},
                rivals=_rivals(lines, m, choice, name),
                weight=choice.error(without) - choice.error(choice.chosen),
            )
        )
    return tuple(sorted(causes, key=lambda cause: -cause.weight))


def again_alone(lines: Lines, names: Names) -> dict[str, Reported]:
    """The numbers of a set as the withheld parts alone give them, by effect; nothing where none is withheld."""
    parts = tuple(part for part in lines.parts if part.withheld)
    if not parts:
        return {}
    alone = msgspec.structs.replace(lines, parts=tuple(msgspec.structs.replace(part, withheld=False) for part in parts))
    m = moments_of(parts)
    x, u = coefficients(m, alone, names), uncertainty_of(alone, m, names)
    return {name: reported(alone, name, x, u) for name in names}


def covariance_of(lines: Lines, m: Moments, names: Names) -> Signal:
    """Covariance of the coefficients of a set, (suspects, suspects), 0 for those outside it or at a bound.

    Samples of one fold are no independent numbers: what varies is the sum of its scores (Liang and Zeger 1986), with G / (G -
    1) for G folds. A wider span for the slope of the velocity moves the numbers too, as either blurs what is fast: what the
    span in use blurs follows from two of them and is added as a standard uncertainty, in the diagonal.
    """
    x = coefficients(m, lines, names)
    inside = np.array(
        [k for k, name in enumerate(lines.names) if name in names and lines.low[k] < x[k] < lines.high[k]],
        dtype=np.intp,
    )
    found = np.zeros((x.size, x.size))
    if inside.size:
        within = np.ix_(inside, inside)
        scores = (m.slope - m.curve @ x)[:, inside]
        inverse = np.linalg.pinv(m.curve.sum(axis=0)[within], hermitian=True)
        found[within] = m.folds / (m.folds - 1.0) * inverse @ scores.T @ scores @ inverse
        found[inside, inside] += (_blurred(lines, names) ** 2)[inside]
    return found


def _blurred(lines: Lines, names: Names) -> Signal:
    """What the span of the slope moves each coefficient from where none would be, (suspects,), as another span tells.

    The slope of a quadratic over k samples on either side is off by the third derivative times (3 k^2 + 3 k - 1) / 5, in
    squares of the step (Savitzky and Golay 1964).
    """
    other = next((span for span in lines.spans if span > lines.span), lines.spans[max(len(lines.spans) - 2, 0)])
    if other == lines.span or "drum_inertia" not in names:
        return np.zeros(len(lines.names))
    there = with_span(lines, other)
    counts = (beside(lines.parts[0].run, span) for span in (lines.span, other))
    own, its = ((3.0 * k * k + 3.0 * k - 1.0) / 5.0 for k in counts)
    moved = coefficients(moments_of(there.fitted), there, names) - coefficients(moments_of(lines.fitted), lines, names)
    blurred: Signal = moved * own / (its - own)
    return blurred


def uncertainty_of(lines: Lines, m: Moments, names: Names) -> Signal:
    """Half the width of the 95 % interval of each coefficient of a set, (suspects,); Student's t for few folds."""
    wide: Signal = np.sqrt(np.diag(covariance_of(lines, m, names))) * float(stdtrit(m.folds - 1, 0.975))
    return wide


def reported(lines: Lines, name: str, x: Signal, u: Signal) -> Reported:
    """What is reported of a suspect with coefficients x and half intervals u, (suspects,) each."""
    k = lines.names.index(name)
    low, high = max(float(x[k] - u[k]), float(lines.low[k])), min(float(x[k] + u[k]), float(lines.high[k]))
    if name == "force_gain":  # F_read = (1 + g) F turns h = 1 / (1 + g) - 1 round
        ends = [-h / (1.0 + h) for h in (float(x[k]), high, low)]
        return Reported(ends[0], ends[1], ends[2], NUMBERS[name][1])
    factor = 1.0
    if name == "force_zero" and "force_gain" in lines.names:
        factor = 1.0 / (1.0 + float(x[lines.names.index("force_gain")]))
    return Reported(float(x[k]) * factor, low * factor, high * factor, NUMBERS[name][1])


def _rivals(lines: Lines, m: Moments, choice: Choice, name: str) -> tuple[Alternative, ...]:
    """Suspects in place of a cause with which the set predicts as well, best first."""
    found = [
        (choice.error(swapped), other, swapped)
        for other, swapped in swaps_of(lines, choice, name)
        if choice.as_good(swapped) and (choice.even(swapped) or choice.probability[swapped] >= LIKELY)
    ]
    return tuple(
        Alternative(other, choice.probability[swapped], _difference(lines, m, choice.chosen, swapped))
        for _, other, swapped in sorted(found)[:RIVALS]
    )


def swaps_of(lines: Lines, choice: Choice, name: str) -> list[tuple[str, Names]]:
    """Sets with another suspect in place of one cause, and which."""
    kept = [n for n in choice.chosen if n != name]
    others = [n for n in lines.names if n not in choice.chosen]
    return [(other, tuple(n for n in lines.names if n in (*kept, other))) for other in others]


def _difference(lines: Lines, m: Moments, one: Names, other: Names) -> Spot:
    """In which phase two sets differ most, as a root mean square."""
    apart = coefficients(m, lines, one) - coefficients(m, lines, other)
    sums, counts = np.zeros(len(PHASES)), np.full(len(PHASES), 1e-9)
    for part in lines.parts:
        mean = part.means(part.columns @ apart)
        for phase in range(len(PHASES)):
            here = (part.blocks.phase == phase) & np.isfinite(mean)
            sums[phase] += float(np.sum(mean[here] ** 2))
            counts[phase] += float(np.count_nonzero(here))
    worst = int(np.argmax(sums))
    return Spot(POWER, PHASES[worst], bias=float((sums / counts)[worst]) ** 0.5)
