"""Errors of sensors and of the logger."""

from typing import NamedTuple

from winchcascade.rig.effects.effect import Change, Display, Effect, Field


class _Sensor(NamedTuple):
    """A sensor: its channel, its label, its name in a sentence, and beside a number where that is a shorter one."""

    channel: str
    label: str
    name: str
    short: str = ""


def _gain(name: str, of: _Sensor, *, shows_as: str, taken_for: str, source: str, unlisted: str = "") -> Effect:
    """Declare the gain error of a sensor."""
    return Effect(
        name=name,
        label=f"{of.label} gain",
        stage="sensor",
        summary=f"Gain error of {of.name}.",
        shows_as=shows_as,
        taken_for=taken_for,
        source=source,
        fields=(Field("gain_error", "1", -0.1, 0.1, (-0.9, 9.0), "plausible range"),),
        display=Display(f"gain of {of.short or of.name}", 100.0, "%"),
        law=Change(f"sensors.gain.{of.channel}", "compound"),
        unlisted=unlisted,
    )


SENSOR = (
    _gain(
        "torque_gain",
        _Sensor("torque", "Torque sensor", "the torque sensor"),
        shows_as="torque alone, by the same share at every speed and load.",
        taken_for="another mesh efficiency (gear_mesh_loss), which the force shows too.",
        source="Hsu et al. 2026, Table 1: 0.2 % of full scale; plausible range of a sensor not calibrated in place.",
    ),
    Effect(
        name="force_zero",
        label="Force cell zero",
        stage="sensor",
        summary="Zero error of the force cell.",
        shows_as="force alone, by the same amount in every phase.",
        taken_for="another precharge (precharge), which pressure shows; friction (line_friction), which turns round "
        "with the motion.",
        source="Hsu et al. 2026, Table 1: 0.2 % of 2000 kg are 39 N.",
        fields=(Field("offset", "N", -150.0, 150.0, (-100000.0, 100000.0), "Table 1, four times over"),),
        display=Display("zero of the force cell", 1.0, "N"),
        law=Change("sensors.zero.force", "add"),
    ),
    _gain(
        "force_gain",
        _Sensor("force", "Force cell", "the force cell"),
        shows_as="force alone, by the same share in every phase.",
        taken_for="layers of rope (drum_layering), whose share grows with displacement; drag (line_drag), which turns "
        "round with the motion.",
        source="Hsu et al. 2026, Table 1: 0.2 % of full scale; plausible range of a cell not calibrated in place.",
        unlisted="a loss in proportion to the force, as over a sheave,",
    ),
    _gain(
        "voltage_gain",
        _Sensor("vdc", "Vdc sensor", "the voltage Vdc", "Vdc"),
        shows_as="vdc alone, by the same share at every speed and load, and with it the apparent load resistance.",
        taken_for="another back-EMF constant (ke_shift), which torque and idc show; another load (load_drift), which "
        "idc shows.",
        source="Not published; Hsu et al. 2026 name no accuracy for Vdc. Plausible range.",
    ),
    _gain(
        "current_gain",
        _Sensor("idc", "Idc sensor", "the current Idc", "Idc"),
        shows_as="idc alone, by the same share at every speed and load, and with it the apparent load resistance.",
        taken_for="another load (load_drift), which vdc and torque show.",
        source="Not published; Hsu et al. 2026 name no accuracy for Idc. Plausible range.",
    ),
    _gain(
        "pressure_gain",
        _Sensor("pressure", "Pressure sensor", "the pressure sensor"),
        shows_as="pressure alone, by the same share at every displacement, in every phase.",
        taken_for="another precharge (precharge), which force shows too, but not where piston and gas (piston_area, "
        "gas_volume) are smaller by the same share.",
        source="Hsu et al. 2026, Table 1: 0.1 % of full scale, 20 MPa; plausible range of a sensor not calibrated in "
        "place.",
    ),
    Effect(
        name="electrical_lag",
        label="Vdc and Idc delay",
        stage="sensor",
        summary="Vdc and Idc are recorded late, by a pure delay.",
        shows_as="vdc and idc alone, while speed changes: low as it rises, high as it falls; the plateau agrees.",
        taken_for="another capacitor of the DC link, which delays less the smaller the load; inertia (rotor_inertia), "
        "which torque shows.",
        source="Hsu et al. 2026, Sec. 2.2: all channels at 25 Hz; plausible range of several samples.",
        fields=(Field("lag", "s", 0.0, 0.4, (0.0, 60.0), "plausible range: ten samples of 25 Hz"),),
        display=Display("delay of Vdc and Idc", 1000.0, "ms", signed=False),
        law=Change("sensors.electrical_lag", "add"),
    ),
)
"""Effects of the stage sensor."""
