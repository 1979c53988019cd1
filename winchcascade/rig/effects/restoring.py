"""Effects of screw, piston and gas."""

from functools import partial

from msgspec.structs import replace

from winchcascade.rig.effects.effect import ANY, Display, Effect, Parameter, Values
from winchcascade.rig.effects.run_order import RunPlace, passed
from winchcascade.rig.parts import Model

_effect = partial(Effect, stage="restoring")


def _heated(model: Model, values: Values) -> Model:
    """Raise the exponent; where the gas of the model heats already, it cools by the mean of both times."""
    gas = model.restoring
    exponent, cooling = hotter((gas.exponent, gas.cooling), values)
    return replace(model, restoring=replace(gas, exponent=exponent, cooling=cooling))


def hotter(first: Values, second: Values) -> Values:
    """Exponent [1] and cooling [s] of two heats of a gas together: exponents add, times by the share of each.

    >>> hotter((1.25, 4.0), (1.25, 8.0)), hotter((1.2, 4.0), (1.0, 6.0))
    ((1.5, 6.0), (1.2, 4.0))
    """
    (n, cooling), (more, other) = first, second
    both = n - 1.0 + more - 1.0
    share = (more - 1.0) / both if both > 0.0 else 1.0
    return n + (more - 1.0), cooling + share * (other - cooling)


def _leaked_in_run(values: Values, place: RunPlace) -> Values:
    return (values[0] * passed(place.order)[place.number],)


RESTORING = (
    _effect(
        name="gas_polytropic",
        label="Gas heating",
        summary="Gas heats when it is compressed, cools when it expands, and takes seconds to come back to the ambient "
        "temperature.",
        shows_as="pressure and force above the baseline late in payout, falling back in hold, and below it late in haul-in.",
        taken_for="a smaller gas volume (gas_volume), whose pressure stays in hold; seals (seal_friction), which "
        "pressure does not show.",
        source="Hsu et al. 2026, Sec. 4.1.2: isothermal is assumed, 15 K at worst; adiabatic exponent of nitrogen 1.4.",
        fields=(
            Parameter("n", "1", 1.0, 1.4, (1.0, 1.67), "isothermal to adiabatic", absent=1.0),
            Parameter("cooling", "s", 1.0, 60.0, (0.01, 10000.0), "time in which the heat is given back", absent=6.0),
        ),
        display=Display("polytropic exponent", 1.0, "", signed=False),
        law=_heated,
        together=hotter,
    ),
    _effect(
        name="gas_volume",
        label="Gas volume",
        summary="Effective gas volume differs from that of the accumulator.",
        shows_as="pressure and force rise less or more with the displacement, in payout, hold and haul-in alike; at "
        "zero payout they agree.",
        taken_for="another precharge (precharge), which zero payout shows; another piston area (piston_area), whose "
        "force differs at zero payout.",
        source="Hsu et al. 2026, Table 3 (4 L) against the printed rise of 21 to 25 kg/cm2 (Sec. 4.1.2), which would "
        "need about 6 L.",
        fields=(Parameter("volume_extra", "m3", -0.001, 0.003, (-0.002, 1.0), "4 L and 6 L", "restoring.volume"),),
        display=Display("gas volume", 1000.0, "L"),
    ),
    _effect(
        name="precharge",
        label="Precharge pressure",
        summary="Precharge pressure of the gas differs.",
        shows_as="pressure and force deviate by the same share of the absolute pressure at every displacement, in every phase.",
        taken_for="a zero error of the pressure sensor, which does not grow with displacement and leaves force alone; "
        "another gas volume (gas_volume).",
        source="Hsu et al. 2026: 20.5 kg/cm2 in Sec. 3.1, 21 kg/cm2 in Sec. 4.1.2, 21 bar in Table 3; twice over.",
        fields=(Parameter("pressure_change", "1", -0.1, 0.1, ANY, "Sec. 3.1, Table 3", "restoring.pressure", "scale"),),
        display=Display("precharge, absolute", 100.0, "%"),
        unlisted="a gain of the pressure sensor beyond its tolerance",
    ),
    _effect(
        name="gas_loss",
        label="Gas loss",
        summary="The accumulator loses gas: its pressure falls from run to run.",
        shows_as="pressure and force below the baseline by a share of the absolute pressure that grows from run to run; in the "
        "first run nothing.",
        taken_for="another precharge (precharge), which is the same in every run; a drift of the pressure sensor, which leaves "
        "the force alone.",
        source="valves and seals; plausible range.",
        fields=(
            Parameter("pressure_change", "1", -0.1, 0.0, (-0.9, 0.0), "by the last run", "restoring.pressure", "scale"),
        ),
        display=Display("precharge by the last run", 100.0, "%"),
        over_runs=_leaked_in_run,
    ),
    _effect(
        name="piston_area",
        label="Piston area",
        summary="Effective piston area differs.",
        shows_as="force deviates at every displacement, and pressure rises less or more with it; at zero payout the "
        "pressure agrees.",
        taken_for="another gas volume (gas_volume), whose force agrees at zero payout; screw friction "
        "(screw_friction), which pressure does not show.",
        source="Hsu et al. 2026, Table 3: 7850 mm2; Sec. 4.1.2 would need about 30 % less.",
        fields=(Parameter("area_change", "1", -0.3, 0.2, (-0.9, 2.0), "plausible range", "restoring.area", "scale"),),
        display=Display("piston area", 100.0, "%"),
    ),
    _effect(
        name="seal_friction",
        label="Seal friction",
        summary="Constant friction of the piston seals.",
        shows_as="force above the baseline in payout and below it in haul-in, by an amount that no pressure changes; "
        "torque and pressure agree.",
        taken_for="friction before the screw (line_friction), which weighs alike in payout and haul-in; screw friction "
        "(screw_friction), which grows with pressure.",
        source="Hsu et al. 2026, Sec. 4.2: seals are lumped into the screw; plausible range.",
        fields=(
            Parameter(
                "force", "N", 0.0, 1500.0, (0.0, 100000.0), "a tenth of the gas thrust", "restoring.seal_friction"
            ),
        ),
        display=Display("friction of the seals", 1.0, "N", signed=False),
    ),
    _effect(
        name="screw_friction",
        label="Screw friction",
        summary="Friction coefficient of the screw differs.",
        shows_as="force deviates in payout and in haul-in, in opposite directions and in proportion to pressure; torque and "
        "pressure agree.",
        taken_for="seals (seal_friction) or friction at the drum (line_friction), whose amount no pressure changes.",
        source="Hsu et al. 2026, Table 3 and Sec. 4.2: 0.04, calibrated; ball screws reach 0.01.",
        fields=(Parameter("mu_change", "1", -0.04, 0.04, (-0.04, 0.045), "up to self-locking", "restoring.mu"),),
        display=Display("friction of the screw"),
    ),
)
"""Effects of the stage restoring."""
