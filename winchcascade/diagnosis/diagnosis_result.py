"""What a diagnosis found, by a model or without one, as data; `report` makes the sentences."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import msgspec

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run
    from winchcascade.diagnosis.gap_map import Place
    from winchcascade.diagnosis.nuisances import Nuisance
    from winchcascade.diagnosis.stagewise import StagePlace
    from winchcascade.diagnosis.suspects import Suspects

Verdict = Literal["no_gap", "explained", "partly_explained", "unexplained"]
Names = tuple[str, ...]
"""A set of suspects."""

CALLED = {"load": "generator"}
"""Stage of the catalogue that a stage belongs to, where it is not called the same: load and bridge make one module."""


class Spot(msgspec.Struct, frozen=True):
    """A spot of the gap: a channel, in one phase and at one load [ohm] where these are stated.

    `bias` is a difference there, in the unit of the channel, and `z` one in standard deviations; NaN where it is not stated.
    `within_blocks` is about the samples within blocks and not about the means of blocks.
    """

    channel: str
    phase: str | None = None
    load: float | None = None
    bias: float = math.nan
    z: float = math.nan
    within_blocks: bool = False


class Arises(msgspec.Struct, frozen=True):
    """Where a gap arises: the stages that are `off` by themselves, most first, and the `worst` place of the first.

    `sensor` is the channel whose gain error alone, of size `gain` [1], would have several of them off as they are.
    """

    off: tuple[str, ...]
    worst: StagePlace | None
    sensor: str | None = None
    gain: float = 0.0

    @property
    def stage(self) -> str | None:
        """Stage of the catalogue, or `sensor`; None where no stage is off by itself."""
        if not self.off:
            return None
        return "sensor" if self.sensor else CALLED.get(self.off[0], self.off[0])


class Where(msgspec.Struct, frozen=True):
    """Where a gap lies: the stage and the place of the map that shows it most.

    With a model `rpm` and `i_dc` span the blocks that stand out [rpm, A], `size` is the largest bias there, and `arises` says
    where the gap arises when each stage is given its own logged inputs.
    """

    stage: str
    worst: Place
    rpm: tuple[float, float] = (math.nan, math.nan)
    i_dc: tuple[float, float] = (math.nan, math.nan)
    size: float = math.nan
    arises: Arises | None = None


class Reported(msgspec.Struct, frozen=True):
    """A number that a diagnosis reports, with its 95 % interval, which includes the tolerance of what the effect changes."""

    value: float
    low: float
    high: float
    unit: str


class Alternative(msgspec.Struct, frozen=True):
    """A suspect that explains the same data as well in place of a cause, and where the two explanations differ most."""

    effect: str
    probability: float
    differs: Spot | None


class NamedCause(msgspec.Struct, frozen=True):
    """An effect that is needed: its probability, its numbers, its alternatives, and how much of the objective it carries."""

    effect: str
    stage: str
    probability: float
    parameters: dict[str, Reported]
    rivals: tuple[Alternative, ...]
    weight: float


class Shrunk(msgspec.Struct, frozen=True):
    """Root mean squares of one channel over the withheld logs, SI units: before, after, and noise."""

    before: float
    after: float
    noise: float


class GapClosure(msgspec.Struct, frozen=True):
    """Share of the gap that the causes close on data that took no part in their fit, with its 95 % interval, and by channel."""

    channels: dict[str, Shrunk]
    share: float
    low: float
    high: float


class Alarm(msgspec.Struct, frozen=True):
    """One sign of something unexplained: its kind, where, its size and the limit that it passes, in the same unit."""

    kind: Literal["structure", "scatter", "ripple", "nuisance", "slow"]
    about: Spot | Nuisance
    size: float
    limit: float


class Remainder(msgspec.Struct, frozen=True):
    """What the causes leave: the share of the gap on withheld data, the signs of structure in it, and where it is worst."""

    share: float
    alarms: tuple[Alarm, ...]
    worst: Spot | Nuisance | None


class Experiment(msgspec.Struct, frozen=True):
    """One run that would tell two suspects apart, and by how many standard deviations.

    `speed` is the highest one [m/s]; `load` [ohm] and `length` of the payout [m] belong to a `cycle` of a rig with a model,
    the line force `force` [N] to the motions of a winch without one.
    """

    motion: Literal["cycle", "speed_steps", "force_steps", "out_and_back", "swing"]
    speed: float
    separates: tuple[str, str]
    expected_z: float
    load: float | None = None
    length: float = math.nan
    force: float = math.nan


class DiagnosisResult(msgspec.Struct, frozen=True, kw_only=True):
    """The answer of a diagnosis, by a model or without one.

    `chosen` are the effects of the fit and `causes` those of them that are named; `sets` holds the probability of every set of
    suspects that was fitted, `places` the map of the gap. `closure` and `experiment` are None where no cause is named, `where`
    and `remainder` where there is no gap.
    """

    title: str
    rig: Rig
    seed: int
    runs: tuple[Run, ...]
    suspects: Suspects
    verdict: Verdict
    where: Where | None
    chosen: Names
    causes: tuple[NamedCause, ...]
    closure: GapClosure | None
    remainder: Remainder | None
    experiment: Experiment | None
    sets: dict[Names, float]
    places: tuple[Place, ...]

    @property
    def unnamed(self) -> list[str]:
        """Effects of the fit that are not named as causes."""
        named = {cause.effect for cause in self.causes}
        return [name for name in self.chosen if name not in named]
