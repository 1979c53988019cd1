"""`winchcascade simulate`, `calibrate`, `effects` and `rig`: the rig as a model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from winchcascade.batch.log_settings import settings_of
from winchcascade.cli.options import (
    OUTPUTS,
    RIGS,
    argument,
    check_load,
    effect_names,
    named_number,
    option,
    with_options,
)
from winchcascade.cli.outputs import NO_OUTPUTS, REPORT, Outputs, given_command, present, show
from winchcascade.core.errors import OptionError
from winchcascade.core.jobs import one_thread_each

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run
    from winchcascade.rig.parts import Model


@with_options(
    "out",
    *REPORT,
    log=argument("[LOG]", "The log whose line motion drives the rig."),
    out=option("--out", "FILE", "Write the simulated log into this file.", OUTPUTS),
)
def simulate_command(
    log: Path | None = None,
    profile: Path | None = None,
    load_ohm: float | None = None,
    rig: str | None = None,
    sheet: str | None = None,
    effects: list[str] | None = None,
    sensors: bool = False,
    outputs: Outputs = NO_OUTPUTS,
) -> None:
    """Simulate the rig along a line motion, and write what its sensors would have logged.

    The printed energies are those of the whole motion, up to the instant at which the energy of the
    line is largest. The simulated log keeps the load. Errors of sensors that a corrected rig file
    states are left out, unless --sensors is given.
    """
    from winchcascade.ingest.read import read_by
    from winchcascade.report.results.simulation import simulation_report
    from winchcascade.rig.baseline import sensor_errors
    from winchcascade.rig.simulate import simulate, write_log

    source, out = profile or log, outputs["out"]
    if source is None or (profile is not None and log is not None):
        raise OptionError("simulate: expected a LOG or --profile FILE, one of them.")
    if out is None:
        raise OptionError("simulate: expected --out FILE for the simulated log.")
    check_load(load_ohm)
    outputs.check([source, source.parent / "campaign.toml", rig])
    settings = settings_of(source, rig=rig, load_ohm=load_ohm, window=None, sheet=sheet)
    run = read_by(source, settings)
    if run.load is None:
        raise OptionError(
            f"{run.name}: its load is unknown; give --load-ohm OHM, inf for an open circuit."
        )
    model = _model(settings.rig, effects or [], run, sensors=sensors)
    simulation = simulate(run, model)
    write_log(simulation, out, force=outputs.force)
    report = partial(
        simulation_report,
        simulation,
        rig=settings.rig,
        window=settings.window,
        source=str(source),
        effects=", ".join(effects or []),
        left_out=[] if sensors else sensor_errors(settings.rig),
        command=given_command(),
    )
    present(report, outputs, name=f"{out.stem}_simulation")


def _model(rig: Rig, effects: Sequence[str], run: Run, *, sensors: bool) -> Model:
    """Model of a rig with the effects of `--with` options, and with the errors of its sensors
    where they are wanted.
    """
    from winchcascade.core.scales import motion_of_runs, scales_of
    from winchcascade.rig.baseline import baseline, missing_part
    from winchcascade.rig.effects.catalogue import make_effect

    model, scales = (
        baseline(rig) if sensors else baseline(rig).physics,
        scales_of(rig, motion_of_runs([run])),
    )
    for name, fields in _fields(effects).items():
        effect = make_effect(name, fields, scales)
        if part := missing_part(effect.effect, rig):
            raise OptionError(
                f"--with {name}: rig {rig.name} has no {part}, which this effect acts on; leave "
                f"it out."
            )
        model = effect.apply(model)
    return model


def _fields(options: Sequence[str]) -> dict[str, dict[str, float]]:
    """Read EFFECT.FIELD=VALUE options: the fields of each effect."""
    fields: dict[str, dict[str, float]] = {}
    for given in options:
        place, value = named_number(given)
        name, _, field = place.partition(".")
        if not field or math.isnan(value):
            raise OptionError(
                f"--with {given}: expected EFFECT.FIELD=VALUE, such as "
                f"gear_mesh_loss.efficiency_change=-0.03."
            )
        fields.setdefault(name, {})[field] = value
    return fields


@with_options(
    "json",
    *REPORT,
    "write",
    log=argument("OPEN_CIRCUIT_LOG", "The log of a run in open circuit."),
    write=option("--write", "RIG.toml", "Write a rig file with the calibrated numbers.", OUTPUTS),
)
def calibrate_command(
    log: Path,
    rig: str | None = None,
    load_ohm: float | None = None,
    sheet: str | None = None,
    outputs: Outputs = NO_OUTPUTS,
) -> None:
    """Calibrate a rig by a run in open circuit: back-EMF constant, viscous loss, screw friction,
    with their uncertainty.
    """
    one_thread_each()
    from winchcascade.diagnosis.handover.calibrate import calibrate
    from winchcascade.diagnosis.handover.rig_text import calibrated_text
    from winchcascade.ingest.read import read_by
    from winchcascade.report.results.calibration import calibration_record, calibration_report

    check_load(load_ohm)
    settings = settings_of(log, rig=rig, load_ohm=load_ohm, window=None, sheet=sheet)
    outputs.check([log, log.parent / "campaign.toml", settings.rig.path])
    run = read_by(log, settings)
    calibration = calibrate(run)
    present(
        lambda: calibration_report(calibration, command=given_command()),
        outputs,
        record=lambda: calibration_record(calibration),
        texts={"write": lambda: calibrated_text(calibration)},
        name=f"{Path(run.name).stem}_calibration",
    )


@with_options(
    name=argument("[NAME]", "The effect to describe; without it all are listed.", effect_names)
)
def effects_command(name: str | None = None) -> None:
    """List the effects that the model of a rig leaves out, or describe one of them in full."""
    from winchcascade.report.results.effects import effects_report

    present(lambda: effects_report(name), NO_OUTPUTS)


@with_options(
    "export",
    name=argument(
        "[NAME]",
        "The built-in rig, hsu2026 (the default) or kitepower; with --export also a rig file.",
        RIGS,
    ),
    export=option(
        "--export", "FILE", "Write the model of the rig as an .fmu for other simulators.", OUTPUTS
    ),
)
def rig_command(name: str | None = None, outputs: Outputs = NO_OUTPUTS) -> None:
    """Print a built-in rig file, as a start for your own, or write the model of a rig for other
    simulators.
    """
    from winchcascade.core.rig_toml import DEFAULT_RIG, built_in_text

    path = outputs["export"]
    if path is None:
        show(built_in_text(name or DEFAULT_RIG))
        return
    from winchcascade.rig.baseline import load_rig
    from winchcascade.rig.fmu_export import write_rig

    outputs.check([name])
    write_rig(load_rig(name or DEFAULT_RIG), path, force=outputs.force)
