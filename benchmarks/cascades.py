"""Cascades of random stages with hidden losses: how many of them laws of stages name, and how often
intervals hold.

A cascade has one to four stages from hydraulics over a shaft to terminals, of 1 W to 1 MW. Each
stage has three to eight laws; the rig file states all but two of them, or all, with a standard
uncertainty that the truth keeps. Sensors have gains and zeros within what the rig file states. No
line of this file uses the code that it tries, but for the names of the laws.

    python benchmarks/cascades.py --cases 60
"""

from __future__ import annotations

import argparse
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from winchcascade.batch.campaign_diagnosis import diagnose_campaign

ENDS = ("hyd", "mech", "gen", "bus", "cell")
CHANNELS = {
    "hyd": ("pressure", "flow"), "mech": ("torque", "speed"), "gen": ("idc", "vdc"), "bus": ("i_bus", "v_bus"),
    "cell": ("i_cell", "v_cell"),
}  # fmt: skip
UNITS = {"pressure": "Pa", "flow": "m3/s", "torque": "N.m", "speed": "rad/s"}
LOSSES: dict[str, dict[str, int]] = {
    "standby": {}, "shaft_friction": {"speed": 1}, "shaft_viscous": {"speed": 2}, "shaft_windage": {"speed": 3},
    "power_share": {"power": 1}, "copper": {"current": 2}, "junction": {"current": 1}, "bleed": {"voltage": 2},
    "pressure_drop": {"flow": 3}, "leakage": {"pressure": 2},
}  # fmt: skip
LAW_UNITS = {
    "standby": "W", "shaft_friction": "N.m", "shaft_viscous": "N.m.s/rad", "shaft_windage": "N.m.s2/rad2",
    "power_share": "relative", "copper": "ohm", "junction": "V", "bleed": "S", "pressure_drop": "Pa.s2/m6",
    "leakage": "m3/(Pa.s)", "shaft_inertia": "kg.m2",
}  # fmt: skip
STATED_U = 0.02
"""Standard uncertainty of a stated law, as a share of its number."""

Truth = dict[str, float]


def signals_of(into: str, out: str) -> set[str]:
    """Signals of a stage by the names of its ends."""
    own = {"hyd": {"flow", "pressure"}, "mech": {"speed"}}
    return {
        "power",
        *(name for end in (into, out) for name in own.get(end, {"current", "voltage"})),
    }


def drawn(rng: np.random.Generator, hidden: int) -> tuple[dict[str, np.ndarray], str, Truth]:
    """Channels of a log by their names, the rig file, and the hidden laws by stage with their
    numbers.
    """
    first, paths = int(rng.integers(0, 4)), int(rng.integers(1, 5))
    chain = ENDS[min(first, len(ENDS) - 1 - paths) :][: paths + 1]
    power, speed = 10.0 ** rng.uniform(0.0, 6.0), 10.0 ** rng.uniform(1.0, 2.7)
    motion, load, t = _course(rng)
    top = {
        "flow": 10.0 ** rng.uniform(-5, -2),
        "voltage": 10.0 ** rng.uniform(0.7, 2.8),
        "speed": speed,
    }
    laws: dict[str, dict[str, float]] = {}
    for into, out in pairwise(chain):
        allowed = [name for name, over in LOSSES.items() if set(over) <= signals_of(into, out)]
        kept = rng.permutation(allowed)[: int(rng.integers(3, 9))].tolist()
        laws[out] = {
            name: float(rng.uniform(0.005, 0.025)) for name in kept
        }  # as shares of the power at the top
        if into == "mech":
            laws[out]["shaft_inertia"] = float(rng.uniform(0.05, 0.2))
    every = [(out, name) for out, own in laws.items() for name in own if name != "shaft_inertia"]
    chosen = [every[k] for k in rng.permutation(len(every))[:hidden]]
    for out, name in chosen:
        laws[out][name] = float(rng.uniform(0.02, 0.06))
    numbers: dict[str, dict[str, float]] = {out: {} for out in laws}
    made = {chain[0]: _channels(chain[0], power * motion * load, motion, top)}
    for into, out in pairwise(chain):
        flowing = np.prod(list(made[into].values()), axis=0)
        given = _signals(into, made[into]) | {"power": flowing}
        tops = {name: float(np.max(np.abs(x))) for name, x in given.items()}
        outgoing = 0.8 * flowing
        for _ in range(60):  # what comes out decides the current that costs power
            made[out] = _channels(out, outgoing, motion, top)
            signals = _signals(out, made[out]) | given
            lost = np.zeros(t.size)
            for name, share in laws[out].items():
                over = LOSSES.get(name, {})
                if name == "shaft_inertia":
                    number = float(share * power / speed**2)
                    lost += number * signals["speed"] * np.gradient(signals["speed"], t)
                else:
                    size = float(
                        np.prod(
                            [
                                tops.get(s, float(np.max(np.abs(signals[s])))) ** n
                                for s, n in over.items()
                            ]
                        )
                    )
                    number = numbers[out].get(name, share * power / size)
                    lost += number * np.prod(
                        [np.abs(signals[s]) ** n for s, n in over.items()] + [np.ones(t.size)],
                        axis=0,
                    )
                numbers[out][name] = float(number)
            outgoing = flowing - lost
    truth = {
        f"{name}({chain[chain.index(out) - 1]}-{out})": numbers[out][name] for out, name in chosen
    }
    log = {"time": t}
    text = f'name = "cascade"\n[cascade]\nstages = {list(chain)!r}\n[phases]\nfrom = "whole"\n'.replace(
        "'", '"'
    )
    text += "[thresholds]\nsmoothing = 0.6\nv_onset = 0.01\ngap_max = 5.0\nstroke_min = 0.1\nplateau_hold=0.3\nsettle=0.3\n"
    for end in chain:
        if end in ("bus", "cell"):
            text += f'[stage.{end}]\npower = "v_{end} * i_{end}"\n[channels]\nv_{end}.unit = "V"\ni_{end}.unit = "A"\n'
    text = _channels_once(text)
    for end in chain:
        for name, x in made[end].items():
            size = float(np.max(np.abs(x)))
            gain, zero = rng.uniform(0.0005, 0.002), rng.uniform(0.0001, 0.0005) * size
            x = x * (1.0 + gain * rng.normal()) + zero * rng.normal() * (name != "speed")
            log[name] = x + rng.normal(0.0, 1e-3 * size, x.size)
            unit = UNITS.get(name, "V" if name.startswith("v") else "A")
            text += f'[sensors.{name}]\nunit = "{unit}"\nu_gain = {gain}\nu_zero = {zero}\n'
            text += f'[columns.{name}]\nname = "{name}"\nunit = "{unit}"\n' + (
                'side = "shaft"\n' if name == "speed" else ""
            )
    for out, own in numbers.items():
        for name, number in own.items():
            if (out, name) in chosen:
                continue
            u = STATED_U * number
            stated = number + u * rng.normal()
            text += f'[laws.{out}.{name}]\nvalue = {stated}\nunit = "{LAW_UNITS[name]}"\nu = {u}\n'
    return log, text, truth


def _channels_once(text: str) -> str:
    """A rig file whose tables [channels] are one."""
    parts = text.split("[channels]\n")
    lines = [line for part in parts[1:] for line in part.splitlines()[:2]]
    rest = parts[0] + "".join("\n".join(part.splitlines()[2:]) + "\n" for part in parts[1:])
    return rest + ("[channels]\n" + "\n".join(lines) + "\n" if lines else "")


def _course(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Motion and load as shares of their tops, in steps with ramps, and the stamps."""
    count = int(rng.integers(24, 48))
    corners = np.cumsum(
        np.ravel([[rng.uniform(1.0, 3.0), rng.uniform(3.0, 8.0)] for _ in range(count)])
    )
    t = np.arange(0.0, corners[-1], 0.1)
    return (
        np.interp(t, corners, np.repeat(rng.uniform(0.2, 1.0, count), 2)),
        np.interp(t, corners, np.repeat(rng.uniform(0.15, 1.0, count), 2)),
        t,
    )


def _channels(
    end: str, power: np.ndarray, motion: np.ndarray, top: dict[str, float]
) -> dict[str, np.ndarray]:
    effort, flow = CHANNELS[end]
    sizes = {"flow": top["flow"], "speed": top["speed"], "vdc": top["voltage"]}
    x = sizes[flow] * motion if flow in sizes else np.full(motion.size, 2.0 * top["voltage"])
    return {effort: power / x, flow: x}


def _signals(end: str, channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    effort, flow = channels.values()
    names = {"hyd": ("pressure", "flow"), "mech": ("torque", "speed")}.get(
        end, ("current", "voltage")
    )
    return dict(zip(names, (effort, flow), strict=True))


def diagnosed(seed: int, hidden: int) -> tuple[dict[str, Any], Truth]:
    """Record of the diagnosis of one cascade, and what it hides."""
    log, text, truth = drawn(np.random.default_rng(seed), hidden)
    with TemporaryDirectory() as place:
        folder = Path(place)
        header = ",".join("Time (s)" if name == "time" else name for name in log)
        np.savetxt(
            folder / "log.csv",
            np.column_stack(list(log.values())),
            "%.9g",
            ",",
            header=header,
            comments="",
        )
        (folder / "rig.toml").write_text(text, encoding="utf-8")
        (folder / "campaign.toml").write_text(
            'rig = "rig.toml"\n[[run]]\nfile = "log.csv"\n', encoding="utf-8"
        )
        return diagnose_campaign(folder / "campaign.toml"), truth


def scored(record: dict[str, Any], truth: Truth) -> dict[str, Any]:
    """Which hidden laws are named, alone or in their class, which names are false and certain,
    and which intervals hold.
    """
    causes = {cause["effect"]: cause for cause in record["causes"]}
    same = {name: name for name in truth} | {
        name.partition("(")[0]: name for name in truth
    }  # of one stage alone no stage is named
    own = {same[name]: cause for name, cause in causes.items() if name in same}
    exact = [name for name in truth if name in own]
    alike = [
        same[one["effect"]]
        for cause in causes.values()
        for one in cause["look_alikes"]
        if one["effect"] in same
    ]
    certain = [
        name
        for name, one in causes.items()
        if one["probability"] >= 0.95 and not one["look_alikes"]
    ]
    numbers = {name: next(iter(own[name]["parameters"].values())) for name in exact}
    return {
        "exact": exact,
        "named": sorted({*exact, *alike}),
        "false": [name for name in certain if name not in same],
        "inside": [bool(one["low"] <= truth[name] <= one["high"]) for name, one in numbers.items()],
        "causes": {name: round(one["probability"], 2) for name, one in causes.items()},
        "verdict": record["verdict"],
    }


def main() -> None:
    """Print each cascade, and the score of all."""
    options = argparse.ArgumentParser()
    options.add_argument("--cases", type=int, default=60)
    options.add_argument("--first", type=int, default=0)
    given = options.parse_args()
    wanted = named = exact = false = inside = intervals = empty = silent = 0
    for seed in range(given.first, given.first + given.cases):
        hidden = 0 if seed % 4 == 3 else 2
        record, truth = diagnosed(seed, hidden)
        score = scored(record, truth)
        print(seed, truth, score, flush=True)
        wanted += len(truth)
        named += len(score["named"])
        exact += len(score["exact"])
        false += len(score["false"])
        inside += sum(score["inside"])
        intervals += len(score["inside"])
        empty += hidden == 0
        silent += hidden == 0 and not score["causes"]
    print(
        f"named {named} of {wanted} ({exact} alone), false with certainty {false}, intervals "
        f"{inside} of {intervals}"
    )
    print(f"nothing hidden: {silent} of {empty} without a cause")


if __name__ == "__main__":
    main()
