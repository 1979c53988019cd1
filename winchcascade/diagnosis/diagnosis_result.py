"""What a diagnosis found, by a model or without one, as data, and the rules that both share;
`report` makes the sentences.

Numbers are in SI units, loads in ohm (inf for an open circuit, None for none), runs are given by
their number.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import msgspec

from winchcascade.core.errors import OptionError
from winchcascade.core.viewed import Viewed
from winchcascade.diagnosis.fit.entries import class_of

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run
    from winchcascade.diagnosis.fit.nuisances import Nuisance
    from winchcascade.diagnosis.fit.suspects import Suspects
    from winchcascade.rig.effects.effect import LookAlikes

Verdict = Literal["no_gap", "explained", "partly_explained", "unexplained"]

Names = tuple[str, ...]
"""A set of suspects."""

RIVALS = 2
"""Maximum number of look-alikes of a cause that are its `rivals`."""


# ------------------------------------------------------------------------------- where a gap lies
class Spot(msgspec.Struct, frozen=True):
    """A spot of the gap: a channel or a metric, in one phase, at one load and in one run where
    these are stated.

    `bias` is a difference there, and `z` one in standard deviations; NaN where it is not stated.
    `within_blocks` is about the samples within blocks and not about the means of blocks. Of
    `effects` it is about their numbers, or how they cancel there.
    """

    channel: str = ""
    phase: str | None = None
    load: float | None = None
    bias: float = math.nan
    z: float = math.nan
    within_blocks: bool = False
    run: int | None = None
    effects: Names = ()


class Place(msgspec.Struct, frozen=True, kw_only=True):
    """Measured minus predicted in one phase of one log, weighed over its `blocks`: of a channel, or
    of the output of a stage.

    `bias` and `rms` are those of the means of blocks, `noise` one standard deviation of a block.
    Standard uncertainties of the bias: `u_noise` of noise and zeros, `u_repeat` of how cycles
    repeat (NaN with one), `u_tolerance` of the numbers and gains of the rig. `z` is the bias over
    all three. From end to end the zero of the log is taken off. A `stage` is compared with what it
    makes of its own measured `inputs`, no zero taken off. Without a model a place holds all logs
    (`log` is -1), and `share` is its share of the squared gap.
    """

    channel: str = ""
    phase: str = ""
    log: int = -1
    load: float | None = None
    blocks: int
    bias: float
    rms: float
    noise: float
    u_noise: float
    u_repeat: float
    u_tolerance: float
    z: float
    stage: str = ""
    inputs: tuple[str, ...] = ()
    share: float = math.nan


class Where(msgspec.Struct, frozen=True):
    """Where a gap lies: the stage and the place of the map that shows it most.

    With a model `rpm` and `i_dc` span the blocks with a significant gap [rpm, A], `size` is the
    largest bias there. `arises` are the stages that deviate with logged inputs to each, the worst
    first, each with its worst place; None without a model.
    """

    stage: str
    worst: Place
    rpm: tuple[float, float] = (math.nan, math.nan)
    i_dc: tuple[float, float] = (math.nan, math.nan)
    size: float = math.nan
    arises: tuple[Place, ...] | None = None


# ------------------------------------------------------------------------------------- the causes
class Reported(msgspec.Struct, frozen=True):
    """A number with its 95 % interval, which includes the tolerance of what the effect changes.

    One that the data push against an end of its range is `at_limit`, with a one-sided interval; one
    beyond what is plausible, but within what is possible, is `beyond_range`. The interval of one
    that the data do not determine is infinite.
    """

    value: float
    low: float
    high: float
    unit: str
    at_limit: Literal["low", "high"] | None = None
    beyond_range: bool = False

    @property
    def determined(self) -> bool:
        """Whether the data determine it better than it was known before."""
        return math.isfinite(self.low) and math.isfinite(self.high)


class Alternative(msgspec.Struct, frozen=True):
    """A suspect that explains the same data as well in place of a cause, and where the two
    explanations differ most.

    `number` is what it would have to be, without an interval; None where it was not fitted.
    """

    effect: str
    probability: float
    differs: Spot | None
    number: Reported | None = None


class RunValue(msgspec.Struct, frozen=True):
    """Number of a cause in one run with its 95 % interval; NaN where it is `withheld` or hardly
    depends on it.
    """

    run: int
    value: float = math.nan
    low: float = math.nan
    high: float = math.nan
    withheld: bool = False


Along = Literal["order", "load", "scatter"]
"""What the number of a cause changes along: the order of the runs, the conductance of their
loads, or neither.
"""


class Trend(msgspec.Struct, frozen=True):
    """A difference between the numbers of the runs that their uncertainties do not allow.

    `change` is that from the first run or smallest conductance to the last, or the range of a
    scatter, `u` its standard uncertainty, `chance` its probability among runs that agree, `instead`
    what would explain it as well.
    """

    along: Along
    change: float
    u: float
    chance: float
    instead: Along | None = None


class Stability(msgspec.Struct, frozen=True):
    """The number of a cause in every run, in their order, and what differs between them beyond
    their uncertainties.
    """

    runs: tuple[RunValue, ...]
    trends: tuple[Trend, ...]


class NamedCause(msgspec.Struct, frozen=True):
    """An effect that is needed: its posterior probability within the catalogue, its numbers, and
    all that would explain the data about as well in its place.

    `weight` is the share of the objective that it carries, `ablation` that of the gap that a fit of
    the others closes.
    """

    effect: str
    stage: str
    probability: float
    parameters: dict[str, Reported]
    look_alikes: tuple[Alternative, ...]
    weight: float
    ablation: float = math.nan
    stability: Stability | None = None

    @property
    def trends(self) -> tuple[Trend, ...]:
        """What differs between its numbers of the runs."""
        return self.stability.trends if self.stability else ()

    @property
    def rivals(self) -> tuple[Alternative, ...]:
        """The first of its look-alikes, at most `RIVALS`."""
        return self.look_alikes[:RIVALS]


class Judgement(msgspec.Struct, frozen=True):
    """What a diagnosis knows of its rig, for all that uses its numbers: causes and candidates by
    name, and of each that has some, the effects that explain the logs as well.
    """

    verdict: Verdict
    causes: Names = ()
    candidates: Names = ()
    look_alikes: dict[str, Names] = {}

    @property
    def classes(self) -> dict[str, LookAlikes]:
        """Class of look-alikes of each cause and candidate that has one."""
        listed = (*self.causes, *self.candidates)
        found = ((name, class_of(name, self.look_alikes.get(name, ()))) for name in listed)
        return {name: shared for name, shared in found if shared is not None}

    def check(self, purpose: str, *, force: bool) -> None:
        """Refuse to use a rig whose gap is not explained, unless that is forced.

        Parameters
        ----------
        purpose : option or command that uses the rig, as the message names it

        Raises
        ------
        OptionError : the verdict is `unexplained`
        """
        if self.verdict == "unexplained" and not force:
            raise OptionError(
                f"{purpose}: the gap of this diagnosis is unexplained, so that the corrected rig "
                "is wrong by as much; find its cause first, or give --force, which states the "
                "verdict with every result."
            )


class SingleEffect(msgspec.Struct, frozen=True):
    """An effect alone: its evidence relative to that of the best set [nats], and the share of the
    gap that it closes on held-out logs, NaN without a gap.
    """

    effect: str
    evidence: float
    closure: float = math.nan


class LargestChange(msgspec.Struct, frozen=True):
    """What an effect changes most: an efficiency, or the mean of a channel in a `phase` as a
    share of its plateau. [1]
    """

    name: str
    change: float
    phase: str | None = None
    load: float | None = None


class Minor(msgspec.Struct, frozen=True):
    """An effect that is no cause, with its numbers and what it changes most: significant but too
    small to matter, or a hint.

    `hint` is the evidence that a hint has, less than a cause needs [nats]; NaN for one that is
    significant.
    """

    effect: str
    stage: str
    parameters: dict[str, Reported]
    largest: LargestChange
    hint: float = math.nan


# ---------------------------------------------------------------------- energies and efficiencies
class StageEnergy(msgspec.Struct, frozen=True):
    """Energy of one stage over one phase of one run, or of one `cycle` of it, payout positive [J].

    `before` is that of the model of the rig file, or of line tension times speed, `after` that of
    the fit, each with the zeros of the sensors. `u` is the standard uncertainty of measured minus
    after. `cycles` is their number.
    """

    run: int
    phase: str
    stage: str
    measured: float
    before: float
    after: float
    u: float
    cycles: int = 1
    cycle: int | None = None


ContributionKind = Literal["physical", "sensor", "entry", "tolerances", "model_form", "residual"]
"""What a part of a difference is: a cause that costs energy, one that changes only what is read, a
wrong entry; the fitted numbers and sensors of the rig within their tolerances, the difference
between two models, and the rest."""


class ContributionPart(msgspec.Struct, frozen=True):
    """One part of the difference between model and measured run with its 95 % interval; `effect`
    is None for no cause.
    """

    effect: str | None
    kind: ContributionKind
    value: float
    low: float
    high: float


class Contribution(msgspec.Struct, frozen=True):
    """One of the nine metrics of a run, or the mean of a channel: as given, as measured, and what
    adds up to the difference.

    NaN and no parts where the run cannot give it. `plateau_speed` is the mean of the run [m/s],
    None without a plateau.
    """

    log: int
    load: float | None
    metric: str
    as_given: float
    measured: float
    parts: tuple[ContributionPart, ...]
    plateau_speed: float | None = None


# ----------------------------------------------------------------------- closure and what remains
class Shrunk(msgspec.Struct, frozen=True):
    """Root mean squares of one channel over the withheld logs: before, after, and noise."""

    before: float
    after: float
    noise: float

    @property
    def worse(self) -> bool:
        """Whether the misfit after exceeds that before by more than noise.

        >>> Shrunk(3.0, 4.0, 1.0).worse, Shrunk(3.0, 3.1, 1.0).worse
        (True, False)
        """
        return self.after**2 - self.before**2 > self.noise**2


class GapClosure(msgspec.Struct, frozen=True):
    """Share of the gap that the causes close on data that took no part in their fit, with its 95
    % interval, and by channel.
    """

    channels: dict[str, Shrunk]
    share: float
    low: float
    high: float


AlarmKind = Literal[
    "structure", "scatter", "ripple", "nuisance",
    "drift", "range", "improbable", "cancelling", "worse",
    "energy", "residual",
]  # fmt: skip
"""Kinds of signs of something unexplained, as `judge.alarms` has them."""


class Alarm(msgspec.Struct, frozen=True):
    """One sign of something unexplained: its kind, where, its size and the limit that it passes,
    in the same unit.
    """

    kind: AlarmKind
    about: Spot | Nuisance
    size: float
    limit: float


class Remainder(msgspec.Struct, frozen=True):
    """What the causes leave: the share of the gap on withheld data, the signs of structure in
    it, and where it is worst.
    """

    share: float
    alarms: tuple[Alarm, ...]
    worst: Spot | Nuisance | None


class Experiment(msgspec.Struct, frozen=True):
    """One run that would distinguish two suspects, and by how many standard deviations.

    `speed` is the highest one [m/s]; `load`, `length` of the payout [m], and the `time` of a stroke
    at the top speed of the campaign [s] belong to a `cycle`. Of stages without a model the campaign
    is run again `scaled`: `speed` and `force` are the tops of the signals `axes`, in SI units.
    `repeats` is a log whose load is run again after all others.
    """

    motion: Literal["cycle", "scaled"]
    speed: float
    separates: tuple[str, str]
    expected_z: float
    load: float | None = None
    length: float = math.nan
    time: float = math.nan
    force: float = math.nan
    axes: tuple[str, str] = ("", "")
    repeats: str = ""


# -------------------------------------------------------------------- a simulation of the owner
class ModelForm(msgspec.Struct, frozen=True):
    """What a simulation of the owner has in another form than the model of the rig: the effect or
    simplification that is `likely`.

    `bias` is simulation minus model of the rig at the place where it is most significant, all
    differences together, `z` in its uncertainties.
    """

    stage: str
    channel: str
    phase: str
    load: float | None
    bias: float
    z: float
    likely: str | None


class OwnSimulation(msgspec.Struct, frozen=True):
    """A simulation of the owner beside the model of the rig.

    `runs` are the simulations on the stamps of the logs, `forms` what they have in another form,
    the largest first, with the `numbers` of each that is likely. `shared` are the causes of the
    logs that the simulation contains with the same numbers, where it differs from the logs by no
    more than noise: they are no causes of that difference.
    """

    runs: tuple[Run, ...]
    forms: tuple[ModelForm, ...]
    numbers: dict[str, dict[str, Reported]]
    shared: Names = ()


# ------------------------------------------------------------------------------------- the result
class DiagnosisResult(Viewed, frozen=True, kw_only=True):
    """The answer of a diagnosis, by a model or without one.

    Parameters
    ----------
    title : of the campaign
    rig : which the logs are compared with
    seed : of the resampling of cycles
    runs : the logs
    suspects : effects that could have been named
    verdict : `no_gap`, `explained`, `partly_explained` or `unexplained`
    where : the stages that deviate, None where there is no gap
    chosen : effects of the fit
    causes : those of them that are named, with value, interval, probability and look-alikes
    candidates : those that may as well imitate what acts: listed, and neither entered nor priced
    fitted : numbers of all effects of the fit
    minor : effects that are significant but too small to matter, and hints
    closure : share of the gap that the causes close on held-out logs, None where no cause is named
    remainder : what no effect explains, None where there is no gap
    experiment : the next run, None where no cause is named
    sets : probability of every set of suspects that was fitted
    places : map of the gap
    """

    title: str
    rig: Rig
    seed: int
    runs: tuple[Run, ...]
    suspects: Suspects
    verdict: Verdict = "no_gap"
    where: Where | None = None
    chosen: Names
    causes: tuple[NamedCause, ...] = ()
    candidates: tuple[NamedCause, ...] = ()
    fitted: tuple[NamedCause, ...] = ()
    minor: tuple[Minor, ...] = ()
    closure: GapClosure | None = None
    remainder: Remainder | None = None
    experiment: Experiment | None = None
    sets: dict[Names, float]
    places: tuple[Place, ...]

    @property
    def unnamed(self) -> list[str]:
        """Effects of the fit that are not named as causes."""
        named = {cause.effect for cause in self.causes} | {one.effect for one in self.minor}
        return [name for name in self.chosen if name not in named]

    @property
    def judgement(self) -> Judgement:
        """What travels with every number of the corrected rig."""
        listed = (*self.causes, *self.candidates)
        return Judgement(
            self.verdict,
            tuple(cause.effect for cause in self.causes),
            tuple(cause.effect for cause in self.candidates),
            {
                cause.effect: tuple(one.effect for one in cause.look_alikes)
                for cause in listed
                if cause.look_alikes
            },
        )
