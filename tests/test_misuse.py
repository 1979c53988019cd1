"""Misuse of the library: each call that cannot work is rejected in one sentence, never with a
traceback or a wrong result.
"""

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
from loops import failures
from msgspec.structs import replace

import winchcascade as wc
from winchcascade.core.quantity import Quantity
from winchcascade.rig.parts import with_part

CAMPAIGN = Path(__file__).parent.parent / "fixtures" / "campaign"
LOG = CAMPAIGN / "r36ohm.csv"


@cache
def run() -> wc.Run:
    return wc.read_run(LOG)


@cache
def reduction() -> wc.Reduction:
    return wc.reduce(run())


@cache
def hsu() -> wc.Rig:
    return wc.load_rig("hsu2026")


@cache
def baseline() -> wc.Model:
    return wc.baseline(hsu())


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
    good = {
        "name": "by hand",
        "t": t,
        "channels": {"velocity": np.sin(t)},
        "fs": 25.0,
        "samples": t.size,
    }
    return wc.Run(**{**good, **fields})


def frame(**columns: Any) -> pd.DataFrame:
    return pd.DataFrame({"Time (s)": np.arange(0.0, 40.0, 0.04), **columns})


def holed(value: float) -> Any:
    signal = np.sin(np.arange(0.0, 40.0, 0.04))
    signal[7] = value
    return signal


def keyword(call: Callable[..., Any], name: str, *others: Any) -> Callable[[Any], Any]:
    """A call of which one argument is given by its name."""
    return lambda value: call(*map(ready, others), **{name: value})


def ready(value: Any) -> Any:
    """A value, made now if it is one of those that are made when they are needed."""
    late = (run, reduction, hsu, campaign, reduced, compared)
    return value() if any(value is one for one in late) else value


TEXTS: tuple[Any, ...] = (3, None, "")
Misuse = tuple[Callable[[Any], Any], list[Any]]

MISUSES: dict[str, Misuse] = {
    "read_run source": (
        wc.read_run,
        [*TEXTS, [LOG], b"r36ohm.csv", np.zeros((9, 3)), pd.Series([1.0]), run, "r36\0.csv", "x" * 5000, CAMPAIGN],
    ),
    "read_run frame": (
        wc.read_run,
        [pd.DataFrame(), frame(), frame(velocity="fast"), frame(velocity=np.nan)],
    ),
    "read_run load": (
        keyword(wc.read_run, "load", LOG), [True, 0.0, -18.0, math.nan, -math.inf, "36", [36.0], 36j],
    ),
    "read_run rig": (keyword(wc.read_run, "rig", LOG), ["", "hsu2026", False, {}]),
    "read_run units": (
        keyword(wc.read_run, "units", frame(velocity=1.0)),
        ["kN", ["kN"], {"velocity": 1000.0}, {"velocitty": "m/s"}, {"velocity": "parsec"}],
    ),
    "Run channels": (
        keyword(made, "channels"),
        [
            {}, None, np.zeros(1000),
            *({"velocity": x} for x in (holed(math.nan), holed(math.inf), np.zeros(0), np.zeros(999), np.zeros((1000, 1)))),
            {"velocity": ["fast"] * 1000}, {"velocity": None},
        ],
    ),
    "Run t": (keyword(made, "t"), [np.zeros(0), np.arange(40.0, 0.0, -0.04), np.zeros(1000), holed(math.nan), None]),
    "Run fs": (keyword(made, "fs"), [0.0, math.nan, -25.0, "25 Hz"]),
    "Run load": (keyword(made, "load"), [-18.0, True, "open"]),
    "Run window": (lambda window: wc.reduce(made(window=window)), ["soon"]),
    "Run misspelt channel": (
        lambda name: wc.reduce(made(channels={"velocity": np.sin(made().t), name: made().t})), ["forse"],
    ),
    "Run replaced": (
        lambda fields: wc.reduce(replace(run(), **fields)),
        [
            {"t": run().t[::-1]}, {"t": run().t[:-5]}, {"t": run().t.astype("timedelta64[s]")}, {"t": np.arange(run().t.size)},
            {"fs": 0.0}, {"fs": 2500.0}, {"name": 3}, {"findings": None}, {"cycles": 5}, {"gaps": "force"}, {"rig": "hsu2026"},
        ],
    ),
    "Rig numbers": (
        lambda part: replace(hsu(), **{part[0]: replace(getattr(hsu(), part[0]), **{part[1]: part[2]})}),
        [
            ("winch", "r_drum", 0.13), ("winch", "r_drum", Quantity(0.0, "m")), ("winch", "r_drum", Quantity("a", "m")),
            ("drivetrain", "gear_ratio", Quantity(0.0, "1")), ("thresholds", "smoothing", 0.0),
            ("thresholds", "v_onset", "0.03"), ("thresholds", "window", "soon"), ("thresholds", "gap_max", None),
        ],
    ),
    "Rig parts": (
        lambda part: replace(hsu(), **part),
        [{"winch": None}, {"sensors": None}, {"sensors": {"force": 3.0}}, {"cascade": None}, {"phases": "velocity"}],
    ),
    "simulate": (
        lambda of: wc.simulate(replace(run(), channels={"velocity": of[0] * run().channels["velocity"]}), step=of[1]),
        [(1000.0, None), (1.0, 0.0), (1.0, 50.0), (1.0, 1e-9)],
    ),
    "reduce units": (lambda units: wc.reduce(units[0], units=units[1]), [(run(), {"force": "kN"}), (LOG, {"force": "kN"})]),
    "Run frozen": (lambda value: setattr(run(), "load", value), [3.0]),
    "Run frozen channels": (lambda value: run().channels.__setitem__("force", value), [None]),
    "reduce run": (wc.reduce, [None, 3, [LOG], "no_such.csv", frame(), frame(velocity=np.nan)]),
    "reduce load": (lambda load: wc.reduce(run(), load=load), [36.0]),
    "reduce load of a file": (keyword(wc.reduce, "load", LOG), [0.0, "36"]),
    "reduce rig": (keyword(wc.reduce, "rig", run), ["hsu2026", "", Path("rig.toml")]),
    "reduce window": (
        keyword(wc.reduce, "window", run), ["soon", 0.0, math.nan, True, (1.0, 2.0), 500.0, ""],
    ),
    "reduce cycles": (
        keyword(wc.reduce, "cycles", run), [(1,), (1, 2, 3), 2, (3, 1), (0, 2), (8, 9), ("1", "2"), (1.5, 2.5), ()],
    ),
    "attributes": (
        lambda path: eval(path, {"reduction": reduction, "run": run, "wc": wc}),
        [
            "reduction().mean.eta_ptoo", "reduction().mean.energy_lin", "reduction().mean.power_shaft",
            "reduction().mean['eta_ptoo']", "reduction().mean[3]", "reduction().mean.efficiency",
            "reduction().cycles[0].metrics.eta_tran", "reduction().max_deviation_percent.eta_ptoo",
            "reduction().total.eta_ptoo", "reduction().means", "run().chanels", "wc.Metrics(eta_pto=0.7).eta_ptoo",
            "wc.uncertainty(reduction()).standard.eta_ptoo", "wc.reed_run",
        ],
    ),
    "reduction to_pandas": (lambda table: reduction().to_pandas(table), ["cycle", 3]),
    "run plot": (lambda what: run().plot(what), ["forse", 3, "flow"]),
    "write_report result": (lambda result: wc.write_report(result, "page.html"), ["text", None, run]),
    "write_report path": (
        lambda path: wc.write_report(reduction(), path), ["page.docx", None, "", "no/such/folder/page.html"],
    ),
    "load_rig": (wc.load_rig, [*TEXTS, "hsu2025", hsu, CAMPAIGN, LOG, CAMPAIGN / "campaign.toml"]),
    "baseline": (wc.baseline, ["hsu2026", None, wc.Rig(name="mine")]),
    "simulate run": (
        wc.simulate,
        [
            LOG, reduction, made(channels={"force": np.ones(1000)}), made(t=[0.0], channels={"velocity": [1.0]}, samples=1),
            made(rig=wc.Rig(name="mine")),
        ],
    ),
    "simulate model": (
        lambda model: wc.simulate(run(), model),
        [hsu, "hsu2026", with_part(baseline(), "generator", k_e=math.nan)],
    ),
    "open_campaign": (wc.open_campaign, [*TEXTS, "no/such/folder", [LOG]]),
    "diagnose suspects": (
        lambda names: campaign().diagnose(suspects=names), ["ke_rolloff", ["ke_rollof"], None, [1]],
    ),
    "audit": (wc.audit, [*TEXTS, "hsu2026-table3", CAMPAIGN / "campaign.toml"]),
    "compare": (lambda other: wc.compare(LOG, other), [3, None, run, "", "no_such.csv", CAMPAIGN / "r9ohm.csv"]),
}  # fmt: skip
"""Calls with one argument that is wrong, and its wrong values."""


@pytest.mark.parametrize("misuse", MISUSES)
def test_a_misuse_is_rejected_in_one_sentence(
    misuse: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    call, values = MISUSES[misuse]

    def check(number: int) -> None:
        value = values[number]
        with pytest.raises((wc.WinchcascadeError, AttributeError)) as caught:
            call(ready(value))
        assert str(caught.value)
        assert "\n" not in str(caught.value)
        assert not list(tmp_path.iterdir())

    monkeypatch.chdir(tmp_path)
    assert failures(check, [(number,) for number in range(len(values))]) == []


@pytest.mark.parametrize(
    "of", [run, made, lambda: wc.simulate(run()).run], ids=["read", "made", "simulated"]
)
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
    assert (again.rig.name, again.window) == ("hsu2026_rebuilt", 5.48)
    assert all(np.array_equal(again.channels[name], x) for name, x in run().channels.items())


def test_a_log_without_a_cycle_states_the_reason() -> None:
    without = {
        name: x for name, x in run().channels.items() if name not in ("velocity", "displacement")
    }
    never = replace(hsu(), thresholds=replace(hsu().thresholds, v_onset=5.0))
    for found in (wc.reduce(replace(run(), channels=without)), wc.reduce(run(), rig=never)):
        assert found.cycles == ()
        assert "phase_source" in {finding.kind for finding in found.quality}


def test_reduce_takes_the_units_of_a_frame() -> None:
    table = pd.read_csv(LOG).rename(columns={"Force (N)": "force"})
    plain, other = (
        wc.reduce(table, units={"force": unit}).mean.value("energy_line") for unit in ("N", "kN")
    )
    assert other == pytest.approx(1000.0 * plain)
