"""Misuse of the library: each call that cannot work is rejected in one sentence, never with a traceback or a wrong result."""

# mypy: disable-error-code="arg-type, attr-defined, dict-item, index, list-item, misc"

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from msgspec.structs import replace

import winchcascade as wc
from winchcascade.core.quantity import Quantity
from winchcascade.core.rig_file import Winch
from winchcascade.rig.effects.catalogue import make_effect

CAMPAIGN = Path(__file__).parent.parent / "fixtures" / "campaign"
LOG = CAMPAIGN / "r36ohm.csv"


@cache
def run() -> wc.Run:
    return wc.read_run(LOG)


@cache
def open_run() -> wc.Run:
    return wc.read_run(CAMPAIGN / "open_circuit.csv")


@cache
def reduction() -> wc.Reduction:
    return wc.reduce(run())


@cache
def hsu() -> wc.Rig:
    return wc.load_rig("hsu2026")


@cache
def campaign() -> wc.OpenedCampaign:
    return wc.open_campaign(CAMPAIGN)


@cache
def reduced() -> wc.CampaignReduction:
    return wc.open_campaign(LOG).reduce()


@cache
def compared() -> wc.Comparison:
    return wc.compare(reduction(), reduction())


def made(**fields: Any) -> wc.Run:
    """A run by hand, of which some fields are wrong."""
    t = np.arange(0.0, 40.0, 0.04)
    good = {"name": "by hand", "t": t, "channels": {"velocity": np.sin(t)}, "fs": 25.0, "samples": t.size}
    return wc.Run(**{**good, **fields})


def frame(**columns: Any) -> pd.DataFrame:
    return pd.DataFrame({"Time (s)": np.arange(0.0, 40.0, 0.04), **columns})


def holed(value: float) -> Any:
    signal = np.sin(np.arange(0.0, 40.0, 0.04))
    signal[7] = value
    return signal


MISUSES: dict[str, Callable[[], Any]] = {
    # -------------------------------------------------------------------------------- read_run
    "read_run: a number": lambda: wc.read_run(3),
    "read_run: None": lambda: wc.read_run(None),
    "read_run: a list": lambda: wc.read_run([LOG]),
    "read_run: bytes": lambda: wc.read_run(b"r36ohm.csv"),
    "read_run: an array": lambda: wc.read_run(np.zeros((9, 3))),
    "read_run: a series": lambda: wc.read_run(pd.Series([1.0, 2.0])),
    "read_run: a run": lambda: wc.read_run(run()),
    "read_run: an empty path": lambda: wc.read_run(""),
    "read_run: a path with a NUL": lambda: wc.read_run("r36\0.csv"),
    "read_run: a path that is too long": lambda: wc.read_run("x" * 5000),
    "read_run: no such file": lambda: wc.read_run("no_such.csv"),
    "read_run: a folder": lambda: wc.read_run(CAMPAIGN),
    "read_run: load True": lambda: wc.read_run(LOG, load=True),
    "read_run: load 0": lambda: wc.read_run(LOG, load=0.0),
    "read_run: load -18": lambda: wc.read_run(LOG, load=-18.0),
    "read_run: load NaN": lambda: wc.read_run(LOG, load=math.nan),
    "read_run: load -inf": lambda: wc.read_run(LOG, load=-math.inf),
    "read_run: load as a text": lambda: wc.read_run(LOG, load="36"),
    "read_run: load as a list": lambda: wc.read_run(LOG, load=[36.0]),
    "read_run: load complex": lambda: wc.read_run(LOG, load=36j),
    "read_run: rig empty": lambda: wc.read_run(LOG, rig=""),
    "read_run: rig by its name": lambda: wc.read_run(LOG, rig="hsu2026"),
    "read_run: rig False": lambda: wc.read_run(LOG, rig=False),
    "read_run: rig a dict": lambda: wc.read_run(LOG, rig={}),
    "read_run: table 0": lambda: wc.read_run(LOG, table=0),
    "read_run: table empty": lambda: wc.read_run(LOG, table=""),
    "read_run: table a float": lambda: wc.read_run(LOG, table=1.5),
    "read_run: table of a CSV": lambda: wc.read_run(LOG, table="Run 3"),
    "read_run: units of a file": lambda: wc.read_run(LOG, units={"force": "kN"}),
    "read_run: units a text": lambda: wc.read_run(frame(force=1.0), units="kN"),
    "read_run: units a list": lambda: wc.read_run(frame(force=1.0), units=["kN"]),
    "read_run: units numbers": lambda: wc.read_run(frame(force=1.0), units={"force": 1000.0}),
    "read_run: units of no column": lambda: wc.read_run(frame(force=1.0), units={"forse": "kN"}),
    "read_run: unknown unit": lambda: wc.read_run(frame(velocity=1.0), units={"velocity": "parsec"}),
    "read_run: name a number": lambda: wc.read_run(LOG, name=3),
    "read_run: name empty": lambda: wc.read_run(LOG, name=" "),
    "read_run: about a number": lambda: wc.read_run(LOG, about=3),
    "read_run: load_source None": lambda: wc.read_run(LOG, load_source=None),
    "read_run: origin a text": lambda: wc.read_run(LOG, origin="measured"),
    "read_run: simulated a text": lambda: wc.read_run(LOG, simulated="no"),
    "read_run: campaign a path": lambda: wc.read_run(LOG, campaign="campaign.toml"),
    "read_run: an empty frame": lambda: wc.read_run(pd.DataFrame()),
    "read_run: a frame without channels": lambda: wc.read_run(frame()),
    "read_run: a frame of texts": lambda: wc.read_run(frame(velocity="fast")),
    "read_run: a frame of NaN": lambda: wc.read_run(frame(velocity=np.nan)),
    # -------------------------------------------------------------------------------- Run
    "Run: NaN": lambda: made(channels={"velocity": holed(math.nan)}),
    "Run: inf": lambda: made(channels={"velocity": holed(math.inf)}),
    "Run: no channel": lambda: made(channels={}),
    "Run: channels None": lambda: made(channels=None),
    "Run: channels an array": lambda: made(channels=np.zeros(1000)),
    "Run: empty channel": lambda: made(channels={"velocity": np.zeros(0)}),
    "Run: channel of another length": lambda: made(channels={"velocity": np.zeros(999)}),
    "Run: channel of two dimensions": lambda: made(channels={"velocity": np.zeros((1000, 1))}),
    "Run: channel of texts": lambda: made(channels={"velocity": ["fast"] * 1000}),
    "Run: channel None": lambda: made(channels={"velocity": None}),
    "Run: no stamps": lambda: made(t=np.zeros(0), channels={"velocity": np.zeros(0)}),
    "Run: stamps that fall": lambda: made(t=np.arange(40.0, 0.0, -0.04)),
    "Run: stamps that stand": lambda: made(t=np.zeros(1000)),
    "Run: stamps with NaN": lambda: made(t=holed(math.nan)),
    "Run: stamps None": lambda: made(t=None),
    "Run: rate 0": lambda: made(fs=0.0),
    "Run: rate NaN": lambda: made(fs=math.nan),
    "Run: rate negative": lambda: made(fs=-25.0),
    "Run: rate of other stamps": lambda: made(fs=1000.0),
    "Run: rate a text": lambda: made(fs="25 Hz"),
    "Run: load -18": lambda: made(load=-18.0),
    "Run: load True": lambda: made(load=True),
    "Run: load a text": lambda: made(load="open"),
    "Run: load replaced by 0": lambda: replace(run(), load=0.0),
    "Run: samples 0": lambda: made(samples=0),
    "Run: samples a float": lambda: made(samples=10.5),
    "Run: name a number": lambda: made(name=36),
    "Run: gaps a list": lambda: made(gaps=[(1.0, 2.0)]),
    "Run: gaps of three numbers": lambda: made(gaps={"velocity": np.zeros((1, 3))}),
    "Run: labels of another length": lambda: made(labels=np.zeros(9)),
    "Run: rig by its name": lambda: made(rig="hsu2026"),
    "Run: findings a text": lambda: made(findings="none"),
    "Run: cycles of one number": lambda: made(cycles=(1,)),
    "Run: a finding that is a text": lambda: made(findings=("stuck",)),
    "Run: origin a text": lambda: made(origin="measured"),
    "Run: about a number": lambda: made(about=3),
    "Run: path a number": lambda: made(path=4),
    "Run: temperature a text": lambda: made(temperature="warm"),
    "Run: window a word": lambda: wc.reduce(made(window="soon")),
    "Run: misspelt channel": lambda: wc.reduce(made(channels={"velocity": np.sin(made().t), "forse": made().t})),
    "Run: replace a channel": lambda: run().channels.__setitem__("force", None),
    "Run: set a field": lambda: setattr(made(), "load", 3.0),
    "Run: misspelt field": lambda: run().chanels,
    "Run: to_pandas with other units": lambda: run().to_pandas("imperial"),
    "Run: to_pandas with units None": lambda: run().to_pandas(None),
    # -------------------------------------------------------------------------------- reduce
    "reduce: a path": lambda: wc.reduce(LOG),
    "reduce: None": lambda: wc.reduce(None),
    "reduce: a frame": lambda: wc.reduce(run().to_pandas()),
    "reduce: rig by its name": lambda: wc.reduce(run(), rig="hsu2026"),
    "reduce: rig empty": lambda: wc.reduce(run(), rig=""),
    "reduce: rig a path": lambda: wc.reduce(run(), rig=Path("rig.toml")),
    "reduce: window a word": lambda: wc.reduce(run(), window="soon"),
    "reduce: window 0": lambda: wc.reduce(run(), window=0.0),
    "reduce: window NaN": lambda: wc.reduce(run(), window=math.nan),
    "reduce: window True": lambda: wc.reduce(run(), window=True),
    "reduce: window a pair": lambda: wc.reduce(run(), window=(1.0, 2.0)),
    "reduce: window longer than payouts": lambda: wc.reduce(run(), window=500.0),
    "reduce: window empty": lambda: wc.reduce(run(), window=""),
    "reduce: cycles of one number": lambda: wc.reduce(run(), cycles=(1,)),
    "reduce: cycles of three": lambda: wc.reduce(run(), cycles=(1, 2, 3)),
    "reduce: cycles a number": lambda: wc.reduce(run(), cycles=2),
    "reduce: cycles in reverse": lambda: wc.reduce(run(), cycles=(3, 1)),
    "reduce: cycles from 0": lambda: wc.reduce(run(), cycles=(0, 2)),
    "reduce: cycles beyond the log": lambda: wc.reduce(run(), cycles=(8, 9)),
    "reduce: cycles as texts": lambda: wc.reduce(run(), cycles=("1", "2")),
    "reduce: cycles as floats": lambda: wc.reduce(run(), cycles=(1.5, 2.5)),
    "reduce: cycles empty": lambda: wc.reduce(run(), cycles=()),
    # -------------------------------------------------------------------------------- results
    "mean: misspelt metric": lambda: reduction().mean.eta_ptoo,
    "mean: misspelt energy": lambda: reduction().mean.energy_lin,
    "mean: misspelt power": lambda: reduction().mean.power_shaft,
    "mean: misspelt key": lambda: reduction().mean["eta_ptoo"],
    "mean: a number as key": lambda: reduction().mean[3],
    "mean: other attribute": lambda: reduction().mean.efficiency,
    "cycle: misspelt metric": lambda: reduction().cycles[0].metrics.eta_tran,
    "max_deviation_percent: misspelt metric": lambda: reduction().max_deviation_percent.eta_ptoo,
    "total: misspelt metric": lambda: reduction().total.eta_ptoo,
    "Metrics: misspelt metric": lambda: wc.Metrics(eta_pto=0.7).eta_ptoo,
    "reduction: misspelt field": lambda: reduction().means,
    "reduction: to_pandas misspelt": lambda: reduction().to_pandas("cycle"),
    "reduction: to_pandas a number": lambda: reduction().to_pandas(3),
    "reduction: to_pandas with other units": lambda: reduction().to_pandas("cycles", units="SI"),
    "reduction: plot misspelt": lambda: reduction().plot("powr"),
    "reduction: plot None": lambda: reduction().plot(None),
    "reduction: plot on no axes": lambda: reduction().plot("speed", ax=3),
    "uncertainty: a run": lambda: wc.uncertainty(run()),
    "uncertainty: seed negative": lambda: wc.uncertainty(reduction(), seed=-1),
    "uncertainty: seed a float": lambda: wc.uncertainty(reduction(), seed=1.5),
    "uncertainty: seed None": lambda: wc.uncertainty(reduction(), seed=None),
    "uncertainty: misspelt metric": lambda: wc.uncertainty(reduction()).standard.eta_ptoo,
    "write_report: no result": lambda: wc.write_report("text", "page.html"),
    "write_report: None": lambda: wc.write_report(None, "page.html"),
    "write_report: a run": lambda: wc.write_report(run(), "page.html"),
    "write_report: another ending": lambda: wc.write_report(reduction(), "page.docx"),
    "write_report: path None": lambda: wc.write_report(reduction(), None),
    "write_report: path empty": lambda: wc.write_report(reduction(), ""),
    "write_report: no such folder": lambda: wc.write_report(reduction(), "no/such/folder/page.html"),
    "write_report: force a text": lambda: wc.write_report(reduction(), "page.html", force="yes"),
    # -------------------------------------------------------------------------------- rigs and the model
    "load_rig: None": lambda: wc.load_rig(None),
    "load_rig: a number": lambda: wc.load_rig(3),
    "load_rig: empty": lambda: wc.load_rig(""),
    "load_rig: misspelt": lambda: wc.load_rig("hsu2025"),
    "load_rig: a rig": lambda: wc.load_rig(hsu()),
    "load_rig: a folder": lambda: wc.load_rig(CAMPAIGN),
    "load_rig: a log": lambda: wc.load_rig(LOG),
    "load_rig: a campaign": lambda: wc.load_rig(CAMPAIGN / "campaign.toml"),
    "Rig: a number without unit": lambda: replace(hsu(), winch=Winch(r_drum=0.25)),
    "Rig: a number that is NaN": lambda: replace(hsu(), winch=Winch(r_drum=Quantity(math.nan, "m"))),
    "Rig: a part of another kind": lambda: replace(hsu(), winch=0.25),
    "Rig: thresholds None": lambda: replace(hsu(), thresholds=None),
    "Rig: without a name": lambda: wc.Rig(name=3),
    "Rig: sensors a list": lambda: replace(hsu(), sensors=[]),
    "baseline: by its name": lambda: wc.baseline("hsu2026"),
    "baseline: None": lambda: wc.baseline(None),
    "baseline: a rig without numbers": lambda: wc.baseline(wc.Rig(name="mine")),
    "simulate: a path": lambda: wc.simulate(LOG),
    "simulate: a reduction": lambda: wc.simulate(reduction()),
    "simulate: a rig as model": lambda: wc.simulate(run(), hsu()),
    "simulate: a name as model": lambda: wc.simulate(run(), "hsu2026"),
    "simulate: step 0": lambda: wc.simulate(run(), step=0.0),
    "simulate: step negative": lambda: wc.simulate(run(), step=-1e-3),
    "simulate: step NaN": lambda: wc.simulate(run(), step=math.nan),
    "simulate: step of a day": lambda: wc.simulate(run(), step=86400.0),
    "simulate: step a text": lambda: wc.simulate(run(), step="1 ms"),
    "simulate: a run without motion": lambda: wc.simulate(made(channels={"force": np.ones(1000)})),
    "simulate: a run of one sample": lambda: wc.simulate(made(t=[0.0], channels={"velocity": [1.0]}, samples=1)),
    "simulate: a model with NaN": lambda: wc.simulate(
        run(), replace(wc.baseline(hsu()), generator=replace(wc.baseline(hsu()).generator, k_e=math.nan))
    ),
    "simulate: a rig without numbers": lambda: wc.simulate(replace(run(), rig=wc.Rig(name="mine"))),
    "make_effect: misspelt": lambda: make_effect("ke_rollof", {}),
    "make_effect: misspelt field": lambda: make_effect("ke_shift", {"change": 0.1}),
    "make_effect: value a text": lambda: make_effect("ke_shift", {"k_e_change": "much"}),
    "calibrate: a path": lambda: wc.calibrate(CAMPAIGN / "open_circuit.csv"),
    "calibrate: a log with a load": lambda: wc.calibrate(run()),
    "calibrate: rig by its name": lambda: wc.calibrate(open_run(), "hsu2026"),
    "calibrate: payouts numbers": lambda: wc.calibrate(open_run(), payouts=[1.0, 2.0]),
    "calibrate: payouts in reverse": lambda: wc.calibrate(open_run(), payouts=[(9.0, 4.0)]),
    "calibrate: payouts a number": lambda: wc.calibrate(open_run(), payouts=3),
    "calibrate: no payout": lambda: wc.calibrate(open_run(), payouts=[]),
    "calibrate: payouts beyond the log": lambda: wc.calibrate(open_run(), payouts=[(1e6, 2e6)]),
    "calibrate: cycles of one number": lambda: wc.calibrate(open_run(), cycles=(1,)),
    # -------------------------------------------------------------------------------- campaigns
    "open_campaign: None": lambda: wc.open_campaign(None),
    "open_campaign: a number": lambda: wc.open_campaign(3),
    "open_campaign: empty": lambda: wc.open_campaign(""),
    "open_campaign: no such folder": lambda: wc.open_campaign("no/such/folder"),
    "open_campaign: a list": lambda: wc.open_campaign([LOG]),
    "open_campaign: misspelt rig": lambda: wc.open_campaign(CAMPAIGN, rig="hsu2025"),
    "open_campaign: a rig": lambda: wc.open_campaign(CAMPAIGN, rig=hsu()),
    "open_campaign: rig empty": lambda: wc.open_campaign(CAMPAIGN, rig=""),
    "open_campaign: window a word": lambda: wc.open_campaign(CAMPAIGN, window="soon"),
    "open_campaign: window negative": lambda: wc.open_campaign(CAMPAIGN, window=-1.0),
    "open_campaign: window True": lambda: wc.open_campaign(CAMPAIGN, window=True),
    "campaign.reduce: jobs 0": lambda: campaign().reduce(jobs=0),
    "campaign.reduce: jobs a float": lambda: campaign().reduce(jobs=1.5),
    "campaign.reduce: jobs a text": lambda: campaign().reduce(jobs="all"),
    "campaign.reduce: jobs True": lambda: campaign().reduce(jobs=True),
    "campaign.diagnose: suspects a text": lambda: campaign().diagnose(suspects="ke_rolloff"),
    "campaign.diagnose: misspelt suspect": lambda: campaign().diagnose(suspects=["ke_rollof"]),
    "campaign.diagnose: suspects None": lambda: campaign().diagnose(suspects=None),
    "campaign.diagnose: suspects numbers": lambda: campaign().diagnose(suspects=[1]),
    "campaign.diagnose: withhold a number": lambda: campaign().diagnose(withhold=36.0),
    "campaign.diagnose: withhold a text": lambda: campaign().diagnose(withhold=["36"]),
    "campaign.diagnose: withhold negative": lambda: campaign().diagnose(withhold=[-36.0]),
    "campaign.diagnose: withhold no load of it": lambda: campaign().diagnose(withhold=[37.0]),
    "campaign.diagnose: simulated a number": lambda: campaign().diagnose(simulated=3),
    "campaign.diagnose: no such simulations": lambda: campaign().diagnose(simulated="no/such"),
    "campaign.diagnose: seed a text": lambda: campaign().diagnose(seed="chance"),
    "campaign.diagnose: seed negative": lambda: campaign().diagnose(seed=-1),
    "campaign.diagnose: of logs": lambda: wc.open_campaign(LOG).diagnose(),
    "campaign.check: misspelt table": lambda: campaign().check("hsu2026-table3"),
    "campaign.check: None": lambda: campaign().check(None),
    "campaign.check: factors a number": lambda: campaign().check("hsu2026-table2", factors=2.0),
    "campaign.check: jobs 0": lambda: campaign().check("hsu2026-table2", jobs=0),
    "campaign.report: None": lambda: campaign().report(None),
    "campaign.report: another ending": lambda: campaign().report("campaign.docx"),
    "campaign.report: jobs a text": lambda: campaign().report("campaign.html", jobs="2"),
    "campaign.report: force a number": lambda: campaign().report("campaign.html", force=1),
    "campaign reduced: to_pandas misspelt": lambda: reduced().to_pandas("run"),
    "campaign reduced: to_pandas with other units": lambda: reduced().to_pandas("runs", units="imperial"),
    "campaign reduced: plot misspelt": lambda: reduced().plot("history"),
    "campaign reduced: plot on no axes": lambda: reduced().plot("efficiency", ax="left"),
    # -------------------------------------------------------------------------------- tables and comparisons
    "audit: None": lambda: wc.audit(None),
    "audit: a number": lambda: wc.audit(2),
    "audit: empty": lambda: wc.audit(""),
    "audit: misspelt table": lambda: wc.audit("hsu2026-table3"),
    "audit: a campaign": lambda: wc.audit(CAMPAIGN / "campaign.toml"),
    "audit: physics a text": lambda: wc.audit("hsu2026-table2", physics="yes"),
    "audit: rig without physics": lambda: wc.audit("hsu2026-table2", rig=hsu()),
    "audit: rig a number": lambda: wc.audit("hsu2026-table2", physics=True, rig=3),
    "audit: misspelt rig": lambda: wc.audit("hsu2026-table2", physics=True, rig="hsu2025"),
    "audit: watch a number": lambda: wc.audit("hsu2026-table2", physics=True, watch=3),
    "compare: numbers": lambda: wc.compare(3, 4),
    "compare: None": lambda: wc.compare(LOG, None),
    "compare: runs": lambda: wc.compare(run(), run()),
    "compare: empty": lambda: wc.compare(LOG, ""),
    "compare: no such file": lambda: wc.compare(LOG, "no_such.csv"),
    "compare: other loads": lambda: wc.compare(LOG, CAMPAIGN / "r9ohm.csv"),
    "compare: same_sensors a text": lambda: wc.compare(LOG, LOG, same_sensors="yes"),
    "compare: jobs 0": lambda: wc.compare(LOG, LOG, jobs=0),
    "compared: to_pandas misspelt": lambda: compared().to_pandas("cycles"),
    "compared: plot misspelt": lambda: compared().plot("power"),
    "compared: plot on no axes": lambda: compared().plot("efficiency", ax=[]),
    # -------------------------------------------------------------------------------- names
    "winchcascade: misspelt name": lambda: wc.reed_run,
}


@pytest.mark.parametrize("misuse", MISUSES)
def test_a_misuse_is_rejected_in_one_sentence(misuse: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises((wc.WinchcascadeError, AttributeError)) as caught:
        MISUSES[misuse]()
    sentence = str(caught.value)
    assert sentence
    assert "\n" not in sentence
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("of", [run, made, lambda: wc.simulate(run()).run], ids=["read", "made", "simulated"])
def test_the_channels_of_a_run_cannot_be_written_to(of: Callable[[], wc.Run]) -> None:
    found = of()
    with pytest.raises(ValueError, match="read-only"):
        found.channels["velocity"][0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        found.t[0] = 1.0


def test_the_arrays_that_a_run_is_made_of_stay_as_they_are() -> None:
    signal = holed(0.0)
    run = made(channels={"velocity": signal, "torque": list(signal)})
    assert signal.flags.writeable
    assert np.array_equal(run.channels["torque"], run.channels["velocity"])


def test_a_run_goes_whole_to_another_process() -> None:
    again = pickle.loads(pickle.dumps(run()))
    assert (again.rig.name, again.window) == ("hsu2026", 5.48)
    assert all(np.array_equal(again.channels[name], x) for name, x in run().channels.items())
