"""Errors of sensors and of the logger."""

from functools import partial

from winchcascade.rig.effects.effect import ANY, Display, Effect, Parameter

_error = partial(Effect, stage="sensor")


def _gain(channel: str) -> tuple[Parameter, ...]:
    return (Parameter("gain_error", "1", -0.1, 0.1, ANY, "plausible range", f"sensors.gain.{channel}", "compound"),)


SENSOR = (
    _error(
        name="torque_gain",
        label="Torque sensor gain",
        summary="Gain error of the torque sensor.",
        shows_as="torque alone, by the same share at every speed and load.",
        taken_for="another mesh efficiency (gear_mesh_loss), which the force shows too.",
        source="Hsu et al. 2026, Table 1: 0.2 % of full scale; plausible range of a sensor not calibrated in place.",
        fields=_gain("torque"),
        display=Display("gain of the torque sensor", 100.0, "%"),
    ),
    _error(
        name="force_zero",
        label="Force cell zero",
        summary="Zero error of the force cell.",
        shows_as="force alone, by the same amount in every phase.",
        taken_for="another precharge (precharge), which pressure shows; friction (line_friction), which turns round "
        "with the motion.",
        source="Hsu et al. 2026, Table 1: 0.2 % of 2000 kg are 39 N; four times over.",
        fields=(Parameter("offset", "N", -150.0, 150.0, (-1e5, 1e5), "Table 1", "sensors.zero.force"),),
        display=Display("zero of the force cell", 1.0, "N"),
    ),
    _error(
        name="force_gain",
        label="Force cell gain",
        summary="Gain error of the force cell.",
        shows_as="force alone, by the same share in every phase.",
        taken_for="layers of rope (drum_layering), whose share grows with displacement; drag (line_drag), which turns "
        "round with the motion.",
        source="Hsu et al. 2026, Table 1: 0.2 % of full scale; plausible range of a cell not calibrated in place.",
        fields=_gain("force"),
        display=Display("gain of the force cell", 100.0, "%"),
        unlisted="a loss in proportion to the force, as over a sheave,",
    ),
    _error(
        name="voltage_gain",
        label="Vdc sensor gain",
        summary="Gain error of the voltage Vdc.",
        shows_as="vdc alone, by the same share at every speed and load, and with it the apparent load resistance.",
        taken_for="another back-EMF constant (ke_shift), which torque and idc show; another load (load_drift), which "
        "idc shows.",
        source="Not published; Hsu et al. 2026 name no accuracy for Vdc. Plausible range.",
        fields=_gain("vdc"),
        display=Display("gain of Vdc", 100.0, "%"),
    ),
    _error(
        name="current_gain",
        label="Idc sensor gain",
        summary="Gain error of the current Idc.",
        shows_as="idc alone, by the same share at every speed and load, and with it the apparent load resistance.",
        taken_for="another load (load_drift), which vdc and torque show.",
        source="Not published; Hsu et al. 2026 name no accuracy for Idc. Plausible range.",
        fields=_gain("idc"),
        display=Display("gain of Idc", 100.0, "%"),
    ),
    _error(
        name="pressure_gain",
        label="Pressure sensor gain",
        summary="Gain error of the pressure sensor.",
        shows_as="pressure alone, by the same share at every displacement, in every phase.",
        taken_for="another precharge (precharge), which force shows too, but not where piston and gas (piston_area, "
        "gas_volume) are smaller by the same share.",
        source="Hsu et al. 2026, Table 1: 0.1 % of full scale, 20 MPa; plausible range of a sensor not calibrated in place.",
        fields=_gain("pressure"),
        display=Display("gain of the pressure sensor", 100.0, "%"),
    ),
    _error(
        name="electrical_lag",
        label="Vdc and Idc delay",
        summary="Vdc and Idc are recorded late, by a pure delay.",
        shows_as="vdc and idc alone, while speed changes: low as it rises, high as it falls; the plateau agrees.",
        taken_for="another capacitor of the DC link, which delays less the smaller the load; inertia (rotor_inertia), "
        "which torque shows.",
        source="Hsu et al. 2026, Sec. 2.2: all channels at 25 Hz; plausible range of several samples.",
        fields=(Parameter("lag", "s", 0.0, 0.4, (0.0, 60.0), "ten samples of 25 Hz", "sensors.electrical_lag"),),
        display=Display("delay of Vdc and Idc", 1000.0, "ms", signed=False),
    ),
)
"""Effects of the stage sensor."""
