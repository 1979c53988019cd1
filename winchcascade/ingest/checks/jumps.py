"""Take out what jumps away and back in a channel of a log: dropouts, single spikes and short glitches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from winchcascade.core.channels import Channel
from winchcascade.core.run import Finding, Index, Signal
from winchcascade.ingest.checks.channel_findings import farthest, text_of
from winchcascade.ingest.checks.dropouts import ROUNDS, Dropout, find_dropouts
from winchcascade.ingest.checks.glitches import LONGEST, Pulses, find_glitches, find_pulses, is_torn
from winchcascade.ingest.checks.log_in_check import LogInCheck, in_places, stages_of
from winchcascade.ingest.checks.spikes import Bends, find_bends, single_spikes
from winchcascade.ingest.checks.witnesses import Witnesses


def take_out_jumps(log: LogInCheck, *, open_circuit: bool) -> dict[str, Bends]:
    """Take dropouts, single spikes and short glitches out of the channels; where these bend sharply."""
    longest = int(LONGEST * (log.t.size - 1) / float(log.t[-1] - log.t[0]) + 1e-6)
    sharp = _take_out_dropouts(log, open_circuit=open_circuit)
    witnesses = Witnesses(log.channels, {name: bends.usual for name, bends in sharp.items()})
    pulses: dict[str, Pulses] = {}
    findings: dict[str, list[Finding]] = {}
    singles = {name: _unseen_spikes(log, name, bends, witnesses) for name, bends in sharp.items()}
    for name, spikes in singles.items():
        pulses[name] = find_pulses(sharp[name], spikes, longest, farthest(log.rig.sensors.get(name)))
        what = "single samples deviate far from their neighbours"
        findings[name] = log.take_out_spikes(name, sharp[name].logged(spikes), what)
    for name, glitches in find_glitches(log.t, witnesses, pulses).items():
        x = log.channels[name]
        samples = np.concatenate([np.arange(g.start, g.stop)[np.isfinite(x[g])] for g in glitches])
        what = f"samples jump away from their neighbours and back, in {in_places(len(glitches))}"
        findings[name] += log.take_out_spikes(name, samples, what)
    log.findings += [finding for found in findings.values() for finding in found]
    return sharp


def _unseen_spikes(log: LogInCheck, name: str, bends: Bends, witnesses: Witnesses) -> Index:
    """Single spikes of a channel that no other channel shows, as indices of its finite samples.

    Nothing else can show one of the displacement that is farther than the line can move.
    """
    spikes, x, places = single_spikes(bends), bends.x, bends.places

    def is_unseen(k: int) -> bool:
        before = int(places[k - 1]) if k else -1
        after = int(places[k + 1]) if k + 1 < x.size else log.t.size
        jump = float(abs(x[k] - x[k - 1 if k else 1]))
        torn = name == "displacement" and is_torn(log.t, log.channels, before, after, jump)
        return torn or bends.usual.is_far(float(x[k])) or not witnesses.show(name, before, after)

    unseen: Index = spikes[np.array([is_unseen(k) for k in spikes.tolist()], dtype=bool)]
    return unseen


def _take_out_dropouts(log: LogInCheck, *, open_circuit: bool) -> dict[str, Bends]:
    """Take out the stretches in which a channel holds a value that it cannot have; where the channels then bend sharply."""
    bends = {name: find_bends(x) for name, x in log.channels.items()}
    stages = stages_of(log)
    taken: dict[str, tuple[Signal, list[Dropout], list[Index]]] = {}
    for _ in range(ROUNDS):
        dropouts = find_dropouts(log.t, log.channels, bends, stages, open_circuit=open_circuit)
        for name, found in dropouts.items():
            x = log.channels[name]
            _, stretches, parts = taken.setdefault(name, (x.copy(), [], []))
            for d in found:
                samples = np.arange(d.before + 1, d.after)
                parts.append(samples[(x[samples] == d.value) | (not d.even)])
            stretches += found
            x[np.concatenate(parts)] = np.nan
            bends[name] = find_bends(x)
        if not dropouts:
            break
    for name, (whole, stretches, parts) in taken.items():
        log.channels[name][:] = whole
        values = _values(log.rig.known_channels[name], stretches)
        what = f"samples jump to {values} while other channels continue, in {in_places(len(parts))}"
        log.findings += log.take_out_spikes(name, np.concatenate(parts), what)
    return bends


def _values(channel: Channel, stretches: Sequence[Dropout]) -> str:
    """The values that a channel dropped to, the most frequent ones, for a sentence."""
    texts = [text_of(channel, d.value, 6) if d.even else f"about {text_of(channel, d.value, 2)}" for d in stretches]
    by_count = sorted({*texts}, key=lambda text: (-texts.count(text), text))
    return f"{' or '.join(by_count[:2])} {channel.unit}" + (" or other constants" if len(by_count) > 2 else "")
