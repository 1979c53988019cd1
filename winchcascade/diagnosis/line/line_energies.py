"""Energies of a winch by cycle and phase: measured, by the line alone and with the causes, and whether they agree."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.block_means import HOLD, PHASES
from winchcascade.diagnosis.diagnosis_result import Alarm, CycleEnergy, Names, Spot
from winchcascade.diagnosis.line.line_data import POWER, CyclePart, Lines
from winchcascade.diagnosis.line.line_selection import Moments, line_covariance
from winchcascade.diagnosis.stability import CHANCE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.run import Index, Signal

SMALL_ENERGY = 0.03
"""Share of the measured energy of a phase below which a difference has no effect on the verdict: force cells and powers of
field winches are accurate to 1 to 3 % of the reading."""


class EnergyTable(msgspec.Struct, frozen=True):
    """Energies of the judged cycles by phase, (r,) each in J.

    `run` is the number of the part. `residual` is measured minus predicted with the causes, `columns` (r, suspects) the
    energy per unit of each coefficient. Variances of the residual [J2]: `within` as the noise within a phase has it,
    `between` as the phases of all cycles scatter. `yardstick` is the energy that a residual is compared with: at rest that
    of the payout.
    """

    run: Index
    cycle: Index
    phase: Index
    measured: Signal
    before: Signal
    residual: Signal
    columns: Signal
    within: Signal
    between: Signal
    yardstick: Signal


def energy_table(m: Moments, parts: Sequence[CyclePart], after: Sequence[Signal]) -> EnergyTable:
    """Integrate the powers of judged parts over each phase of each cycle.

    Parameters
    ----------
    after : measured minus predicted power, part by part, (k,) each [W]
    """
    tables = [_of_part(m, k, part, own) for k, (part, own) in enumerate(zip(parts, after, strict=True))]
    return EnergyTable(*(np.concatenate(each) for each in zip(*map(msgspec.structs.astuple, tables), strict=True)))


def _of_part(m: Moments, number: int, part: CyclePart, after: Signal) -> EnergyTable:
    codes, place = np.unique(part.cycle * len(PHASES) + part.phase, return_inverse=True)
    cycle, phase = np.divmod(codes, len(PHASES))

    def summed(power: Signal) -> Signal:
        return np.bincount(place, power * part.width, codes.size).astype(np.float64)

    before = summed(part.line_power)
    measured, duration = before + summed(part.gap), summed(np.ones(part.here.size))
    within, between = (
        _step(part) * duration * np.array([m.variance[cells[p]] if cells[p] >= 0 else m.variance.max() for p in phase])
        for cells in (m.cells.within, m.cells.of_mean)
    )
    payout = {int(c): x for c, p, x in zip(cycle, phase, measured, strict=True) if PHASES[p] == "payout"}
    working = np.array([payout.get(int(c), x) for c, x in zip(cycle, measured, strict=True)])
    columns = np.column_stack([summed(column) for column in part.columns.T])
    yardstick = np.where(phase == HOLD, working, measured)
    run = np.full(codes.size, number)
    return EnergyTable(run, cycle, phase, measured, before, summed(after), columns, within, between, yardstick)


def _step(part: CyclePart) -> float:
    """Time between samples. The sum of n samples has n times the variance of a coefficient of their mean. [s]"""
    return float(np.median(part.width))


def energy_rows(lines: Lines, m: Moments, names: Names, table: EnergyTable) -> tuple[CycleEnergy, ...]:
    """Energies for reports; the uncertainty of each contains noise, the scatter of cycles and that of the coefficients."""
    of_numbers = np.einsum("ri,ij,rj->r", table.columns, line_covariance(lines, m, names), table.columns)
    u = np.sqrt(table.between + of_numbers)
    parts = lines.judged
    return tuple(
        CycleEnergy(parts[k].run.name, cycle, PHASES[phase], "mech", measured, before, measured - residual, one)
        for k, cycle, phase, measured, before, residual, one in zip(
            *(
                x.tolist()
                for x in (table.run, table.cycle, table.phase, table.measured, table.before, table.residual, u)
            ),
            strict=True,
        )
    )


def energy_alarms(lines: Lines, m: Moments, names: Names, table: EnergyTable) -> tuple[Alarm, ...]:
    """Phases whose energies the causes do not explain.

    Either the single cycles deviate, beyond the noise within a phase, or all together do, beyond how cycles scatter; both
    by more than a small share of the energy, and beyond what the uncertainty of the coefficients makes.
    """
    from scipy.special import chdtrc

    spread, found = line_covariance(lines, m, names), []
    for p, name in enumerate(PHASES):
        here = table.phase == p
        if not here.any():
            continue
        r, x, yardstick = table.residual[here], table.columns[here], table.yardstick[here]
        by_cycle = np.diag(table.within[here]) + x @ spread @ x.T
        altogether = float(table.between[here].sum() + x.sum(axis=0) @ spread @ x.sum(axis=0))
        size = float(np.linalg.norm(r)) / max(float(np.linalg.norm(yardstick)), 1e-300)
        chance = float(chdtrc(r.size, max(float(r @ np.linalg.pinv(by_cycle, hermitian=True) @ r), 0.0)))
        total = abs(float(r.sum())) / max(abs(float(yardstick.sum())), 1e-300)
        total_chance = float(chdtrc(1, r.sum() ** 2 / max(altogether, 1e-300)))
        sizes = [s for s, c in ((size, chance), (total, total_chance)) if s > SMALL_ENERGY and c < CHANCE]
        if sizes:
            found.append(Alarm("energy", Spot(POWER, name), max(sizes), SMALL_ENERGY))
    return tuple(sorted(found, key=lambda alarm: -alarm.size))
