"""Sentences on parts of a diagnosis: where the gap lies, trends, the next run; as plain texts."""

from __future__ import annotations

import math
from collections.abc import Sequence

from winchcascade.core.quantity import Unit, find_unit
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import (
    DiagnosisResult,
    Experiment,
    NamedCause,
    Place,
    Reported,
    Spot,
    Trend,
)
from winchcascade.diagnosis.explain.gap_map import STANDS_OUT
from winchcascade.diagnosis.explain.planned_run import BACK, HOLD, RAMP
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.diagnosis.stages.diagnose_stages import StageDiagnosis
from winchcascade.report.diagnosis_names import (
    NAMES,
    at_words,
    channel_words,
    has_own_simulation,
    items_of,
    number_words,
    phase_words,
    runs_with_number,
    shown_as,
    signed,
    spot_words,
    word_of,
)
from winchcascade.report.glossary import CHANNELS, upper
from winchcascade.report.results.effects import called
from winchcascade.report.wording import load_words
from winchcascade.rig.effects.effect import Effect, Stated

FAR_ENOUGH = 3.0
"""Minimum expected difference, in standard deviations, at which an experiment distinguishes two
effects.
"""


def closure_kind(found: DiagnosisResult) -> str:
    """Whether the data on which the causes are judged took part in their choice: `held_out` if
    not.
    """
    if isinstance(found, StageDiagnosis):
        return "held_out" if any(part.withheld for part in found.data.parts) else "leave_one_out"
    return (
        "held_out"
        if isinstance(found, ModelDiagnosis) and found.data.withheld
        else "leave_one_load_out"
    )


def place_sentence(found: DiagnosisResult) -> str:
    """Where the gap lies: in which direction, at what currents and speeds, by how much, and in
    which stage it arises.

    Empty without a gap. Only where the causes explain the gap, a wrong entry is
    called its origin.
    """
    where = found.where
    if where is None:
        return ""
    worst = where.worst
    if isinstance(found, StageDiagnosis):
        into = next(path.into for path in found.data.paths if path.channel == worst.channel)
        bias, rms = (
            power_text(abs(x), math.hypot(worst.bias, worst.rms)) for x in (worst.bias, worst.rms)
        )
        return (
            f"{where.stage}: in {phase_words(worst.phase)} the {word_of(found)} "
            f"{channel_words(worst.channel)} lies {bias} "
            f"{'above' if worst.bias > 0.0 else 'below'} that of {into.where or into.name} on "
            f"average "
            f"(z = {worst.z:+.0f}), {rms} rms; that phase holds {100.0 * worst.share:.0f} % of "
            f"the squared gap."
        )
    region = ""
    if worst.phase == "payout" and math.isfinite(where.rpm[0]):
        region = f" between {where.rpm[0]:.0f} and {where.rpm[1]:.0f} rpm"
        if where.i_dc[1] > 0.5:
            region += f" and {max(where.i_dc[0], 0.0):.1f} to {where.i_dc[1]:.1f} A DC"
    entry = (
        "comes from a wrong entry"
        if found.verdict == "explained"
        else "is most like that of a wrong entry"
    )
    place = {"sensor": "lies in a sensor", "entry": entry}.get(
        where.stage, f"lies in the {where.stage} stage"
    )
    gap = "The gap between your simulation and the logs" if has_own_simulation(found) else "The gap"
    lies = f"{gap} {place}: {_deviates(worst, where.size, region)}by up to {size_text(worst.channel, where.size)}."
    return f"{lies} {arises_sentence(where.arises)}".rstrip()


def arises_sentence(own: Sequence[Place] | None) -> str:
    """In which stage a gap arises when each stage has its logged inputs."""
    if own is None:
        return ""
    inputs = "With logged inputs to each stage,"
    if not own:
        return f"{inputs} no stage deviates by more than {STANDS_OUT:g} standard uncertainties."
    *others, last = [place.stage for place in own]
    stages = (
        f"the {', '.join(others)} and {last} stages deviate, the {own[0].stage} most"
        if others
        else ""
    )
    size = size_text(own[0].channel, own[0].bias)
    which = stages or f"only the {last} stage deviates"
    return f"{inputs} {which}: {_deviates(own[0], own[0].bias)}by {size} in the mean."


def _deviates(worst: Place, bias: float, region: str = "") -> str:
    """In which direction a channel deviates, by the sign of measured minus simulated, and at
    which load it does so most.
    """
    return (
        f"{NAMES[worst.channel]} is {'over' if bias < 0.0 else 'under'}-predicted during "
        f"{phase_words(worst.phase)}{region}, "
        f"most clearly{at_words(worst.load)}, "
    )


def size_text(channel: str, size: float) -> str:
    """The magnitude of a difference with its unit, from SI units.

    >>> size_text("pressure", -98066.5), size_text("torque", 12.345)
    ('1 kg/cm2', '12.3 N m')
    """
    term = CHANNELS[channel]
    return f"{abs(size) * term.factor:.3g} {term.unit.replace('.', ' ')}"


def stated_text(effect: Effect) -> str:
    """The stated number of a wrong entry in the unit of the rig file, or of a load; empty for
    the scale of the motion.
    """
    stated = effect.entry or Stated()
    if stated.log >= 0:
        return f"{stated.value:#.3g} ohm"
    scale = find_unit(stated.unit) or Unit("number", 1.0)
    unit = "" if stated.unit in ("", "1") else f" {stated.unit}"
    return f"{stated.value / scale.factor:#.3g}{unit}" if effect.number else ""


_ALONG = {"order": "The order of the runs", "load": "Their loads"}
"""What a number may change along, as a sentence calls it."""


def trend_sentence(found: DiagnosisResult, cause: NamedCause, trend: Trend) -> str:
    """What differs between the numbers of a cause from single runs."""
    how, item = shown_as(found, cause), "cycle" if isinstance(found, StageDiagnosis) else "run"
    name = f"{called(cause.effect, found.suspects)}: {how.what}"
    if trend.along == "scatter":
        change = float(f"{trend.change * how.factor:.2g}")
        size = f"{change:g} {how.unit}".rstrip()
        return (
            f"{name} differs from {item} to {item} by up to {size}, more than its intervals allow."
        )
    half = COVERED * trend.u
    reported = Reported(trend.change, trend.change - half, trend.change + half, "")
    value, interval = number_words(how, reported)
    sign = "+" if trend.change > 0.0 and not how.signed else ""
    numbers = runs_with_number(cause)
    if trend.along == "order":
        names = items_of(found)
        ends = f"from {names[numbers[0]]} to {names[numbers[-1]]}, in the order of the {item}s"
    else:
        loads = sorted((found.runs[k].load or math.inf for k in numbers), reverse=True)
        ends = f"from {load_words(loads[0], 'ohm')} to {load_words(loads[-1], 'ohm')}"
    instead = "" if trend.instead is None else f" {_ALONG[trend.instead]} would explain it as well."
    return f"{name} changes by {sign}{value} (95 %: {interval}) {ends}, more than its intervals allow.{instead}"


def differs_text(spot: Spot | None) -> str:
    """Where a cause and its alternative differ most.

    >>> differs_text(Spot("idc", "payout", 4.5, z=458.52)), differs_text(Spot("power_mech", "hold", bias=12.3))
    ('idc during payout at 4.5 ohm, where they differ by 458.5 sigma', 'power_mech during hold, by 12 W rms')
    """
    if spot is None:
        return "nothing that these logs measure"
    if spot.load is None:
        return f"{spot_words(spot, {})}, by {spot.bias:.0f} W rms"
    return f"{spot_words(spot, {})} at {load_words(spot.load, 'ohm')}, where they differ by {spot.z:.1f} sigma"


def profile_words(plan: Experiment) -> str:
    """The motion of a planned run.

    >>> from winchcascade.diagnosis.diagnosis_result import Experiment
    >>> profile_words(Experiment("scaled", 150.0, ("a", "b"), 3.0, force=20.0, axes=("speed", "torque")))
    'the campaign again at a top speed of 150 rad/s and a torque of 20 N m'
    """
    v = plan.speed
    if plan.motion == "scaled":
        (motion, first), (load, second) = (AXES.get(name, (name, "")) for name in plan.axes)
        return f"the campaign again at a top {motion} of {v:.3g} {first} and a {load} of {plan.force:.3g} {second}"
    return (
        f"one cycle: {RAMP * plan.time:.2g} s ramp to {v:.3g} m/s, {plan.length:.3g} m of payout, "
        f"{HOLD * plan.time:.2g} s hold, haul-in at {BACK * v:.3g} m/s"
    )


AXES = {
    "velocity": ("line speed", "m/s"), "force": ("line tension", "N"), "speed": ("speed", "rad/s"), "torque": ("torque", "N m"),
    "flow": ("flow", "m3/s"), "pressure": ("pressure", "Pa"), "voltage": ("voltage", "V"), "current": ("current", "A"),
}  # fmt: skip
"""Signals over which a stage is mapped, with their units."""


def power_text(power: float, of: float = 0.0) -> str:
    """A power with its unit, in kW where that or another one is large.

    >>> power_text(1234.0), power_text(0.56)
    ('1.2 kW', '0.56 W')
    """
    return f"{power / 1e3:.2g} kW" if max(power, of) >= 1e3 else f"{power:.2g} W"


# ----------------------------------------------------------------------------------- the next run
def experiment_words(found: DiagnosisResult) -> str:
    """What to test next, and what it would bring."""
    plan = found.experiment
    if plan is None:
        return ""
    one, other = (called(name, found.suspects) for name in plan.separates)
    apart = f"{signed(plan.expected_z).lstrip('+')} standard deviations"
    run = (
        profile_words(plan)
        if plan.load is None
        else f"{load_words(plan.load, 'ohm')}, {profile_words(plan)}"
    )
    if plan.repeats:
        run = f"after all other runs the load of {plan.repeats} again, {run}"
    listed = (*found.causes, *found.candidates)
    alike = [
        (called(cause.effect, found.suspects), called(look_alike.effect, found.suspects))
        for cause in listed
        for look_alike in cause.look_alikes
    ]
    if other in [name for _, name in alike]:
        if plan.expected_z < FAR_ENOUGH:
            return f"No run distinguishes {one} from {other} by more than {apart} ({run}): measure one of the two directly."
        return f"{upper(run)}. There {one} and {other} differ by {apart}, which distinguishes them."
    pairs = " and ".join(f"{cause} from {name}" for cause, name in alike)
    none = (
        f"No planned run distinguishes {pairs}" if alike else "No alternative explanation remains"
    )
    if plan.expected_z < FAR_ENOUGH:
        return f"{none}; a further run would separate {one} from {other}, the next suspect, by {apart} at most ({run})."
    return f"{none}. The sharpest further test separates {one} from {other}, the next suspect, by {apart}: {run}."
