"""The command line: every command reads, calls one function and shows."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, NoReturn, TextIO

import typer

from winchcascade.errors import LogError, OptionError, WinchcascadeError

if TYPE_CHECKING:
    from winchcascade.cascade.reduce import Reduction
    from winchcascade.published.audit import Audit
    from winchcascade.reach.reach import Reach
    from winchcascade.rigfile import Rig

app = typer.Typer(
    help="Energies and efficiencies from the log of a winch-driven power take-off.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

RigOption = Annotated[
    str | None, typer.Option("--rig", metavar="RIG", help="Rig file, or a built-in rig: hsu2026 (default), kitepower.")
]
WindowOption = Annotated[
    str | None,
    typer.Option("--window", metavar="RULE", help="auto, payout, or a length in seconds; the rig's rule by default."),
]
LoadOption = Annotated[
    float | None, typer.Option("--load-ohm", metavar="OHM", help="Load resistance; inf is an open circuit.")
]
JsonOption = Annotated[
    str | None, typer.Option("--json", metavar="FILE", help="Write the result as JSON; - prints it alone.")
]
JobsOption = Annotated[
    int | None, typer.Option("--jobs", metavar="N", min=1, help="Processes; by default one for each processor.")
]
ForceOption = Annotated[
    bool, typer.Option("--force", help="Replace existing files, also those that another program wrote.")
]


def _version(wanted: bool) -> None:
    if wanted:
        import platform

        import numpy
        import pyarrow

        from winchcascade import __version__

        print(
            f"winchcascade {__version__} (Python {platform.python_version()}, numpy {numpy.__version__}, "
            f"pyarrow {pyarrow.__version__})"
        )
        raise typer.Exit


@app.callback()
def winchcascade(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Energies and efficiencies from the log of a winch-driven power take-off."""


@app.command("reduce")
def reduce_command(
    log: Annotated[
        Path, typer.Argument(metavar="LOG", help="CSV, .lvm, TDMS, MATLAB, Parquet or Excel.", show_default=False)
    ],
    rig: RigOption = None,
    load_ohm: LoadOption = None,
    window: WindowOption = None,
    json: JsonOption = None,
    parquet: Annotated[
        Path | None, typer.Option("--parquet", metavar="FOLDER", help="Write cycles, bins and findings as Parquet.")
    ] = None,
    html: Annotated[
        Path | None, typer.Option("--html", metavar="FILE", help="Write the report as one self-contained page.")
    ] = None,
    pdf: Annotated[Path | None, typer.Option("--pdf", metavar="FILE", help="Write the report as PDF.")] = None,
    force: ForceOption = False,
) -> None:
    """Reduce one log: its cycles, their energies and efficiencies, and what is wrong with it.

    What the options leave open is taken from a campaign.toml in the log's folder, if it lists the log.
    """
    from winchcascade.cascade.reduce import reduce, require_payouts, window_rule
    from winchcascade.ingest.read import read_run
    from winchcascade.report.terminal import reduction_text

    _check_load(load_ohm)
    if window is not None:
        window_rule(window)
    results = {"--json": Path(json) if json else None, "--html": html, "--pdf": pdf, "--parquet": parquet}
    inputs = [log, log.parent / "campaign.toml", *([Path(rig)] if rig else [])]
    _check_outputs(results, inputs, force=force)
    settings = _settings(log, rig, load_ohm, window)
    run = read_run(log, rig=settings.rig, load=settings.load, load_source=settings.load_source, about=settings.about)
    reduction = reduce(run, rig=settings.rig, window=settings.window, cycles=settings.cycles)
    require_payouts(reduction)
    if parquet is not None:
        from winchcascade.report.records import write_parquet

        write_parquet(reduction, parquet, force=force)
    if json is not None or html is not None or pdf is not None:
        from winchcascade.cascade.montecarlo import uncertainty

        found = uncertainty(reduction)
        if html is not None or pdf is not None:
            from winchcascade.report.document import write_reports

            write_reports(reduction, found, html=html, pdf=pdf, command=_command(), force=force)
        if json is not None:
            from winchcascade.report.records import reduction_json, write_json

            if json == "-":
                sys.stdout.buffer.write(reduction_json(reduction, found))
                return
            write_json(reduction, found, Path(json), force=force)
    _show(reduction_text(reduction))


def _show(text: str, *, file: TextIO | None = None, flush: bool = False) -> None:
    """Print lines, with a question mark for each character that a terminal would obey: names from files may hold any."""
    from winchcascade.plaintext import lines

    print(lines(text), end="", file=file, flush=flush)


def _check_load(load_ohm: float | None) -> None:
    if load_ohm is not None and not load_ohm > 0:
        raise OptionError(f"--load-ohm {load_ohm:g}: expected a number of ohms above 0, or inf for an open circuit.")


def _command() -> str:
    """The command as it was given, to be given again."""
    import shlex

    return shlex.join(["winchcascade", *sys.argv[1:]])


def _check_outputs(results: Mapping[str, Path | None], inputs: Sequence[Path], *, force: bool) -> None:
    """Refuse, before any work, a file that a result must not replace, and two results of one name."""
    from winchcascade.files import check_replaceable

    taken: dict[Path, str] = {}
    for option, result in results.items():
        if result is None or (option == "--json" and str(result) == "-"):
            continue
        if str(result) in ("-", "."):
            raise OptionError(f"{option} {result}: expected the name of a file.")
        other = taken.setdefault(Path(os.path.realpath(result)), option)
        if other != option:
            raise OptionError(f"{other} and {option} both name {result}; give each a name of its own.")
        if option == "--parquet":
            continue
        for source in inputs:  # also with --force
            if result.exists() and source.exists() and source.samefile(result):
                raise OptionError(f"{option} {result}: is an input of this command; give the result another name.")
        check_replaceable(result, force=force)


@app.command("batch")
def batch_command(
    targets: Annotated[
        list[str],
        typer.Argument(
            metavar="TARGET...",
            help="A campaign.toml, a folder, a pattern, logs, or addresses such as s3://...",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="FOLDER", help="Folder of the results; used again, it keeps what is done.")
    ],
    jobs: JobsOption = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="Work on this Dask scheduler, such as tcp://host:8786."),
    ] = None,
    reports: Annotated[
        str,
        typer.Option(
            "--reports", metavar="none|html|all", help="Reports of each log and of the campaign; all: PDF too."
        ),
    ] = "html",
    excel: Annotated[bool, typer.Option("--excel", help="Write the tables as an Excel workbook too.")] = False,
    rig: RigOption = None,
    window: WindowOption = None,
    force: ForceOption = False,
) -> None:
    """Reduce a whole campaign: every log, the tables of all, and a report.

    What is done already is kept as long as log, options and version are the same. Exit code 1 if a log failed.
    """
    from winchcascade.batch.plan import make_plan
    from winchcascade.batch.run import REPORTS, run_batch
    from winchcascade.cascade.reduce import window_rule
    from winchcascade.report.campaign_text import campaign_text
    from winchcascade.report.progress import Progress
    from winchcascade.tasks import processes

    if reports not in REPORTS:
        raise OptionError(f"--reports {reports}: expected none, html or all.")
    rule = None if window is None else window_rule(window)
    plan = make_plan(targets, rig=rig, window=rule)
    with Progress(plan.title) as watch:
        batch = run_batch(
            plan, out, reports=REPORTS[reports], jobs=jobs or processes(), scheduler=scheduler, workbook=excel,
            command=_command(), force=force, watch=watch,
        )  # fmt: skip
    _show(campaign_text(batch.summary, out, kept=batch.kept))
    raise typer.Exit(1 if batch.faults else 0)


@app.command("check")
def check_command(
    results: Annotated[
        Path,
        typer.Argument(
            metavar="RESULTS|CAMPAIGN",
            help="A campaign, the folder of a batch, or a reduction's JSON.",
            show_default=False,
        ),
    ],
    against: Annotated[
        str,
        typer.Option(
            "--against", metavar="TABLE", help="Table file, or the built-in hsu2026-table2.", show_default=False
        ),
    ],
    tolerance: Annotated[
        list[str] | None,
        typer.Option("--tolerance", metavar="PART=FACTOR", help="Widen or narrow rounding, deviation or uncertainty."),
    ] = None,
    junit: Annotated[Path | None, typer.Option("--junit", metavar="FILE", help="Write a JUnit file.")] = None,
    github: Annotated[bool, typer.Option("--github", help="Print annotations for GitHub, too.")] = False,
    json: JsonOption = None,
    jobs: JobsOption = None,
    force: ForceOption = False,
) -> None:
    """Compare results with a published table, cell by cell. Exit code 1 if any cell misses.

    A cell agrees within the table's rounding, the largest deviation of the measured cycles and twice the standard
    uncertainty together.
    """
    from winchcascade.batch.results import load_results
    from winchcascade.files import write_content
    from winchcascade.published.check import Factors, check, measured_from_record
    from winchcascade.report.check_text import check_record, check_text, github_annotations, junit_xml
    from winchcascade.tabletoml import load_table
    from winchcascade.tasks import processes

    around = results if results.is_dir() else results.parent
    inputs = [results, Path(against), *around.glob("*"), *around.glob("runs/*")]
    _check_outputs({"--junit": junit, "--json": Path(json) if json else None}, inputs, force=force)
    factors = Factors(**_factors(tolerance or []))
    table = load_table(against)
    found = load_results(results, jobs=jobs or processes())
    measured = [measured_from_record(record, name) for name, record in found.records]
    outcome = check(measured, table, factors, whole_campaign=found.whole)
    if junit is not None:
        write_content(junit, junit_xml(outcome), force=force)
    if not _write_json(json, check_record(outcome), force):
        _show(check_text(outcome))
    if github:
        _show(github_annotations(outcome, table.path), file=sys.stderr if json == "-" else sys.stdout)
    raise typer.Exit(0 if outcome.ok else 1)


def _factors(options: Sequence[str]) -> dict[str, float]:
    """Read PART=FACTOR options."""
    factors: dict[str, float] = {}
    for option in options:
        name, _, text = option.partition("=")
        try:
            value = float(text)
        except ValueError:
            value = -1.0
        if name not in ("rounding", "deviation", "uncertainty") or not 0 <= value < 1e6:
            raise OptionError(
                f"--tolerance {option}: expected rounding, deviation or uncertainty and a factor, such as uncertainty=1.5."
            )
        factors[name] = value
    return factors


@app.command("audit")
def audit_command(
    table: Annotated[
        str, typer.Argument(metavar="TABLE", help="Table file, or the built-in hsu2026-table2.", show_default=False)
    ],
    physics: Annotated[
        bool, typer.Option("--physics", help="Hold it against the rig's constants too; takes some seconds.")
    ] = False,
    rig: RigOption = None,
    json: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Hold a published table against itself and the text around it, without any log. Exit code 1 on a contradiction.

    With --physics also against the model of a rig: which efficiencies any plausible payout reaches, and which effects could
    make up the difference.
    """
    from winchcascade.published.audit import audit
    from winchcascade.report.check_text import audit_record, audit_text
    from winchcascade.tabletoml import load_table

    if rig is not None and not physics:
        raise OptionError(f"--rig {rig}: is of use with --physics alone; add that, or leave the rig out.")
    _check_outputs({"--json": Path(json) if json else None}, [Path(table), *([Path(rig)] if rig else [])], force=force)
    outcome = audit(load_table(table))
    record, text, ok = audit_record(outcome), audit_text(outcome), outcome.ok
    if physics:
        from winchcascade.report.reach_text import reach_record, reach_text

        reach = _reach(outcome, rig)
        record, text, ok = record | {"physics": reach_record(reach)}, text + reach_text(reach), ok and reach.ok
    if not _write_json(json, record, force):
        _show(text)
    raise typer.Exit(0 if ok else 1)


def _reach(audit: Audit, rig: str | None) -> Reach:
    """What a rig can reach of a table, by the rules that reduce a log."""
    from winchcascade.cascade.first import first_metrics
    from winchcascade.effects.catalogue import EFFECTS
    from winchcascade.reach.reach import reach
    from winchcascade.report.progress import Progress
    from winchcascade.rigtoml import DEFAULT_RIG, load_rig

    of = load_rig(rig or DEFAULT_RIG)
    with Progress(f"physics of {audit.table.name}") as watch:
        return reach(
            audit.table, of, EFFECTS, lambda run, window: first_metrics(run, of, window), scatter=audit.known.eta,
            watch=watch,
        )  # fmt: skip


def _write_json(target: str | None, record: dict[str, Any], force: bool) -> bool:
    """Write a record as JSON if that is wanted; tells whether standard output holds it, and so must hold nothing else."""
    if target is None:
        return False
    import msgspec

    from winchcascade.files import write_content

    content = msgspec.json.format(msgspec.json.encode(record), indent=1).decode() + "\n"
    if target == "-":
        print(content, end="")
        return True
    write_content(Path(target), content, force=force)
    return False


@app.command("demo")
def demo_command(
    out: Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Folder that is made.")] = Path(
        "winchcascade-demo"
    ),
    jobs: JobsOption = None,
    force: ForceOption = False,
) -> None:
    """Reduce and diagnose the packaged campaign, simulated crane trials at seven loads, with all reports."""
    _one_thread_each()
    from winchcascade.batch.demo import copy_campaign, diagnose_copy
    from winchcascade.batch.plan import make_plan
    from winchcascade.batch.run import REPORTS, run_batch
    from winchcascade.effects.catalogue import EFFECTS
    from winchcascade.report.campaign_text import campaign_text
    from winchcascade.report.diagnosis_text import diagnosis_lines
    from winchcascade.report.progress import Progress, Telling
    from winchcascade.tasks import processes

    campaign = copy_campaign(out / "campaign", force=force)
    plan = make_plan([str(campaign)])
    with Progress(plan.title) as watch:
        batch = run_batch(
            plan, out / "results", reports=REPORTS["all"], jobs=jobs or processes(), workbook=True, command=_command(),
            force=force, watch=watch,
        )  # fmt: skip
    _show(campaign_text(batch.summary, batch.folder, kept=batch.kept), flush=True)
    _use_threads(jobs)
    with Telling(f"diagnosing {plan.title}") as tell:
        found, files = diagnose_copy(campaign, out / "results", EFFECTS, command=_command(), force=force, tell=tell)
    _show(diagnosis_lines(found, files))
    raise typer.Exit(1 if batch.faults else 0)


@app.command("simulate")
def simulate_command(
    log: Annotated[
        Path | None, typer.Argument(metavar="[LOG]", help="A log whose line motion drives the rig.", show_default=False)
    ] = None,
    profile: Annotated[
        Path | None, typer.Option("--profile", metavar="FILE", help="A profile instead, with time_s and velocity_mps.")
    ] = None,
    load_ohm: LoadOption = None,
    rig: RigOption = None,
    effects: Annotated[
        list[str] | None,
        typer.Option("--with", metavar="EFFECT.FIELD=VALUE", help="Switch an effect on; `effects` lists them."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="The simulated log.", show_default=False)
    ] = None,
    force: ForceOption = False,
) -> None:
    """Simulate the rig along a line motion, and write the log that its sensors would have written."""
    from winchcascade.effects.catalogue import make_effect
    from winchcascade.ingest.read import read_run
    from winchcascade.report.terminal import simulation_text
    from winchcascade.rig.model import baseline
    from winchcascade.rig.simulate import simulate
    from winchcascade.rig.write import write_log

    source = profile or log
    if source is None or (profile is not None and log is not None):
        raise OptionError("simulate: expected a LOG or --profile FILE, one of them.")
    if out is None:
        raise OptionError("simulate: expected --out FILE for the simulated log.")
    _check_load(load_ohm)
    _check_outputs({"--out": out}, [source, *([Path(rig)] if rig else [])], force=force)
    settings = _settings(source, rig, load_ohm, None)
    run = read_run(source, rig=settings.rig, load=settings.load, load_source=settings.load_source, about=settings.about)
    if run.load is None:
        raise OptionError(f"{run.name}: its load is unknown; give --load-ohm OHM, inf for an open circuit.")
    model = baseline(settings.rig)
    for name, fields in _fields(effects or []).items():
        model = make_effect(name, fields).bend(model)
    simulation = simulate(run, model)
    write_log(simulation, out, force=force)
    _show(simulation_text(simulation, out))


def _fields(options: Sequence[str]) -> dict[str, dict[str, float]]:
    """Read EFFECT.FIELD=VALUE options: the fields of each effect."""
    fields: dict[str, dict[str, float]] = {}
    for option in options:
        place, equals, text = option.partition("=")
        name, dot, field = place.strip().partition(".")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (equals and dot and field) or math.isnan(value):
            raise OptionError(
                f"--with {option}: expected EFFECT.FIELD=VALUE, such as gear_mesh_loss.efficiency_change=-0.03."
            )
        fields.setdefault(name, {})[field] = value
    return fields


@app.command("calibrate")
def calibrate_command(
    log: Annotated[Path, typer.Argument(metavar="OPEN_CIRCUIT_LOG", help="A log without a load.", show_default=False)],
    rig: RigOption = None,
    load_ohm: LoadOption = None,
    write: Annotated[
        Path | None, typer.Option("--write", metavar="RIG.toml", help="Write the rig file with the calibrated numbers.")
    ] = None,
    json: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Calibrate a rig from an open circuit: back-EMF constant, damper and screw friction, with their uncertainty."""
    _one_thread_each()
    from winchcascade.cascade.reduce import reduce
    from winchcascade.files import write_content
    from winchcascade.fit.calibrate import calibrate
    from winchcascade.fit.rigtext import calibrated_text
    from winchcascade.ingest.read import read_run
    from winchcascade.report.calibration_text import calibration_record, calibration_text

    _check_load(load_ohm)
    settings = _settings(log, rig, load_ohm, None)
    inputs = [log, log.parent / "campaign.toml", Path(settings.rig.path)]
    _check_outputs({"--json": Path(json) if json else None, "--write": write}, inputs, force=force)
    run = read_run(log, rig=settings.rig, load=settings.load, load_source=settings.load_source, about=settings.about)
    payouts = _steady_payouts(reduce(run, rig=settings.rig, window=settings.window, cycles=settings.cycles))
    calibration = calibrate(run, settings.rig, payouts, cycles=settings.cycles)
    if write is not None:
        write_content(write, calibrated_text(calibration), force=force)
    if not _write_json(json, calibration_record(calibration), force):
        _show(calibration_text(calibration, write))


def _steady_payouts(reduction: Reduction) -> list[tuple[float, float]]:
    """Payouts of the complete cycles, from the onset to the start of braking. [s]"""
    plateaus = [(cycle.phases.onset, cycle.summary.payout.plateau) for cycle in reduction.complete]
    found = [(onset, plateau.braking) for onset, plateau in plateaus if plateau is not None]
    if not found:
        raise LogError(
            f"{reduction.run.name}: none of {len(reduction.cycles)} payouts is complete and holds a plateau, which a "
            "calibration needs; `winchcascade reduce` lists what is wrong with each."
        )
    return found


@app.command("diagnose")
def diagnose_command(
    campaign: Annotated[
        Path,
        typer.Argument(metavar="CAMPAIGN", help="A campaign.toml, or the folder that holds one.", show_default=False),
    ],
    rig: RigOption = None,
    withhold: Annotated[
        list[float] | None,
        typer.Option(
            "--withhold", metavar="LOAD", help="Keep the logs of this load [ohm, or inf] from choice and fit."
        ),
    ] = None,
    json: JsonOption = None,
    html: Annotated[
        Path | None, typer.Option("--html", metavar="FILE", help="Write the report as one self-contained page.")
    ] = None,
    pdf: Annotated[Path | None, typer.Option("--pdf", metavar="FILE", help="Write the report as PDF.")] = None,
    suspect: Annotated[
        list[str] | None,
        typer.Option(
            "--suspect", metavar="EFFECT", help="Suspect this effect alone; repeat it. By default the catalogue."
        ),
    ] = None,
    predictions: Annotated[
        Path | None,
        typer.Option(
            "--predictions", metavar="FOLDER", help="Write what is predicted of the withheld logs, before and after."
        ),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option("--jobs", metavar="N", min=1, help="Threads; by default one for each processor.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Of the resampling of cycles.")] = 0,
    force: ForceOption = False,
) -> None:
    """Find out why logs and model differ: where, which effects, how sure, how far they close the gap, what to test next.

    The rig file is taken as given. Without --withhold and without withheld runs in the campaign each load is left out once. A
    winch for which no model can be made is diagnosed from line force, speed and mechanical power, its cycles left out in turn.
    """
    _one_thread_each()
    from winchcascade.batch.winch_diagnosis import outcome
    from winchcascade.campaign import load_campaign
    from winchcascade.effects.catalogue import EFFECTS, find_effect
    from winchcascade.report.progress import Telling

    suspects = {name: find_effect(name) for name in suspect} if suspect else EFFECTS
    read = load_campaign(campaign)
    logs = [run.file for run in read.runs]
    results = {"--json": Path(json) if json else None, "--html": html, "--pdf": pdf}
    _check_outputs(
        results | _predicted(predictions, logs), [read.path, *logs, *([Path(rig)] if rig else [])], force=force
    )
    _use_threads(jobs)
    with Telling(f"diagnosing {read.title or campaign.name}") as tell:
        found = outcome(campaign, suspects, rig=rig, loads=withhold or (), seed=seed, tell=tell)
        written = [] if predictions is None else found.write_predictions(predictions, force)
        if html is not None or pdf is not None:
            tell("writing reports")
            found.write_reports(html=html, pdf=pdf, command=_command(), force=force)
    if not _write_json(json, found.record, force):
        files: list[Path | str] = [path for path in results.values() if path is not None]
        if predictions is not None:
            files.append(predictions if written else "no predictions, as no effect was fitted")
        _show(found.text(files))


def _one_thread_each() -> None:
    """Keep linear algebra on one thread, before it is imported: its matrices are small, and threads make each solve slower."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def _use_threads(jobs: int | None) -> None:
    """Let a diagnosis work on so many threads, one for each processor by default."""
    from winchcascade.fit import campaign
    from winchcascade.tasks import processes

    campaign.THREADS = jobs or processes()


def _predicted(folder: Path | None, logs: Sequence[Path]) -> dict[str, Path | None]:
    """Make a folder of predictions, and tell which files of it may be written."""
    if folder is None:
        return {}
    found: dict[str, Path | None] = {}
    for side in ("before", "after"):
        try:
            (folder / side).mkdir(parents=True, exist_ok=True)
        except OSError as fault:
            raise OptionError(
                f"--predictions {folder}: the folder cannot be made ({fault.strerror}); choose another."
            ) from None
        found |= {f"--predictions {side}/{log.stem}": folder / side / f"{log.stem}.csv" for log in logs}
    return found


@app.command("effects")
def effects_command(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="An effect.", show_default=False)] = None,
) -> None:
    """List the effects that a rig may have beyond its model, or tell all about one."""
    from winchcascade.effects.catalogue import describe

    _show(describe(name).rstrip("\n") + "\n")


class _Settings(NamedTuple):
    rig: Rig
    load: float | None
    load_source: str
    window: str | float | None
    cycles: tuple[int, int] | None
    about: str


def _settings(log: Path, rig: str | None, load_ohm: float | None, window: str | None) -> _Settings:
    """Rig, load and window of a log: the options, else the campaign beside it, else the file's or the rig's own."""
    from winchcascade.campaign import campaign_beside
    from winchcascade.rigtoml import DEFAULT_RIG, load_rig

    rule: str | float | None = window
    source, about, cycles = "--load-ohm", "", None
    listed = campaign_beside(log) if None in (rig, load_ohm, window) else None
    if listed is not None:
        campaign, run = listed
        about, cycles = campaign.title, run.cycles
        rig = rig if rig is not None else campaign.rig
        rule = rule if rule is not None else run.window
        if load_ohm is None:
            load_ohm, source = run.load, campaign.path.name
    return _Settings(load_rig(rig or DEFAULT_RIG), load_ohm, source, rule, cycles, about)


@app.command("rig")
def rig_command(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="A built-in rig.", show_default=False)] = None,
) -> None:
    """Print a built-in rig file, to start one's own from; without a name the paper's."""
    from winchcascade.rigtoml import DEFAULT_RIG, built_in_text

    _show(built_in_text(name or DEFAULT_RIG))


blind = typer.Typer(
    help="Try the diagnosis on campaigns of an independent twin whose answers are sealed.", no_args_is_help=True
)
app.add_typer(blind, name="blind")

TrialArgument = Annotated[
    Path, typer.Argument(metavar="DIR", help="Folder of a trial, as blind deal makes it.", show_default=False)
]
SchedulerOption = Annotated[
    str | None,
    typer.Option("--scheduler", metavar="ADDRESS", help="Work on this Dask scheduler, such as tcp://host:8786."),
]


@blind.command("deal")
def blind_deal_command(
    cases: Annotated[int, typer.Option("--cases", metavar="N", min=1, help="Campaigns to deal.", show_default=False)],
    seed: Annotated[int, typer.Option("--seed", metavar="S", min=0, help="Deals the same again.", show_default=False)],
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of the trial; used again, it is completed.")
    ],
    jobs: JobsOption = None,
    scheduler: SchedulerOption = None,
    force: ForceOption = False,
) -> None:
    """Deal campaigns that hide something, and seal what it is. Exit code 1 if a case failed."""
    from winchcascade.blind.trial import deal
    from winchcascade.report.progress import Progress
    from winchcascade.report.trial_text import dealt_text
    from winchcascade.tasks import processes

    with Progress(f"dealing {cases} cases") as watch:
        done = deal(out, cases, seed, jobs=jobs or processes(), scheduler=scheduler, force=force, watch=watch)
    _show(dealt_text(done, out))
    raise typer.Exit(1 if done.faults else 0)


@blind.command("diagnose")
def blind_diagnose_command(
    trial: TrialArgument, jobs: JobsOption = None, scheduler: SchedulerOption = None, force: ForceOption = False
) -> None:
    """Diagnose every case of a trial from its logs alone; what is done is kept. Exit code 1 if a case failed."""
    _one_thread_each()
    from winchcascade.batch.diagnosis import diagnose_campaign
    from winchcascade.blind.trial import diagnose
    from winchcascade.effects.catalogue import EFFECTS
    from winchcascade.report.progress import Progress
    from winchcascade.report.trial_text import diagnosed_text
    from winchcascade.tasks import processes

    with Progress(f"diagnosing {trial.name}") as watch:
        done = diagnose(
            trial, diagnose_campaign, EFFECTS, jobs=jobs or processes(), scheduler=scheduler, force=force, watch=watch
        )
    _show(diagnosed_text(done, trial))
    raise typer.Exit(1 if done.faults else 0)


@blind.command("score")
def blind_score_command(
    trial: TrialArgument,
    json: JsonOption = None,
    html: Annotated[
        Path | None, typer.Option("--html", metavar="FILE", help="Write the report as one self-contained page.")
    ] = None,
    pdf: Annotated[Path | None, typer.Option("--pdf", metavar="FILE", help="Write the report as PDF.")] = None,
    force: ForceOption = False,
) -> None:
    """Open the answers of a trial and tell how its diagnoses fared; answers that were changed are refused."""
    from winchcascade.blind.score import score, score_record
    from winchcascade.report.trial_text import trial_text, write_trial_reports

    results = {"--json": Path(json) if json else None, "--html": html, "--pdf": pdf}
    _check_outputs(results, [*trial.glob("*.json"), *trial.glob("diagnoses/*.json")], force=force)
    found = score(trial)
    if html is not None or pdf is not None:
        write_trial_reports(found, html=html, pdf=pdf, command=_command(), force=force)
    if not _write_json(json, score_record(found), force):
        _show(trial_text(found, trial))


_INTERRUPTED = 130
"""Exit code of an interrupt, by the custom of shells."""


def main() -> None:
    """Run the command line: a fault of the input is one sentence on stderr and exit code 2."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    if sys.stdout is None:  # closed by the caller
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    try:
        code = app(standalone_mode=False)
        sys.stdout.flush()
        if code == _INTERRUPTED:
            raise KeyboardInterrupt
        sys.exit(code)
    except WinchcascadeError as fault:
        _refuse(str(fault))
    except (KeyboardInterrupt, typer.Abort):
        _refuse("interrupted; what was finished is kept, no file was left half-written.", code=_INTERRUPTED)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(2)
    except OSError as fault:
        where = "standard output" if fault.filename is None else str(fault.filename)[:200]
        if fault.filename is None:  # what is left in its buffer must not fail again at the end
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        _refuse(f"{where}: cannot be used ({fault.strerror}); check the path, its permissions and the space left.")
    except Exception as fault:
        if not hasattr(
            fault, "format_message"
        ):  # not a fault of usage but one of this program, which must be seen whole
            raise
        if not fault.format_message().strip() or type(fault).__name__ == "NoArgsIsHelpError":
            fault.show()  # type: ignore[attr-defined]  # the help of a command that was given nothing
            sys.exit(2)
        _refuse(f"{fault.format_message().rstrip('.?')}; --help lists what a command takes.")


def _refuse(sentence: str, *, code: int = 2) -> NoReturn:
    _show(f"winchcascade: {' '.join(sentence.split())}\n", file=sys.stderr)
    sys.exit(code)


if __name__ == "__main__":
    main()
