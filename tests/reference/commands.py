"""Which commands are called, and what is stored of them: groups of lines, each group in a folder of
its own.

A line is a command, `show FILE ...`, or `list FOLDER` for the names of its files. The exit code of
every command is stored in `codes.txt`; the file that follows an option of `STORED`, and each that
is shown, under its own name; what is printed in `NAME.txt` where `> NAME` ends the line.
"""

from typing import NamedTuple

EXACT = 1e-9
"""Relative accuracy of computed numbers: more than processors agree on."""

FITTED = 1e-4
"""Relative accuracy of fitted numbers: a fit ends where its steps become small, not at a point."""

STORED = ("--json", "--html", "--write", "--loss-map")
"""Options that name a file which is stored."""


class Group(NamedTuple):
    """Lines of a group, the accuracy of its data, whether it takes long, and whether it needs
    the data beside the project.
    """

    lines: str
    accuracy: float = EXACT
    slow: bool = False
    shared: bool = False


CLI = """
--help > help
reduce --help > help
batch --help > help
check --help > help
compare --help > help
audit --help > help
demo --help > help
simulate --help > help
calibrate --help > help
diagnose --help > help
effects --help > help
rig --help > help
blind --help > help
blind deal --help > help
blind diagnose --help > help
blind score --help > help
--version
effects > effects
effects stribeck > effect
rig
rig hsu2026
rig kitepower
"""

WRONG = """
nothing
--nothing
reduce
reduce nowhere.csv
reduce fixtures
reduce fixtures/campaign/campaign.toml
reduce fixtures/campaign/r36ohm.csv --window 0
reduce fixtures/campaign/r36ohm.csv --window long
reduce fixtures/campaign/r36ohm.csv --window 1000
reduce fixtures/campaign/r36ohm.csv --load-ohm 0
reduce fixtures/campaign/r36ohm.csv --load-ohm -5
reduce fixtures/campaign/r36ohm.csv --rig nothing
reduce fixtures/campaign/r36ohm.csv --rig fixtures/campaign/campaign.toml
reduce fixtures/campaign/r36ohm.csv --pdf nowhere/r.pdf
reduce fixtures/campaign/r36ohm.csv --html r.out --pdf r.out
reduce fixtures/campaign/r36ohm.csv --pdf fixtures/campaign
reduce fixtures/damaged_logs/header_only.csv
reduce fixtures/damaged_logs/not_a_log.csv
batch nowhere --out out fixtures/campaign
batch fixtures/campaign
batch fixtures/campaign --out fixtures
batch fixtures/campaign --out out --reports some
batch fixtures/campaign --out out --window never
batch fixtures/campaign --out out --jobs 0
batch fixtures/campaign --out out --scheduler nowhere
batch fixtures/campaign --out out --rig nothing
check fixtures/campaign
check nowhere --against hsu2026-table2
check fixtures/campaign --against nothing
check fixtures/campaign --against hsu2026-table2 --tolerance rounding
check fixtures/campaign --against hsu2026-table2 --tolerance width=2
check fixtures/campaign/r36ohm.csv --against hsu2026-table2
check fixtures/campaign --against fixtures/campaign/campaign.toml
compare
compare fixtures/campaign
compare fixtures/campaign nowhere
compare fixtures/campaign/r36ohm.csv fixtures/campaign/r9ohm.csv
compare fixtures/campaign/r36ohm.csv fixtures/damaged_logs/dropouts.csv
compare fixtures/campaign fixtures/campaign --max-drop 1
compare fixtures/campaign/open_circuit.csv fixtures/campaign --max-drop 0.01
audit
audit nothing
audit hsu2026-table2 --rig hsu2026
audit fixtures/campaign/campaign.toml
simulate
simulate fixtures/campaign/r36ohm.csv
simulate fixtures/campaign/r36ohm.csv --out s.csv --with nothing.x=1
simulate fixtures/campaign/r36ohm.csv --out s.csv --with copper_heating.x=1
simulate fixtures/campaign/r36ohm.csv --out s.csv --with copper_heating.r_s_change=much
simulate fixtures/campaign/r36ohm.csv --out s.csv --with copper_heating
simulate fixtures/damaged_logs/truncated.csv --out s.csv
simulate fixtures/campaign/r36ohm.csv --rig kitepower --out s.csv
simulate --profile fixtures/campaign/campaign.toml --load-ohm 9 --out s.csv
calibrate fixtures/campaign/r36ohm.csv
calibrate fixtures/campaign/open_circuit.csv --rig kitepower
diagnose nowhere
diagnose fixtures/campaign/r36ohm.csv
diagnose fixtures/campaign --suspect nothing
diagnose fixtures/campaign --withhold 7
diagnose fixtures/damaged_logs
effects nothing
rig nothing
blind
blind deal --cases 0 --seed 1 --out trial
blind deal --cases 1 --seed 1 --out fixtures
blind diagnose nowhere
blind diagnose fixtures
blind score nowhere
blind score fixtures
"""

REDUCE = """
reduce fixtures/campaign/r36ohm.csv --json r36ohm.json --html r36ohm.html > r36ohm
reduce fixtures/campaign/r36ohm.csv --parquet tables
show tables/r36ohm.csv.cycles.parquet tables/r36ohm.csv.bins.parquet
reduce fixtures/campaign/open_circuit.csv --json open_circuit.json
reduce fixtures/campaign/r36ohm.csv --window auto
reduce fixtures/campaign/r36ohm.csv --window payout
reduce fixtures/campaign/r36ohm.csv --rig kitepower
reduce fixtures/damaged_logs/dropouts.csv --window 5.48 --load-ohm 36 --json dropouts.json > dropouts
reduce fixtures/damaged_logs/no_torque.csv --window 5.48 --load-ohm 36 --json no_torque.json
reduce fixtures/damaged_logs/aborted.csv --window 5.48 --load-ohm 36
reduce fixtures/damaged_logs/labview.tdms --window 5.48 --load-ohm 36
reduce fixtures/damaged_logs/semicolon_comma.csv --window 5.48 --load-ohm 36
reduce fixtures/damaged_logs/truncated.csv --window 5.48 --load-ohm 36
reduce fixtures/damaged_logs/units_row.csv --window 5.48 --load-ohm 36
"""

BENCHES = """
reduce dyno.csv --rig dyno.toml --json steps.json --loss-map loss_map.json > steps
reduce motor.csv --rig motor.toml
reduce dyno.csv --rig whole.toml
reduce sea_1.csv --rig waves.toml --load-ohm 36 --json waves.json --html waves.html > waves
reduce dyno.csv --rig dyno.toml --html steps.html
batch sea.toml --out sea --reports none --jobs 1
show sea/campaign.json
reduce fixtures/measured/vdyno_steps.csv --rig fixtures/measured/vdyno.toml --json measured.json
audit points.toml --json points.json
check steps.json --against points.toml --json points_check.json
"""

BATCH = """
batch fixtures/campaign --out out --excel --jobs 1 --reports none > campaign
batch fixtures/campaign --out out --excel --jobs 1 --reports none > campaign_again
list out
show out/campaign.json out/campaign.xlsx
show out/dataset/runs.parquet out/dataset/cycles.parquet out/dataset/bins.parquet
show out/dataset/findings.parquet out/dataset/runs_all.parquet
batch fixtures/damaged_logs --out damaged-out --jobs 1 --reports none
show damaged-out/campaign.json
batch fixtures/campaign/r*9*.csv fixtures/damaged_logs/units_row.csv --out mixed --window payout --jobs 1 --reports none
show mixed/campaign.json
"""

TABLES = """
check fixtures/campaign --against hsu2026-table2 --jobs 1 --json check.json --html check.html > check
check fixtures/campaign --against wrong.toml --jobs 1
batch fixtures/campaign --out out --jobs 1 --reports none
check out --against hsu2026-table2 --tolerance deviation=0 --tolerance uncertainty=0.1 --json tolerances.json
check out/runs/r18ohm.csv.json --against hsu2026-table2 --json one_log.json
audit hsu2026-table2 --json audit.json --html audit.html > audit
audit wrong.toml --json audit_wrong.json
"""

COMPARE = """
compare fixtures/campaign worn --jobs 1 --max-drop 0.0137 --json compare.json --html compare.html > compare
compare fixtures/campaign worn --jobs 1 --same-sensors --max-drop 0.02
batch worn --out out --jobs 1 --reports none
compare fixtures/campaign/r36ohm.csv out/runs/r36ohm.csv.json --max-drop 0.01 --json logs.json
"""

MODEL = """
calibrate fixtures/campaign/open_circuit.csv --write rig.toml --json calibrate.json --html calibrate.html > calibrate
simulate fixtures/campaign/r36ohm.csv --out simulated.csv --html simulate.html > simulate
reduce simulated.csv --window 5.48
simulate fixtures/campaign/r36ohm.csv --with copper_heating.r_s_change=0.2 --out effect.csv
simulate fixtures/campaign/open_circuit.csv --rig rig.toml --out open.csv
simulate --profile profile.csv --load-ohm 9 --out profiled.csv
show simulated.csv effect.csv open.csv profiled.csv
simulate fixtures/damaged_logs/dropouts.csv --load-ohm 36 --out dropouts.csv
simulate fixtures/damaged_logs/header_only.csv --load-ohm 36 --out header_only.csv
show dropouts.csv
calibrate fixtures/damaged_logs/dropouts.csv --load-ohm inf
"""

PHYSICS = """
audit hsu2026-table2 --physics --json physics.json > physics
audit wrong.toml --physics
"""

DIAGNOSE = """
diagnose two --withhold 18 --predictions predicted --jobs 1 --json two_loads.json > two_loads
show predicted/before/r18ohm.csv predicted/after/r18ohm.csv
diagnose damaged --jobs 1 --suspect ke_rolloff --suspect line_drag --json damaged.json
"""

BLIND = """
blind deal --cases 2 --seed 1 --out trial --jobs 1 > deal
show trial/case-0001/campaign.toml trial/case-0001/open_circuit.csv
blind diagnose trial --jobs 1
show trial/diagnoses/case-0001.json
blind score trial --json score.json > score
"""

EARLIER = """
check kept/0.1.0/results --against hsu2026-table2 --json check.json
batch short --out kept/0.1.0/results --jobs 1 --reports none --excel
show kept/0.1.0/results/campaign.json
blind score kept/0.1.0/trial --json score.json
"""

DEMO = """
demo --out demo --jobs 1 > demo
list demo
show demo/results/campaign.html demo/results/index.html demo/results/diagnosis.html demo/results/diagnosis.json
"""

KITE = """
reduce kite/20191008_0001.csv --rig kitepower --json log.json
check log.json --against hsu2026-table2
reduce kite/ground_station_cycles_01_43.csv --rig kitepower --json cycles.json
reduce kite/2019-10-08-short_flight_summary.csv --rig kitepower
batch kite/20191008_0001.csv kite/20191008_0004.csv --rig kitepower --out kite-out --jobs 1 --reports none
show kite-out/campaign.json
simulate kite/20191008_0001.csv --rig kitepower --load-ohm 9 --out s.csv
calibrate kite/20191008_0001.csv --rig kitepower --load-ohm inf
diagnose kite --jobs 1 --json line.json --html line.html > line
"""

LABELS = """
diagnose labelled/copper_heating_and_line_drag --jobs 1 --json pair.json
diagnose labelled/torque_gain --jobs 1 --json gain.json
compare labelled/copper_heating_and_line_drag labelled/torque_gain --jobs 1
"""

GROUPS: dict[str, Group] = {
    "cli": Group(CLI),
    "wrong": Group(WRONG),
    "reduce": Group(REDUCE, slow=True),
    "batch": Group(BATCH),
    "tables": Group(TABLES, slow=True),
    "compare": Group(COMPARE),
    "model": Group(MODEL, FITTED),
    "benches": Group(BENCHES, slow=True),
    "earlier": Group(EARLIER, FITTED, slow=True),
    "physics": Group(PHYSICS, FITTED, slow=True),
    "diagnose": Group(DIAGNOSE, FITTED, slow=True),
    "blind": Group(BLIND, FITTED, slow=True),
    "demo": Group(DEMO, FITTED, slow=True),
    "kite": Group(KITE, FITTED, slow=True, shared=True),
    "labels": Group(LABELS, FITTED, slow=True, shared=True),
}
"""Groups by name, quick ones first."""
