"""An effect as a declaration of what the baseline leaves out, and an effect with values that
acts on a model.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Literal

import msgspec

from winchcascade.core.scales import Scales
from winchcascade.rig.effects.run_order import RunPlace
from winchcascade.rig.parts import CHANGED_AGAIN, Model, Operation, changed, stated_path

Values = tuple[float, ...]
"""Values of the fields of an effect, in their order."""

Law = Callable[[Model, Values], Model]
"""Model with an effect, of a model and the values of the effect."""

Together = Callable[[Values, Values], Values]
"""Values that act as earlier ones and further ones do after each other."""

Report = Callable[[Values], float]
"""Number that is reported of some values."""

ScaledReport = Callable[[Scales, Values], float]
"""Number that is reported of some values in a campaign of some scales."""

InRun = Callable[[Values, RunPlace], Values]
"""Values with which an effect acts in one run of a campaign."""


class Parameter(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A deviation of the model from a rig: a field of an effect, or what every fit allows within a
    tolerance.

    Parameters
    ----------
    low, high : plausible range, a prior of a fit
    scale : scale of the campaign of which low, high, possible and absent are shares, as `Scales.of`
        reads it; empty for numbers that have no dimension
    share : plausible range as a share of that scale once this is applied, and the other numbers are
        in units
    possible : outside of it, both ends included, a value has no physical meaning
    absent : value at which the effect is absent
    assumed : value of a field with a scale, in its unit, where an effect is stated without it and
        no campaign gives a scale
    start : of a share that says how an effect acts and not how much, where a fit begins, as its
        absence is an end of the range
    path : number of the model that it changes, `generator.r_s`, for a sensor with the channel,
        `sensors.gain.torque`; empty where a law of the effect takes the value
    operation : `add`, `scale` for a relative change, `compound` for a relative deviation that the
        model holds as such
    per : the number of the model changes by the value divided by this
    sd : of a nuisance, one standard uncertainty about the absent value
    role : an effect of the rig, a wrong entry of the rig file or the campaign, or a nuisance
    load, log : the only load [ohm] and the number of the only log that it concerns; NaN and -1 for
        all
    usual : of an entry, values at which the true number is a usual multiple of the stated one, such
        as 1/2 and 2
    scatter : relative deviation from a usual multiple that is still one, one standard deviation [1]
    usual_share : prior share of the wrong entries whose true number is a usual multiple of the
        stated one [1]
    """

    name: str
    unit: str = "1"
    low: float = -math.inf
    high: float = math.inf
    possible: tuple[float, float] = (-math.inf, math.inf)
    source: str = "plausible range"
    path: str = ""
    operation: Operation = "add"
    absent: float = 0.0
    assumed: float | None = None
    start: float | None = None
    per: float = 1.0
    scale: str = ""
    share: tuple[float, float] | None = None
    sd: float = 0.0
    role: Literal["effect", "entry", "nuisance"] = "effect"
    load: float = math.nan
    log: int = -1
    usual: tuple[float, ...] = ()
    scatter: float = 0.01
    usual_share: float = 0.5

    def apply(self, model: Model, value: float) -> Model:
        """The model with its number changed; the same model where there is none."""
        return changed(model, self.path, self.operation, value / self.per) if self.path else model

    @property
    def limits(self) -> tuple[float, float]:
        """Limits of what has a physical meaning, in units; of a share whose scale is unknown its
        sign alone.
        """
        if not self.is_share:
            return self.possible
        low, high = self.possible
        return (0.0 if low >= 0.0 else -math.inf, 0.0 if high <= 0.0 else math.inf)

    @property
    def unstated(self) -> float:
        """Value of a field that is not given."""
        return self.assumed if self.is_share and self.assumed is not None else self.absent

    @property
    def is_share(self) -> bool:
        """Whether its numbers are shares of a scale that is not known yet."""
        return bool(self.scale) and self.share is None

    def at(self, scales: Scales) -> Parameter:
        """The parameter with its range in units, on a rig and in a campaign of these scales."""
        if not self.is_share:
            return self
        by = scales.of(self.scale)
        return msgspec.structs.replace(
            self,
            low=by * self.low,
            high=by * self.high,
            possible=(by * self.possible[0], by * self.possible[1]),
            absent=by * self.absent,
            share=(self.low, self.high),
        )

    def after(self, earlier: float, value: float) -> float:
        """The one value that acts as `value` does on a model with an earlier one; without a
        number the later one holds.
        """
        return (
            CHANGED_AGAIN[self.operation](earlier / self.per, value / self.per) * self.per
            if self.path
            else value
        )


class Display(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How reports show a number: its description, the factor from its unit to the shown `unit`,
    and whether a plus is shown.
    """

    what: str
    factor: float = 1.0
    unit: str = ""
    signed: bool = True


class Stated(msgspec.Struct, frozen=True):
    """The number that a wrong entry concerns: SI `value`, NaN as long as no rig or run is known,
    `unit` of the rig file, number of the only `log`, -1 for all, and the file of that log as its
    `source`.
    """

    value: float = math.nan
    unit: str = ""
    log: int = -1
    source: str = ""


class Effect(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Declaration of one effect.

    Parameters
    ----------
    label : plain name that reports show beside the identifier, of at most 20 letters
    stage : where in the cascade it acts: generator, gearbox, transmission, restoring, sensor; or
        `entry`, a wrong number in the rig file or in the campaign
    summary : what the baseline leaves unmodelled
    shows_as : channels, phases, speeds, loads and displacements at which it shows
    taken_for : similar effects, and what distinguishes them
    source : publication, or that its range is plausible only
    fields : what a fit may find
    display : how reports show the parameter that a diagnosis reports
    law : model of a model and the values, where more follows from the fields than changes of their
        own numbers
    together : with a law, the values that act as one after the other do
    parameter, unit : what a diagnosis reports, by default the first field; `relative` and
        `absolute` are changes of the number of the rig file
    reported_from : the reported parameter of the values; the first field by default
    reported_at : the same where it depends on the scales of the campaign
    beside : further fields that are reported beside the parameter
    over_runs : of an effect that changes from run to run, the values with which it acts in one of
        them; without a place among the runs it acts as in the run that shows it most
    law_u : standard uncertainty of what it does beyond that of every law, as a share, where rigs
        differ in the shape of it [1]
    entry : of a wrong entry, the number that is stated
    """

    name: str
    label: str
    stage: str
    summary: str
    shows_as: str
    fields: tuple[Parameter, ...]
    display: Display
    taken_for: str = ""
    source: str = "plausible range"
    law: Law | None = None
    together: Together | None = None
    parameter: str = ""
    unit: str = ""
    reported_from: Report | None = None
    reported_at: ScaledReport | None = None
    beside: tuple[str, ...] = ()
    over_runs: InRun | None = None
    law_u: float = 0.0
    entry: Stated | None = None

    def __post_init__(self) -> None:
        """Report the first field where the declaration names no other parameter or unit."""
        first = self.fields[0]
        absolute = "absolute" if first.path and first.unit == "1" else first.unit
        unit = "relative" if first.path and first.operation != "add" else absolute
        msgspec.structs.force_setattr(self, "parameter", self.parameter or first.name)
        msgspec.structs.force_setattr(self, "unit", self.unit or unit)
        if first.role == "entry" and self.entry is None:
            msgspec.structs.force_setattr(self, "entry", Stated())

    def at(self, scales: Scales) -> Effect:
        """The effect with its ranges in units, on a rig and in a campaign of these scales."""
        fields = tuple(field.at(scales) for field in self.fields)
        reported_from = (
            self.reported_from if self.reported_at is None else partial(self.reported_at, scales)
        )
        return msgspec.structs.replace(self, fields=fields, reported_from=reported_from)

    @property
    def path(self) -> str:
        """Number of the model that the first field changes; empty where a law takes it."""
        return self.fields[0].path

    @property
    def number(self) -> str:
        """Section and name of that number in a rig file; empty where no file has it."""
        return stated_path(self.path)

    @property
    def of_a_sensor(self) -> bool:
        """Whether it changes what is read of the rig, and not the rig."""
        return self.path.startswith("sensors.")


class ActiveEffect(msgspec.Struct, frozen=True):
    """An effect with a value for each of its fields."""

    effect: Effect
    values: Values

    def apply(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        if self.effect.law is not None:
            return self.effect.law(model, self.values)
        for field, value in zip(self.effect.fields, self.values, strict=True):
            model = field.apply(model, value)
        return model

    def in_run(self, place: RunPlace) -> ActiveEffect:
        """The effect as it acts in one run of a campaign."""
        over_runs = self.effect.over_runs
        return (
            self if over_runs is None else ActiveEffect(self.effect, over_runs(self.values, place))
        )

    def after(self, earlier: Values) -> ActiveEffect:
        """One effect that acts as this one does on a model that has it with earlier values."""
        effect, both = self.effect, zip(self.effect.fields, earlier, self.values, strict=True)
        if effect.together is not None:
            return ActiveEffect(effect, effect.together(earlier, self.values))
        return ActiveEffect(
            effect, tuple(field.after(first, second) for field, first, second in both)
        )

    @property
    def reported(self) -> float:
        """Parameter that a diagnosis reports, in the unit of the effect."""
        reported_from = self.effect.reported_from
        return self.values[0] if reported_from is None else reported_from(self.values)


class StageLaw(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A power of a stage that is linear in one number: a loss, what a store takes up, or an error
    of a sensor.

    Parameters
    ----------
    label, summary, what : plain name, what it is, and what its number is
    parameter, unit, factor : the number, its SI unit, and the factor to the percents that reports
        show
    kind : a `loss` is the number times a product of magnitudes of signals, an `exchange` the same
        with their signs; a `store` takes up half the number times the rate of a square; a `gas` at
        one temperature takes up its pressure times the rate of its volume; `gain` and `zero` are
        those of a sensor
    over : signals of the stage with their exponents in the product
    needs, without : a signal that the stage must have, and one that it must not have
    share : of an error, its plausible range: of a zero, as a share of the top reading [1]
    """

    name: str
    parameter: str
    unit: str
    what: str
    label: str = ""
    summary: str = ""
    factor: float = 1.0
    kind: Literal["loss", "exchange", "store", "gas", "gain", "zero"] = "loss"
    over: dict[str, int] = {}
    needs: str = ""
    without: str = ""
    share: tuple[float, float] = (0.0, 0.0)


class LookAlikes(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A class of effects that the channels of a rig hardly distinguish, at any number of logs, as
    their laws nearly agree.

    Parameters
    ----------
    name : of the class
    members : suspects by name
    beyond : what is not in the catalogue and looks the same
    broken_by : the observation that distinguishes them
    """

    name: str
    members: tuple[str, ...]
    broken_by: str
    beyond: tuple[str, ...] = ()
