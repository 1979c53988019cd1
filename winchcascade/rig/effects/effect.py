"""An effect as a declaration of what the baseline leaves out, and an effect with values that acts on a model."""

import math
from collections.abc import Callable

import msgspec

from winchcascade.rig.effects.run_order import RunPlace
from winchcascade.rig.parts import CHANGED_AGAIN, Model, Operation, changed

Values = tuple[float, ...]
"""Values of the fields of an effect, in their order."""


class Field(msgspec.Struct, frozen=True):
    """A number that a fit may find.

    Bounds `low` to `high` are plausible, and a fit keeps to them. Outside of `possible`, which includes both ends, a value has
    no physical meaning. At `absent` the effect is absent.
    """

    name: str
    unit: str
    low: float
    high: float
    possible: tuple[float, float]
    source: str
    absent: float = 0.0


class Display(msgspec.Struct, frozen=True):
    """How reports show a number: its description, the factor from its unit to the shown `unit`, and whether a plus is shown."""

    what: str
    factor: float = 1.0
    unit: str = ""
    signed: bool = True


class WrongEntry(msgspec.Struct, frozen=True):
    """What an effect of the stage `entry` takes to be stated wrongly, and which mistakes are usual.

    Parameters
    ----------
    number : section and name of the number in the rig file; empty for the scale of the encoder and for a load
    usual : values of the field at which the true number is a usual multiple of the stated one, such as 1/2 and 2
    scatter : relative deviation from a usual multiple that is still one, one standard deviation [1]
    always_usual : whether the true number can be nothing but such a multiple, as with a convention
    same_as : effects that look the same in the logs
    log : number of the only log that the entry concerns, -1 for all
    stated : the stated number, SI units; NaN as long as no rig or run is known
    unit : unit of the number in the rig file
    as_number : whether the number is reported and not its ratio to the stated one
    source : where it is stated: empty for the rig file, the name of the file of a run otherwise
    """

    number: str = ""
    usual: tuple[float, ...] = ()
    scatter: float = 0.01
    always_usual: bool = False
    same_as: tuple[str, ...] = ()
    log: int = -1
    stated: float = math.nan
    unit: str = ""
    as_number: bool = True
    source: str = ""


class Change(msgspec.Struct, frozen=True):
    """How an effect changes one number of the model.

    Parameters
    ----------
    path : part and number, `generator.r_s`; for a sensor also the channel, `sensors.gain.torque`
    operation : `add`, `scale` for a relative change, `compound` for a relative deviation that the model holds as such
    per : the number of the model changes by the field divided by this
    """

    path: str
    operation: Operation
    per: float = 1.0


class Effect(msgspec.Struct, frozen=True):
    """Declaration of one effect.

    Parameters
    ----------
    label : plain name that reports show beside the identifier, of at most 20 letters
    stage : where in the cascade it acts: generator, gearbox, transmission, restoring, sensor; or `entry`, a wrong number
        in the rig file or in the campaign
    summary : what the baseline leaves unmodelled
    shows_as : channels, phases, speeds, loads and displacements at which it shows
    taken_for : similar effects, and what distinguishes them
    source : publication, or that its range is plausible only
    fields : what a fit may find
    display : how reports show the parameter that a diagnosis reports
    law : change of one number by the first field, or a function where several numbers follow from the fields
    parameter, unit : what a diagnosis reports, by default the first field; `relative` and `absolute` are changes of the number
        of the rig file
    reported_from : the reported parameter of the values; the first field by default
    together : values that act as one after the other do; where the law is a change of one number, they follow from it
    beside : further fields that are reported beside the parameter
    over_runs : of an effect that changes from run to run, the values with which its law acts in one of them; without a place
        among the runs it acts as in the run that shows it most
    same_as : effects that look the same in most logs, as the laws hardly differ
    unlisted : what is not in the catalogue and looks the same
    entry : of the stage `entry`, what is stated wrongly
    """

    name: str
    label: str
    stage: str
    summary: str
    shows_as: str
    taken_for: str
    source: str
    fields: tuple[Field, ...]
    display: Display
    law: Change | Callable[[Model, Values], Model]
    parameter: str = ""
    unit: str = ""
    reported_from: Callable[[Values], float] | None = None
    together: Callable[[Values, Values], Values] | None = None
    beside: tuple[str, ...] = ()
    over_runs: Callable[[Values, RunPlace], Values] | None = None
    same_as: tuple[str, ...] = ()
    unlisted: str = ""
    entry: WrongEntry | None = None

    def __post_init__(self) -> None:
        """Report the first field where the declaration names no other parameter or unit."""
        first, how = self.fields[0], self.law.operation if isinstance(self.law, Change) else None
        absolute = "absolute" if how == "add" and first.unit == "1" else first.unit
        unit = absolute if how in (None, "add") else "relative"
        msgspec.structs.force_setattr(self, "parameter", self.parameter or first.name)
        msgspec.structs.force_setattr(self, "unit", self.unit or unit)

    @property
    def of_a_sensor(self) -> bool:
        """Whether it changes what is read of the rig, and not the rig."""
        return isinstance(self.law, Change) and self.law.path.startswith("sensors.")


class ActiveEffect(msgspec.Struct, frozen=True):
    """An effect with a value for each of its fields."""

    effect: Effect
    values: Values

    def apply(self, model: Model) -> Model:
        """Return the model with this effect in it."""
        law = self.effect.law
        if isinstance(law, Change):
            return changed(model, law.path, law.operation, self.values[0] / law.per)
        return law(model, self.values)

    def in_run(self, place: RunPlace) -> "ActiveEffect":
        """The effect as it acts in one run of a campaign."""
        over_runs = self.effect.over_runs
        return self if over_runs is None else ActiveEffect(self.effect, over_runs(self.values, place))

    def after(self, earlier: Values) -> "ActiveEffect":
        """One effect that acts as this one does on a model that has it with earlier values."""
        law, together = self.effect.law, self.effect.together
        if isinstance(law, Change):
            return ActiveEffect(
                self.effect, (CHANGED_AGAIN[law.operation](earlier[0] / law.per, self.values[0] / law.per) * law.per,)
            )
        if together is None:
            raise TypeError(f"effect {self.effect.name} does not declare how two of it act together.")
        return ActiveEffect(self.effect, together(earlier, self.values))

    @property
    def reported(self) -> float:
        """Parameter that a diagnosis reports, in the unit of the effect."""
        reported_from = self.effect.reported_from
        return self.values[0] if reported_from is None else reported_from(self.values)
