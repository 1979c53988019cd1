"""Effects of generator, rectifier and load."""

import operator
from functools import partial
from itertools import accumulate, pairwise

from msgspec.structs import replace

from winchcascade.core.run import Signal
from winchcascade.rig.effects.effect import ANY, Display, Effect, Parameter, Values
from winchcascade.rig.effects.run_order import RunPlace, warming
from winchcascade.rig.parts import ROLLOFF_KNOTS, Model, rolloff_curve

_effect = partial(Effect, stage="generator")


def share_at_knots(lost: Values) -> Values:
    """Share of k_e that remains at the stator currents of `ROLLOFF_KNOTS` beyond the first; it never rises. [1]

    >>> share_at_knots((0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5))
    (1.0, 0.9, 0.9, 0.9, 0.9, 0.9, 0.9, 0.45)
    """
    return tuple(accumulate((1.0 - share for share in lost), operator.mul))


def share_of_k_e(lost: Values, current: Signal | float) -> Signal:
    """Share of k_e that remains at some stator currents [A rms], by a monotone cubic between the knots. [1]"""
    return rolloff_curve(share_at_knots(lost))(current)


def _rolled_off(model: Model, lost: Values) -> Model:
    rolloff = tuple(a * b for a, b in zip(model.generator.rolloff, share_at_knots(lost), strict=True))
    return replace(model, generator=replace(model.generator, rolloff=rolloff))


def _lost_twice(first: Values, second: Values) -> Values:
    return tuple(1.0 - (1.0 - a) * (1.0 - b) for a, b in zip(first, second, strict=True))


def _warm_in_run(values: Values, place: RunPlace) -> Values:
    k_e, r_s, time_constant, by_current = values
    rise = warming(place.order, time_constant, by_current)[place.number]
    return k_e * rise, r_s * rise, time_constant, by_current


_MAX_LOST = (0.1, 0.1, 0.1, 0.1, 0.15, 0.15, 0.2, 0.3)
"""Plausible share of k_e that is lost between two knots. [1]"""

_COOLING = "in spacings of runs, of some minutes; a machine of some kilowatts takes a quarter of an hour to hours"

GENERATOR = (
    _effect(
        name="ke_rolloff",
        label="Back-EMF roll-off",
        summary="Back-EMF constant falls with the stator current, by a law of unknown shape.",
        shows_as="vdc, idc, torque and force below the baseline where the stator current is high; in open circuit nothing.",
        taken_for="a larger phase inductance (sync_inductance), which also needs speed; hot copper (copper_heating), "
        "which costs more power than torque.",
        source="Hsu et al. 2026, Sec. 5.1, Fig. 18e; from little below the rated 5.16 A.",
        fields=tuple(
            Parameter(
                f"lost_to_{end:g}_a", "1", 0.0, most, (0.0, 0.9), f"share lost between {begin:g} and {end:g} A rms"
            )
            for (begin, end), most in zip(pairwise(ROLLOFF_KNOTS), _MAX_LOST, strict=True)
        ),
        parameter="k_e_ratio_at_10_a",
        display=Display("back-EMF left at 10 A rms", 100.0, "%", signed=False),
        law=_rolled_off,
        together=_lost_twice,
        reported_from=lambda lost: float(share_of_k_e(lost, 10.0)),
    ),
    _effect(
        name="ke_shift",
        label="Back-EMF constant",
        summary="Back-EMF constant differs at every current: magnets warm or out of tolerance.",
        shows_as="vdc and idc deviate by nearly the same share at every load, in open circuit too, torque and force by "
        "about twice that.",
        taken_for="a gain error of Vdc (voltage_gain), which leaves torque and idc alone; roll-off (ke_rolloff), which "
        "open circuit does not show.",
        source="Hsu et al. 2026, Sec. 4.2, Fig. 12: 0.0620 V/rpm fitted, 0.0617 by the maker, within 10 %.",
        fields=(Parameter("k_e_change", "1", -0.1, 0.1, ANY, "limits of the maker", "generator.k_e", "scale"),),
        display=Display("back-EMF constant", 100.0, "%"),
    ),
    _effect(
        name="heating",
        label="Machine heating",
        summary="The machine warms from run to run: k_e falls and the stator resistance rises with the order of the runs and "
        "the heat of their currents.",
        shows_as="vdc, idc, torque and force below the baseline, the more the later the run, also at small current; in the "
        "first run nothing.",
        taken_for="roll-off (ke_rolloff), which follows the current within each run; the same where the runs were made in the "
        "order of their loads. A light load repeated at the end distinguishes the two.",
        source="copper 0.39 %/K; magnets about -0.1 %/K (NdFeB), -0.2 %/K (ferrite); Hsu et al. 2026, Sec. 4.3.1.",
        fields=(
            Parameter(
                "k_e_change", "1", -0.1, 0.0, (-0.9, 0.0), "magnets up to 100 K warmer", "generator.k_e", "scale"
            ),
            Parameter("r_s_change", "1", 0.0, 0.6, (0.0, 9.0), "copper up to 150 K warmer", "generator.r_s", "scale"),
            Parameter("time_constant", "1", 0.3, 30.0, (0.01, 1000.0), _COOLING, absent=6.0),
            Parameter("by_current", "1", 0.0, 1.0, (0.0, 1.0), "heat from I2R, beside iron and friction", absent=0.5),
        ),
        display=Display("k_e in the warmest run", 100.0, "%"),
        beside=("r_s_change",),
        over_runs=_warm_in_run,
        unlisted="a drift of the Vdc sensor from run to run",
    ),
    _effect(
        name="copper_heating",
        label="Stator resistance",
        summary="Stator resistance lies above its stated value: warm copper, or another resistance in series with it.",
        shows_as="vdc and idc below the baseline at small load resistance, torque and force by less; the loss grows "
        "with current squared.",
        taken_for="the slope of the diodes (diode_drop), which acts alike; their drop, whose loss grows with current; roll-off "
        "(ke_rolloff), which lowers torque more.",
        source="Hsu et al. 2026, Sec. 4.3.1: copper losses raised by temperature; copper gains 0.39 % per kelvin.",
        fields=(
            Parameter("r_s_change", "1", 0.0, 0.6, (0.0, 9.0), "copper 150 K above cold", "generator.r_s", "scale"),
        ),
        display=Display("stator resistance", 100.0, "%"),
        same_as=("diode_drop",),
        unlisted="a cable between machine and bridge or before the tap of Vdc",
    ),
    _effect(
        name="sync_inductance",
        label="Phase inductance",
        summary="Phase inductance differs from the maker's value.",
        shows_as="vdc, idc, torque and force deviate where speed and current are both high: commutation takes longer.",
        taken_for="roll-off (ke_rolloff), which needs current alone; hot copper (copper_heating), which needs no speed.",
        source="Hsu et al. 2026, Table 4 (constant Ld and Lq, Sec. 4.1.3).",
        fields=(Parameter("l_s_change", "1", -0.3, 0.3, ANY, "plausible range", "generator.l_s", "scale"),),
        display=Display("phase inductance", 100.0, "%"),
    ),
    _effect(
        name="diode_drop",
        label="Diode drop",
        summary="Each of the two conducting diodes drops more than 0.7 V, by a threshold and a slope over its current.",
        shows_as="vdc and idc low by a nearly constant voltage, which weighs most at low speed and small load "
        "resistance, with a little less torque and force; with a slope more at high current.",
        taken_for="another stator resistance (copper_heating), which acts as the slope does; a smaller back-EMF constant "
        "(ke_shift), whose drop grows with speed.",
        source="Hsu et al. 2026, Eq. 8 (0.7 V) and Sec. 4.3.1 (conduction losses of the bridge).",
        fields=(
            Parameter("v_d_extra", "V", 0.0, 1.5, (0.0, 100.0), "silicon diodes with their leads", "generator.v_diode"),
            Parameter("slope", "ohm", 0.0, 0.15, (0.0, 100.0), "1.2 V at 5 A, small bridges", "generator.r_diode"),
        ),
        display=Display("drop of each diode", 1.0, "V"),
        beside=("slope",),
        unlisted="a cable between machine and bridge or before the tap of Vdc, as the slope",
    ),
    _effect(
        name="load_drift",
        label="Load resistance",
        summary="Load resistance differs from its nominal value.",
        shows_as="vdc and idc deviate in opposite directions, their ratio by the same share at every speed, and torque and "
        "force with them; in open circuit nothing.",
        taken_for="gain errors of Vdc or Idc (voltage_gain, current_gain), which change that ratio but not the torque.",
        source="Hsu et al. 2026, Fig. 14d: the apparent resistance over speed; plausible range.",
        fields=(Parameter("r_load_change", "1", -0.1, 0.1, ANY, "a warm resistor", "dc_link.load_change", "compound"),),
        display=Display("load resistance", 100.0, "%"),
    ),
)
"""Effects of the stage generator."""
