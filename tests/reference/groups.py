"""What is recorded: groups of named texts, each made in a folder of its own."""

import hashlib
import inspect
import math
import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import msgspec
import numpy as np
from bench_logs import write_bench_logs
from contents import FITTED
from workplace import KEPT, LABELLED, Workplace, unpack

Recorded = Iterator[tuple[str, str]]
"""Names of outputs with their texts. Names that begin with `shared` need the data beside the project."""

CAMPAIGN = "fixtures/campaign"
DAMAGED = "fixtures/damaged_logs"
WINDOW = ("--window", "5.48", "--load-ohm", "36")
"""Of the damaged logs, all of which come from the same log."""

OTHER_NUMBERS = ("aborted", "dropouts", "no_torque")
"""Damaged logs whose numbers are not those of their origin."""

TABLE = "hsu2026-table2"
COMMANDS = (
    "reduce", "batch", "check", "compare", "audit", "demo", "simulate", "calibrate", "diagnose", "effects", "rig", "blind",
    "blind deal", "blind diagnose", "blind score",
)  # fmt: skip

WRONG = (
    "",
    "nothing",
    "--nothing",
    "reduce",
    "reduce nowhere.csv",
    "reduce fixtures",
    f"reduce {CAMPAIGN}/campaign.toml",
    f"reduce {CAMPAIGN}/r36ohm.csv --window 0",
    f"reduce {CAMPAIGN}/r36ohm.csv --window long",
    f"reduce {CAMPAIGN}/r36ohm.csv --window 1000",
    f"reduce {CAMPAIGN}/r36ohm.csv --load-ohm 0",
    f"reduce {CAMPAIGN}/r36ohm.csv --load-ohm -5",
    f"reduce {CAMPAIGN}/r36ohm.csv --rig nothing",
    f"reduce {CAMPAIGN}/r36ohm.csv --rig {CAMPAIGN}/campaign.toml",
    f"reduce {CAMPAIGN}/r36ohm.csv --json nowhere/r.json",
    f"reduce {CAMPAIGN}/r36ohm.csv --json {CAMPAIGN}/r36ohm.csv",
    f"reduce {CAMPAIGN}/r36ohm.csv --json {CAMPAIGN}/r27ohm.csv",
    f"reduce {CAMPAIGN}/r36ohm.csv --html r.out --pdf r.out",
    f"reduce {CAMPAIGN}/r36ohm.csv --html {CAMPAIGN}",
    f"batch nowhere --out out {CAMPAIGN}",
    f"batch {CAMPAIGN}",
    f"batch {CAMPAIGN} --out fixtures",
    f"batch {CAMPAIGN} --out out --reports some",
    f"batch {CAMPAIGN} --out out --window never",
    f"batch {CAMPAIGN} --out out --jobs 0",
    f"batch {CAMPAIGN} --out out --scheduler nowhere",
    f"batch {CAMPAIGN} --out out --rig nothing",
    f"check {CAMPAIGN}",
    f"check nowhere --against {TABLE}",
    f"check {CAMPAIGN} --against nothing",
    f"check {CAMPAIGN} --against {TABLE} --tolerance rounding",
    f"check {CAMPAIGN} --against {TABLE} --tolerance width=2",
    f"check {CAMPAIGN}/r36ohm.csv --against {TABLE}",
    f"check {CAMPAIGN} --against {CAMPAIGN}/campaign.toml",
    "compare",
    f"compare {CAMPAIGN}",
    f"compare {CAMPAIGN} nowhere",
    f"compare {CAMPAIGN}/r36ohm.csv {CAMPAIGN}/r9ohm.csv",
    f"compare {CAMPAIGN}/r36ohm.csv {DAMAGED}/dropouts.csv",
    f"compare {CAMPAIGN} {CAMPAIGN} --max-drop 1",
    f"compare {CAMPAIGN}/open_circuit.csv {CAMPAIGN} --max-drop 0.01",
    f"compare {CAMPAIGN}/r36ohm.csv {CAMPAIGN} --json {CAMPAIGN}/r36ohm.csv",
    "audit nothing",
    f"audit {TABLE} --rig hsu2026",
    f"audit {CAMPAIGN}/campaign.toml",
    "simulate",
    f"simulate {CAMPAIGN}/r36ohm.csv",
    f"simulate {CAMPAIGN}/r36ohm.csv --out s.csv --with nothing.x=1",
    f"simulate {CAMPAIGN}/r36ohm.csv --out s.csv --with copper_heating.x=1",
    f"simulate {CAMPAIGN}/r36ohm.csv --out s.csv --with copper_heating.r_s_change=much",
    f"simulate {CAMPAIGN}/r36ohm.csv --out s.csv --with copper_heating",
    f"simulate {DAMAGED}/truncated.csv --out s.csv",
    f"simulate {CAMPAIGN}/r36ohm.csv --rig kitepower --out s.csv",
    f"simulate --profile {CAMPAIGN}/campaign.toml --load-ohm 9 --out s.csv",
    f"calibrate {CAMPAIGN}/r36ohm.csv",
    f"calibrate {CAMPAIGN}/open_circuit.csv --rig kitepower",
    f"calibrate {CAMPAIGN}/open_circuit.csv --write {CAMPAIGN}/ORIGIN.json",
    "diagnose nowhere",
    f"diagnose {CAMPAIGN}/r36ohm.csv",
    f"diagnose {CAMPAIGN} --suspect nothing",
    f"diagnose {CAMPAIGN} --withhold 7",
    f"diagnose {CAMPAIGN} --json {CAMPAIGN}/r36ohm.csv",
    f"diagnose {DAMAGED}",
    "effects nothing",
    "rig nothing",
    "blind",
    "blind deal --cases 0 --seed 1 --out trial",
    "blind deal --cases 1 --seed 1 --out fixtures",
    "blind diagnose nowhere",
    "blind diagnose fixtures",
    "blind score nowhere",
    "blind score fixtures",
)
"""Commands that cannot be done."""


def logs(folder: str) -> list[Path]:
    """List the logs of a folder."""
    return sorted(path for path in Path(folder).iterdir() if path.suffix in (".csv", ".tdms"))


def named(*parts: str) -> str:
    """Make a file name."""
    return "-".join(parts).replace(" ", "-")


def cli(place: Workplace) -> Recorded:
    """Help, version, catalogue and rigs, wrong input, and the public names of the package."""
    from winchcascade.core.rig_toml import BUILT_IN
    from winchcascade.rig.effects.catalogue import EFFECTS

    yield "help", "\n".join(place.run(*command.split(), "--help") for command in ("", *COMMANDS))
    yield "version", place.run("--version")
    yield "effects", "\n".join([place.run("effects"), *(place.run("effects", name) for name in EFFECTS)])
    yield "rig", "\n".join([place.run("rig"), *(place.run("rig", name) for name in BUILT_IN)])
    yield "wrong", "\n".join(place.run(*words.split()) for words in WRONG)
    yield "signatures", place.plain(signatures())


def signatures() -> str:
    """Give the signatures of everything in `winchcascade.__all__`, of classes with their fields and methods."""
    import winchcascade

    lines: list[str] = []
    for name in winchcascade.__all__:
        value = getattr(winchcascade, name)
        if not inspect.isclass(value):
            lines.append(f"{name}{inspect.signature(value) if callable(value) else f': {type(value).__name__}'}")
            continue
        lines.append(f"class {name}({', '.join(base.__name__ for base in value.__bases__)})")
        fields = _fields(value) if issubclass(value, msgspec.Struct) else {}
        lines += [f"  {field}: {text}" for field, text in fields.items()]
        for member, what in sorted(vars(value).items()):
            if not member.startswith("_") and member not in fields:
                lines.append(f"  .{member}{inspect.signature(what) if inspect.isfunction(what) else ''}")
    return "\n".join(lines) + "\n"


def _fields(kind: type[msgspec.Struct]) -> dict[str, str]:
    """Give the fields of a struct in their order, each with its type as it is written and its default."""
    types = inspect.get_annotations(kind)
    names, defaults = kind.__struct_fields__, kind.__struct_defaults__
    without = len(names) - len(defaults)
    known = dict(zip(names[without:], defaults, strict=True))
    return {name: f"{types.get(name)}{f' = {known[name]!r}' if name in known else ''}" for name in names}


def reduce(place: Workplace) -> Recorded:
    """Reduce every log: what is printed, JSON and Parquet."""
    for log in logs(CAMPAIGN):
        yield log.name, place.run("reduce", log, "--json", "r.json") + place.show("r.json")
    for log in logs(DAMAGED):
        yield (
            f"damaged-{log.name}",
            place.run("reduce", log) + _reduced(place, log, *WINDOW, whole=log.stem in OTHER_NUMBERS),
        )
    log = Path(CAMPAIGN, "r36ohm.csv")
    text = place.run("reduce", log, "--parquet", "tables") + place.files("tables")
    text += place.show(*sorted(Path("tables").iterdir()))
    for words in (("--window", "auto"), ("--window", "payout"), ("--load-ohm", "inf"), ("--rig", "kitepower")):
        text += place.run("reduce", log, *words)
    yield "options", text + place.run("reduce", log, "--json", "-").split("{")[0]
    if place.shared:
        for name in LABELLED:
            yield f"shared-{name}", "\n".join(place.run("reduce", log) for log in logs(f"labelled/{name}"))
        for log in logs("kite"):
            yield f"shared-kite-{log.name}", _reduced(place, log, "--rig", "kitepower", whole=False)


def _reduced(place: Workplace, log: Path, *words: str, whole: bool) -> str:
    """Reduce a log; its JSON if the whole result is wanted, else its cycles and findings as columns."""
    if whole:
        return place.run("reduce", log, *words, "--json", f"{log.stem}.json") + place.show(f"{log.stem}.json")
    text = place.run("reduce", log, *words, "--parquet", "columns")
    tables = [Path("columns", f"{log.name}.{table}.parquet") for table in ("cycles", "findings")]
    return text + place.show(*(table for table in tables if table.is_file()))


def batch(place: Workplace) -> Recorded:
    """Reduce campaigns: what is printed, the JSON of the campaign and of its logs, Parquet, the workbook."""
    plain = ("--jobs", "1", "--reports", "none")
    text = place.run("batch", CAMPAIGN, "--out", "out", "--excel", *plain) + place.files("out")
    text += place.run("batch", CAMPAIGN, "--out", "out", *plain) + place.files("out")
    yield "campaign", text + place.show("out/campaign.json", "out/runs/r36ohm.csv.json")
    yield "campaign-dataset", place.show(*sorted(Path("out/dataset").iterdir()))
    place.run("batch", CAMPAIGN, "--out", "out", "--excel", *plain)
    yield "campaign-workbook", place.show("out/campaign.xlsx")
    text = place.run("batch", DAMAGED, "--out", "damaged", *plain) + place.files("damaged")
    yield "damaged", text + place.show("damaged/campaign.json", "damaged/dataset/findings.parquet")
    pattern = f"{CAMPAIGN}/r*9*.csv"
    text = place.run("batch", pattern, f"{DAMAGED}/units_row.csv", "--out", "mixed", "--window", "payout", *plain)
    yield "mixed", text + place.files("mixed") + place.show("mixed/campaign.json")
    if place.shared:
        for name in LABELLED:
            text = place.run("batch", f"labelled/{name}", "--out", name, *plain)
            tables = [f"{name}/dataset/{table}.parquet" for table in ("runs", "cycles", "bins", "findings")]
            yield f"shared-{name}", text + place.show(*tables)
        words = ("batch", "kite/20191008_0001.csv", "kite/20191008_0004.csv", "--rig", "kitepower", "--out", "kite-out")
        yield (
            "shared-kite",
            place.run(*words, *plain) + place.show("kite-out/campaign.json", "kite-out/dataset/cycles.parquet"),
        )


WRONG_TABLE = """title = "A table with mistakes"
source = "made up"
[columns]
energy_line = { unit = "J", decimals = 0 }
energy_gen = { unit = "J", decimals = 0 }
eta_pto = { unit = "1", decimals = 3 }
[[row]]
load_ohm = 18.0
energy_line = 11500
energy_gen = 8600
eta_pto = 0.648
[[row]]
load_ohm = 36.0
energy_line = 9000
energy_gen = 4956
[[claim]]
says = "Eta_pto is above 0.7 at 18 ohm."
where = "Conclusions"
metric = "eta_pto"
load_ohm = 18.0
at_least = 0.7
unit = "1"
decimals = 1
"""


def tables(place: Workplace) -> Recorded:
    """Check results against published tables, and audit the tables: printed, JSON, JUnit, annotations for GitHub."""
    Path("wrong.toml").write_text(WRONG_TABLE, encoding="utf-8")
    against = ("--against", TABLE, "--jobs", "1")
    text = place.run("check", CAMPAIGN, *against, "--json", "c.json", "--junit", "c.xml", "--github")
    yield "check-campaign", text + place.show("c.json", "c.xml")
    text = place.run("check", CAMPAIGN, "--against", "wrong.toml", "--json", "w.json", "--junit", "w.xml", "--github")
    yield "check-wrong-table", text + place.show("w.json", "w.xml")
    place.run("batch", CAMPAIGN, "--out", "out", "--jobs", "1", "--reports", "none")
    text = place.run(
        "check", "out", *against, "--tolerance", "deviation=0", "--tolerance", "uncertainty=0.1", "--github"
    )
    text += place.run("check", "out/runs/r18ohm.csv.json", *against)
    yield "check-results", text + place.run("check", "out/runs/open_circuit.csv.json", "--against", "wrong.toml")
    found = []
    for log in logs(DAMAGED):
        name = f"{log.stem}.json"
        place.run("reduce", log, *WINDOW, "--json", name)
        found.append(place.run("check", name, *against, "--github"))
    yield "check-damaged", "\n".join(found)
    text = place.run("audit", TABLE, "--json", "a.json") + place.show("a.json")
    yield "audit", text + place.run("audit", "wrong.toml", "--json", "aw.json") + place.show("aw.json")
    if place.shared:
        found = [place.run("check", f"labelled/{name}", *against) for name in LABELLED]
        place.run("reduce", "kite/20191008_0001.csv", "--rig", "kitepower", "--json", "k.json")
        yield "shared-check", "\n".join([*found, place.run("check", "k.json", *against)])


def benches(place: Workplace) -> Recorded:
    """Reduce logs of other benches: steps, rows, waves, whole records, loss maps, operating points, a measured log."""
    write_bench_logs()
    text = place.run("reduce", "dyno.csv", "--rig", "dyno.toml", "--json", "d.json", "--loss-map", "map.json")
    yield "steps", text + place.show("d.json", "map.json")
    text = place.run("reduce", "motor.csv", "--rig", "motor.toml", "--json", "m.json")
    yield "motor", text + place.show("m.json")
    text = place.run("reduce", "dyno.csv", "--rig", "whole.toml", "--json", "w.json")
    yield "whole", text + place.show("w.json")
    text = place.run("reduce", "sea_1.csv", "--rig", "waves.toml", "--load-ohm", "36", "--json", "s.json")
    text += place.run("batch", "sea.toml", "--out", "sea", "--reports", "none", "--jobs", "1")
    yield "waves", text + place.show("s.json", "sea/campaign.json")
    text = place.run("audit", "points.toml", "--json", "a.json") + place.show("a.json")
    text += place.run("check", "d.json", "--against", "points.toml", "--json", "c.json", "--github")
    yield "operating-points", text + place.show("c.json")
    text = place.run("reduce", "fixtures/measured/vdyno_steps.csv", "--rig", "fixtures/measured/vdyno.toml")
    yield "measured", text
    with place.drawn():
        text = place.run("reduce", "dyno.csv", "--rig", "dyno.toml", "--html", "d.html", "--loss-map", "map2.csv")
        text += place.run("reduce", "sea_1.csv", "--rig", "waves.toml", "--load-ohm", "36", "--html", "s.html")
    yield "pages", text + place.show("d.html", "s.html")
    yield "figures", "".join(place.figures)


def compare(place: Workplace) -> Recorded:
    """Compare campaigns, batches and logs: what is printed, JSON, text and structure of the page, text of the PDF."""
    _worn("worn", 0.98)
    with place.drawn():
        words = ("compare", CAMPAIGN, "worn", "--jobs", "1", "--max-drop", "0.0137")
        text = place.run(*words, "--json", "c.json", "--html", "c.html", "--pdf", "c.pdf")
    yield "campaigns", text + place.show("c.json")
    yield "campaigns-page", place.show("c.html")
    yield "campaigns-figures", "".join(place.figures)
    yield "campaigns-pdf", place.show("c.pdf")
    text = place.run("compare", CAMPAIGN, "worn", "--jobs", "1", "--same-sensors", "--max-drop", "0.02")
    place.run("batch", "worn", "--out", "out", "--jobs", "1", "--reports", "none")
    place.run("reduce", "worn/r36ohm.csv", "--load-ohm", "36", "--window", "payout", "--json", "w.json")
    place.run("simulate", f"{CAMPAIGN}/r9ohm.csv", "--out", "s.csv")
    for a, b in (("out", "w.json"), (f"{CAMPAIGN}/r36ohm.csv", "out/runs/r36ohm.csv.json"), ("out", "s.csv")):
        text += place.run("compare", a, b, "--jobs", "1", "--max-drop", "0.01")
    yield "sides", text
    if place.shared:
        text = place.run("compare", f"labelled/{LABELLED[0]}", f"labelled/{LABELLED[1]}", "--jobs", "1")
        kite = ("kite/20191008_0001.csv", "kite/20191008_0004.csv")
        for k, log in enumerate(kite):
            place.run("reduce", log, "--rig", "kitepower", "--json", f"k{k}.json")
        yield "shared", text + place.run("compare", "k0.json", "k1.json")


def _worn(folder: str, factor: float) -> None:
    """Copy the campaign with another current."""
    shutil.copytree(CAMPAIGN, folder)
    for log in logs(folder):
        head, *rows = log.read_text(encoding="utf-8").splitlines()
        column = head.split(",").index("Idc (A)")
        cells = [row.split(",") for row in rows]
        for row in cells:
            row[column] = f"{factor * float(row[column]):.4f}"
        log.write_text("\n".join([head, *map(",".join, cells)]) + "\n", encoding="utf-8")


def physics(place: Workplace) -> Recorded:
    """Audit tables against the model of the rig."""
    Path("wrong.toml").write_text(WRONG_TABLE, encoding="utf-8")
    for name, table in (("audit", TABLE), ("wrong-table", "wrong.toml")):
        text = place.run("audit", table, "--physics", "--json", f"{name}.json")
        yield name, text + place.show(f"{name}.json", digits=FITTED)


CORNERS = (0.0, 1.0, 2.0, 8.0, 8.5, 12.0, 13.0, 21.0, 22.0)
VELOCITIES = (0.0, 0.0, 1.0, 1.0, 0.0, 0.0, -0.7, -0.7, 0.0)
"""A profile with a payout, a hold and a haul-in: times [s] and velocities [m/s]."""


def model(place: Workplace) -> Recorded:
    """Simulate along logs and profiles, and calibrate: printed, the logs and the rig files that are written, JSON."""
    open_log = f"{CAMPAIGN}/open_circuit.csv"
    text = place.run("calibrate", open_log, "--write", "rig.toml", "--json", "c.json")
    yield "calibrate", text + place.show("c.json", digits=FITTED) + place.show("rig.toml")
    rows = [f"{t:.2f},{np.interp(t, CORNERS, VELOCITIES):.6f}" for t in np.arange(0.0, 22.01, 0.05)]
    Path("profile.csv").write_text("\n".join(["time_s,velocity_mps", *rows]) + "\n", encoding="utf-8")
    effects = ("--with", "copper_heating.r_s_change=0.2", "--with", "gear_mesh_loss.efficiency_change=-0.03")
    text = place.run("simulate", f"{CAMPAIGN}/r36ohm.csv", "--out", "s.csv") + place.show("s.csv")
    text += place.run("reduce", "s.csv", "--window", "5.48")
    text += place.run("simulate", f"{CAMPAIGN}/r36ohm.csv", *effects, "--out", "e.csv") + place.show("e.csv")
    text += place.run("simulate", open_log, "--rig", "rig.toml", "--out", "o.csv") + place.show("o.csv")
    text += place.run("simulate", "--profile", "profile.csv", "--load-ohm", "9", "--out", "p.csv") + place.show("p.csv")
    yield "simulate", text + place.run("reduce", "p.csv")
    found = []
    for log in logs(DAMAGED):
        name = f"{log.stem}.csv"
        found.append(place.run("simulate", log, "--load-ohm", "36", "--out", name) + place.show(name))
    yield "simulate-damaged", "\n".join(found)
    if place.shared:
        kite = ("kite/20191008_0001.csv", "--rig", "kitepower")
        text = place.run("simulate", *kite, "--load-ohm", "9", "--out", "k.csv")
        yield "shared-kite", text + place.run("calibrate", *kite, "--load-ohm", "inf")


def calibrate(place: Workplace) -> Recorded:
    """Calibrate by damaged logs and by the open circuits of labelled campaigns."""
    yield "damaged", "\n".join(place.run("calibrate", log, "--load-ohm", "inf") for log in logs(DAMAGED))
    if place.shared:
        opened = [f"labelled/{name}/open_circuit.csv" for name in LABELLED]
        yield "shared-labelled", "\n".join(place.run("calibrate", log) for log in opened)


def sheets(place: Workplace) -> Recorded:
    """Make the pages of other commands than `reduce` and `diagnose`, and the tables of a log as files."""
    pages = {
        "calibrate": ("calibrate", f"{CAMPAIGN}/open_circuit.csv"),
        "check": ("check", CAMPAIGN, "--against", TABLE, "--jobs", "1"),
        "audit": ("audit", TABLE),
        "simulate": ("simulate", f"{CAMPAIGN}/r36ohm.csv", "--out", "s.csv"),
    }
    for name, words in pages.items():
        with place.drawn():
            text = place.run(*words, "--html", f"{name}.html")
        yield f"{name}-page", text + place.show(f"{name}.html")
    text = place.run("reduce", f"{CAMPAIGN}/r36ohm.csv", "--tables", "tables") + place.files("tables")
    yield "tables", text + "".join(place.show(f"tables/r36ohm_cycles.{ending}") for ending in ("csv", "tex", "md"))


def reports(place: Workplace) -> Recorded:
    """Make the reports of logs: text and structure of the page, text of the PDF, the arrays behind the figures."""
    yield from _reports(place, "r36ohm", f"{CAMPAIGN}/r36ohm.csv", pdf=True)
    for name in ("open_circuit", "r4p5ohm"):
        yield from _reports(place, name, f"{CAMPAIGN}/{name}.csv")
    for name in ("dropouts", "no_torque"):
        yield from _reports(place, name, f"{DAMAGED}/{name}.csv", *WINDOW)
    yield from _reports(place, "aborted", f"{DAMAGED}/aborted.csv", "--window", "5.48", pdf=True)
    if place.shared:
        yield from _reports(place, "shared-pair", f"labelled/{LABELLED[2]}/r9ohm.csv")
        kite = "kite/ground_station_cycles_01_43.csv"
        yield from _reports(place, "shared-kite", kite, "--rig", "kitepower", pdf=True)


def _reports(place: Workplace, name: str, log: str, *words: str, pdf: bool = False) -> Recorded:
    page, print_ = f"{name}.html", f"{name}.pdf"
    with place.drawn():
        text = place.run("reduce", log, *words, "--html", page, *(("--pdf", print_) if pdf else ()))
    yield f"{name}-page", text + place.show(page)
    yield f"{name}-figures", "".join(place.figures)
    if pdf:
        yield f"{name}-pdf", place.show(print_)


def demo(place: Workplace) -> Recorded:
    """Reduce and diagnose the packaged campaign with all its reports."""
    with place.drawn():
        text = place.run("demo", "--out", "demo", "--jobs", "1")
    text += place.files("demo") + place.run("demo", "--out", "demo", "--jobs", "1")
    yield "demo", text + place.show("demo/results/diagnosis.json", digits=FITTED)
    for name in ("campaign", "diagnosis"):
        yield f"{name}-page", place.show(f"demo/results/{name}.html")
        yield f"{name}-pdf", place.show(f"demo/results/{name}.pdf")
    yield "workbook", place.show("demo/results/campaign.xlsx")
    of_logs = sum(
        page.read_text(encoding="utf-8").count("<figure ") for page in Path("demo/results/runs").glob("*.html")
    )
    yield "figures", "".join(place.figures[of_logs:])  # those of a log are in `reports`


def diagnose(place: Workplace) -> Recorded:
    """Diagnose campaigns, with a model and without one: printed, JSON, predictions, reports."""
    two = _two_loads()
    words = ("diagnose", two, "--withhold", "18", "--predictions", "predicted", "--jobs", "1")
    with place.drawn():
        text = place.run(*words, "--json", "t.json", "--html", "t.html", "--pdf", "t.pdf") + place.files("predicted")
    text += place.show("t.json", digits=FITTED) + place.show(
        "predicted/before/r18ohm.csv", "predicted/after/r18ohm.csv"
    )
    yield "two-loads", text
    yield "two-loads-page", place.show("t.html")
    yield "two-loads-pdf", place.show("t.pdf")
    yield "two-loads-figures", "".join(place.figures)
    yield "damaged", _damaged_campaign(place)
    if place.shared:
        for name in LABELLED:
            text = place.run("diagnose", f"labelled/{name}", "--jobs", "1", "--json", f"{name}.json")
            text += place.show(f"{name}.json", digits=FITTED)
            yield f"shared-{name}", text
        Path("kite/campaign.toml").write_text(
            'title = "Kite winch"\nrig = "kitepower"\n[[run]]\nfile = "ground_station_cycles_01_43.csv"\ncycles = [1, 20]\n',
            encoding="utf-8",
        )
        with place.drawn():
            text = place.run("diagnose", "kite", "--jobs", "1", "--json", "k.json", "--html", "k.html")
        yield "shared-kite", text + place.show("k.json", digits=FITTED)
        yield "shared-kite-page", place.show("k.html")
        yield "shared-kite-figures", "".join(place.figures)


def _two_loads() -> str:
    """Make a campaign of two logs, and give its folder."""
    return _campaign("two", {f"{CAMPAIGN}/r18ohm.csv": 18.0, f"{CAMPAIGN}/r4p5ohm.csv": 4.5}, window=5.96)


def _damaged_campaign(place: Workplace) -> str:
    """Diagnose damaged logs together, and each log that cannot be reduced."""
    logs = {f"{DAMAGED}/{name}.csv": 36.0 for name in ("aborted", "dropouts", "no_torque", "truncated", "units_row")}
    folder = _campaign("damaged", {f"{CAMPAIGN}/open_circuit.csv": math.inf, **logs}, window=5.48)
    text = place.run("diagnose", folder, "--jobs", "1", "--suspect", "ke_rolloff", "--suspect", "line_drag")
    for name in ("header_only", "not_a_log"):
        folder = _campaign(name, {f"{CAMPAIGN}/r18ohm.csv": 18.0, f"{DAMAGED}/{name}.csv": 36.0}, window=5.48)
        text += place.run("diagnose", folder, "--jobs", "1")
    return text


def _campaign(folder: str, logs: dict[str, float], *, window: float) -> str:
    """Make a campaign of copies of logs with their loads [ohm], and give its folder."""
    Path(folder).mkdir()
    entries = []
    for log, load in logs.items():
        Path(folder, Path(log).name).write_bytes(Path(log).read_bytes())
        entries.append(f'[[run]]\nfile = "{Path(log).name}"\nload_ohm = {load}\nwindow_s = {window}\n')
    Path(folder, "campaign.toml").write_text("\n".join(entries), encoding="utf-8")
    return folder


def blind(place: Workplace) -> Recorded:
    """Deal a small trial, diagnose and score it; diagnose and score the trials of earlier versions again."""
    deal = ("blind", "deal", "--cases", "2", "--seed", "1", "--out", "trial", "--jobs", "1")
    text = place.run("blind", "score", "trial") + place.run(*deal) + place.files("trial") + place.run(*deal)
    for log in sorted(Path("trial/case-0001").glob("*.csv")):
        text += place.show(log)
    yield "deal", text + place.show("trial/case-0001/campaign.toml") + place.run("blind", "score", "trial")
    text = place.run("blind", "diagnose", "trial", "--jobs", "1") + place.run("blind", "diagnose", "trial")
    text += place.files("trial/predictions")
    yield "diagnose", text + place.show(*sorted(Path("trial/diagnoses").iterdir()), digits=FITTED)
    text = place.run("blind", "score", "trial", "--json", "s.json") + place.run("blind", "score", "trial")
    yield "score", text + place.show("s.json", digits=FITTED)
    Path("trial").rename("dealt")
    for version in sorted(KEPT.iterdir()):
        unpack(version / "trial.tar.xz")
        text = place.run("blind", "diagnose", "trial", "--jobs", "1") + place.run("blind", "score", "trial")
        yield f"earlier-{version.name}", text + place.show("trial/diagnoses/case-0001.json", digits=FITTED)
        Path("trial").rename(f"trial-{version.name}")


def earlier(place: Workplace) -> Recorded:
    """Open results and trials of earlier versions: check them, use them again, score them."""
    short = place.short_campaign()
    for version in sorted(KEPT.iterdir()):
        for name in ("results", "trial"):
            shutil.rmtree(name, ignore_errors=True)
            unpack(version / f"{name}.tar.xz")
        before = _digests("results")
        text = place.run("check", "results", "--against", TABLE)
        text += place.run("batch", short, "--out", "results", "--jobs", "1", "--reports", "none", "--excel")
        after = _digests("results")
        for name in sorted(before | after):
            kept = "as it was" if before.get(name) == after.get(name) else "made anew" if name in after else "removed"
            text += f"{name}: {kept}\n"
        text += place.show("results/campaign.json", "results/runs/r36ohm.csv.json")
        text += place.run("blind", "score", "trial", "--json", "score.json") + place.run("blind", "score", "trial")
        yield version.name, text + place.show("score.json", digits=FITTED)


def _digests(folder: str) -> dict[str, str]:
    """Give the digest of each file of a folder."""
    files = sorted(path for path in Path(folder).rglob("*") if path.is_file())
    return {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def jobs(place: Workplace) -> Recorded:
    """Compare one process with two, of a batch and of a diagnosis: every file to the byte."""
    two = _two_loads()
    for name, words, out in (
        ("batch", ("batch", CAMPAIGN, "--reports", "none", "--out", "out"), "out"),
        ("diagnose", ("diagnose", two, "--predictions", "out/predicted", "--json", "out/d.json"), "out"),
    ):
        found: list[dict[str, str]] = []
        printed: list[str] = []
        for count in ("1", "2"):
            Path(out).mkdir(exist_ok=True) if name == "diagnose" else None
            printed.append(place.run(*words, "--jobs", count).split("\n", 1)[1])
            found.append(_digests(out))
            Path(out).rename(f"{name}-{count}")
        unequal = [file for file in found[0] if found[0][file] != found[1].get(file)]
        text = f"$ winchcascade {' '.join(words)}\n{printed[0]}"
        text += f"--jobs 1 and --jobs 2: printed alike {printed[0] == printed[1]}, "
        text += f"same files {list(found[0]) == list(found[1])}, files that differ: {unequal}\n"
        yield name, text


WIDTHS = (60, 80, 120, 200)
"""Columns of the terminals for which the main commands are recorded."""

NARROW_ERRORS = (
    "reduce fixtures",
    f"reduce {CAMPAIGN}/r36ohm.csv --window 0",
    f"check {CAMPAIGN} --against nothing",
    "audit",
)
"""Commands that cannot be done, one of them without its argument."""


def terminal(place: Workplace) -> Recorded:
    """Print what the main commands print in terminals of several widths, and what they print with --quiet."""
    Path("wrong.toml").write_text(WRONG_TABLE, encoding="utf-8")
    unpack(max(KEPT.iterdir()) / "trial.tar.xz")
    folder = _campaign("pair", {f"{CAMPAIGN}/r{ohm:g}ohm.csv": ohm for ohm in (36.0, 9.0)}, window=5.48)
    batch = ("--jobs", "1", "--reports", "none", "--out")
    suspects = ("--suspect", "ke_rolloff", "--suspect", "torque_gain")
    missed = ("--tolerance", "deviation=0", "--tolerance", "uncertainty=0.1")
    done = (
        ("reduce", f"{CAMPAIGN}/r36ohm.csv", "--json", "r.json"), ("reduce", f"{DAMAGED}/dropouts.csv", *WINDOW),
        ("batch", CAMPAIGN, *batch, "out"), ("batch", DAMAGED, *batch, "damaged"),
        ("check", CAMPAIGN, "--against", TABLE, "--jobs", "1"),
        ("check", CAMPAIGN, "--against", TABLE, *missed, "--junit", "c.xml"),
        ("audit", TABLE), ("audit", "wrong.toml"), ("calibrate", f"{CAMPAIGN}/open_circuit.csv", "--write", "rig.toml"),
        ("simulate", f"{CAMPAIGN}/r36ohm.csv", "--out", "s.csv"), ("diagnose", folder, *suspects, "--jobs", "1"),
        ("effects",), ("effects", "stribeck"), ("blind", "score", "trial", "--json", "score.json"),
    )  # fmt: skip
    for width in WIDTHS:
        text = "\n".join(place.run(*words, columns=width) for words in done)
        helps = "\n".join(place.run(*name.split(), "--help", columns=width) for name in ("", *COMMANDS))
        wrong = "\n".join(place.run(*words.split(), columns=width, terminal=True) for words in NARROW_ERRORS)
        yield f"{width}-columns", f"{text}\n{wrong}\n{helps}"
    yield "quiet", "\n".join(place.run(*words, "--quiet") for words in done) + place.run("reduce", "nowhere", "--quiet")


GROUPS: dict[str, Callable[[Workplace], Recorded]] = {
    one.__name__: one
    for one in (
        cli,
        reduce,
        batch,
        tables,
        model,
        benches,
        compare,
        earlier,
        calibrate,
        terminal,
        sheets,
        reports,
        jobs,
        physics,
        diagnose,
        blind,
        demo,
    )
}
"""Groups by name, quick ones first."""

SLOW: Sequence[str] = (
    "benches",
    "calibrate",
    "terminal",
    "sheets",
    "reports",
    "jobs",
    "physics",
    "diagnose",
    "blind",
    "demo",
)
"""Groups that take more than ten seconds."""
