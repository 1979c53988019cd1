"""`winchcascade simulate`, `calibrate`, `effects` and `rig`: the rig as a model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from winchcascade.batch.log_settings import settings_of
from winchcascade.cli.options import (
    NO_REPORT,
    ForceOption,
    JsonOption,
    LoadOption,
    RigOption,
    SheetOption,
    check_load,
    effect_names,
    name_argument,
    named_number,
    report_options,
    rig_names,
    valued_option,
)
from winchcascade.cli.outputs import (
    Printed,
    Results,
    check_outputs,
    deliver,
    given_command,
    report_maker_of,
    show,
    write_reports,
)
from winchcascade.core.errors import OptionError
from winchcascade.core.files import json_bytes, write_content
from winchcascade.core.jobs import one_thread_each
from winchcascade.report.report_files import ReportFiles

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Rig
    from winchcascade.rig.parts import Model

MotionArgument = Annotated[
    Path | None,
    typer.Argument(metavar="[LOG]", help="The log whose line motion drives the rig.", show_default=False),
]
ProfileOption = Annotated[
    Path | None,
    valued_option(
        "--profile",
        "FILE",
        "Take the line motion from this CSV file with the columns time_s and velocity_mps instead of a log.",
    ),
]
EffectsOption = Annotated[
    list[str] | None,
    valued_option(
        "--with",
        "EFFECT.FIELD=VALUE",
        "Apply an effect to the model; repeat it for several. `winchcascade effects` lists them.",
    ),
]


SensorsOption = Annotated[
    bool,
    typer.Option("--sensors", help="Add the errors of the sensors that the rig file states to what the sensors read."),
]


@report_options("html", "pdf", "figures", "tables")
def simulate_command(
    log: MotionArgument = None,
    profile: ProfileOption = None,
    load_ohm: LoadOption = None,
    rig: RigOption = None,
    sheet: SheetOption = None,
    effects: EffectsOption = None,
    sensors: SensorsOption = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Write the simulated log into this file.", show_default=False),
    ] = None,
    report: ReportFiles = NO_REPORT,
    force: ForceOption = False,
) -> None:
    """Simulate the rig along a line motion, and write what its sensors would have logged.

    The printed energies are those of the whole motion, up to the instant at which the energy of the line is largest. The
    simulated log keeps the load. Errors of sensors that a corrected rig file states are left out, unless --sensors is given.
    """
    from winchcascade.ingest.read import read_by
    from winchcascade.rig.baseline import sensor_errors
    from winchcascade.rig.simulate import simulate, write_log

    source = profile or log
    if source is None or (profile is not None and log is not None):
        raise OptionError("simulate: expected a LOG or --profile FILE, one of them.")
    if out is None:
        raise OptionError("simulate: expected --out FILE for the simulated log.")
    check_load(load_ohm)
    results: Results = {"--out": out, **report.by_option}
    check_outputs(results, [source, source.parent / "campaign.toml", rig], force=force)
    settings = settings_of(source, rig=rig, load_ohm=load_ohm, window=None, sheet=sheet)
    run = read_by(source, settings)
    if run.load is None:
        raise OptionError(f"{run.name}: its load is unknown; give --load-ohm OHM, inf for an open circuit.")
    left_out = [] if sensors else sensor_errors(settings.rig)
    simulation = simulate(run, _model(settings.rig, effects or [], sensors=sensors))
    write_log(simulation, out, force=force)

    from winchcascade.report.render.terminal import terminal_text
    from winchcascade.report.results.simulation import simulation_report

    words, command = ", ".join(effects or []), given_command()
    stated = simulation_report(
        simulation,
        rig=settings.rig,
        window=settings.window,
        source=str(source),
        effects=words,
        left_out=left_out,
        command=command,
    )
    write_reports(lambda: stated, report, f"{out.stem}_simulation", force=force)
    show(terminal_text(stated, [path for path in results.values() if path]))


def _model(rig: Rig, effects: Sequence[str], *, sensors: bool) -> Model:
    """Model of a rig with the effects of `--with` options, and with the errors of its sensors where they are wanted."""
    from winchcascade.rig.baseline import baseline
    from winchcascade.rig.effects.catalogue import make_effect

    model = baseline(rig) if sensors else baseline(rig).physics
    for name, fields in _fields(effects).items():
        model = make_effect(name, fields).apply(model)
    return model


def _fields(options: Sequence[str]) -> dict[str, dict[str, float]]:
    """Read EFFECT.FIELD=VALUE options: the fields of each effect."""
    fields: dict[str, dict[str, float]] = {}
    for option in options:
        place, value = named_number(option)
        name, _, field = place.partition(".")
        if not field or math.isnan(value):
            raise OptionError(
                f"--with {option}: expected EFFECT.FIELD=VALUE, such as gear_mesh_loss.efficiency_change=-0.03."
            )
        fields.setdefault(name, {})[field] = value
    return fields


@report_options("html", "pdf", "figures", "tables")
def calibrate_command(
    log: Annotated[
        Path, typer.Argument(metavar="OPEN_CIRCUIT_LOG", help="The log of a run in open circuit.", show_default=False)
    ],
    rig: RigOption = None,
    load_ohm: LoadOption = None,
    sheet: SheetOption = None,
    write: Annotated[
        Path | None, valued_option("--write", "RIG.toml", "Write a rig file with the calibrated numbers.")
    ] = None,
    json: JsonOption = None,
    report: ReportFiles = NO_REPORT,
    force: ForceOption = False,
) -> None:
    """Calibrate a rig by a run in open circuit: back-EMF constant, damper and screw friction, with their uncertainty."""
    one_thread_each()
    from winchcascade.diagnosis.calibrate import calibrate
    from winchcascade.diagnosis.rig_text import calibrated_text
    from winchcascade.ingest.read import read_by
    from winchcascade.report.render.terminal import terminal_text
    from winchcascade.report.results.calibration import calibration_report
    from winchcascade.report.results.calibration_record import calibration_record

    check_load(load_ohm)
    settings = settings_of(log, rig=rig, load_ohm=load_ohm, window=None, sheet=sheet)
    results: Results = {"--json": json, "--write": write, **report.by_option}
    check_outputs(results, [log, log.parent / "campaign.toml", settings.rig.path], force=force)
    run = read_by(log, settings)
    calibration = calibrate(run)
    if write is not None:
        write_content(write, calibrated_text(calibration), force=force)
    write_reports(report_maker_of(calibration), report, f"{Path(run.name).stem}_calibration", force=force)
    printed = Printed(
        lambda: terminal_text(calibration_report(calibration), [path for path in results.values() if path])
    )
    deliver(json, lambda: json_bytes(calibration_record(calibration)), printed, force=force)


def effects_command(
    name: Annotated[
        str | None, name_argument("The effect to describe; without it all are listed.", effect_names)
    ] = None,
) -> None:
    """List the effects that the model of a rig leaves out, or describe one of them in full."""
    from winchcascade.report.render.terminal import terminal_text
    from winchcascade.report.results.effects import effects_report

    show(terminal_text(effects_report(name)))


def rig_command(
    name: Annotated[
        str | None, name_argument("The built-in rig: hsu2026 (the default) or kitepower.", rig_names)
    ] = None,
) -> None:
    """Print a built-in rig file, as a start for your own."""
    from winchcascade.core.rig_toml import DEFAULT_RIG, built_in_text

    show(built_in_text(name or DEFAULT_RIG))
