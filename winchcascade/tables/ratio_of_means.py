"""How far a mean of ratios can lie from a ratio of means, by what a table prints of its cycles."""

from __future__ import annotations

import msgspec

from winchcascade.core.published_table import DEVIATIONS, Table

ASSUMED_ENERGY = 0.20
ASSUMED_ETA = 0.03
"""Largest deviations of a cycle that a table counts as having if it prints none; the audit says so. [1]"""


class Bounds(msgspec.Struct, frozen=True):
    """How far means of ratios can lie from ratios of means. [1]

    `ratio` holds between an efficiency and the ratio of its mean energies, `product` between eta_pto and
    eta_trans eta_gen.
    """

    ratio: float
    product: float


def mean_of_products(one: float, other: float, cycles: int | None) -> float:
    """Largest mean of products of two sets of relative deviations from their means. [1]

    N deviations that sum to zero and stay within d make ``|sum(e h)| / N`` at most ``d_e d_h`` for even N, and
    ``d_e d_h (N - 1) / N`` for odd N, where one of them has to be zero. As ``mean(out) = mean(eta in) = mean(eta) mean(in)
    (1 + sum(e h) / N)``, this is how far a ratio of means can lie from the mean of ratios.

    Parameters
    ----------
    one, other : largest deviations of the two [1]
    cycles : their number N; None takes the larger bound, that of even N

    Examples
    --------
    >>> round(mean_of_products(0.18, 0.025, 3), 6), mean_of_products(0.18, 0.025, 1)
    (0.003, 0.0)
    """
    share = 1.0 if cycles is None or cycles % 2 == 0 else (cycles - 1) / cycles
    return one * other * share


class Repeatability(msgspec.Struct, frozen=True):
    """What bounds the deviations of the cycles behind a table, and whether the table says so.

    `energy` and `eta` are the largest deviations of any cycle from the mean, rounding included [1]; `basis` says it in
    words, `assumed` names what the table does not print.
    """

    energy: float
    eta: float
    cycles: int | None
    basis: str
    assumed: tuple[str, ...]

    @property
    def bounds(self) -> Bounds:
        """How far efficiencies can lie from the ratio of mean energies, and eta_pto from eta_trans eta_gen."""
        return Bounds(
            ratio=mean_of_products(self.energy, self.eta, self.cycles),
            product=mean_of_products(self.eta, self.eta, self.cycles),
        )


def repeatability(table: Table) -> Repeatability:
    """Read the repeatability of a table's cycles; what is not printed takes the assumed values.

    A printed deviation counts with its rounding: 18 % is anything below 18.5 %.

    >>> from winchcascade.core.table_toml import load_table
    >>> round(repeatability(load_table("hsu2026-table2")).bounds.ratio, 6)
    0.003145
    """
    largest, words, assumed = [], [], []
    for name, otherwise in zip(DEVIATIONS, (ASSUMED_ENERGY, ASSUMED_ETA), strict=True):
        printed = table.deviations.get(name)
        if printed is None:
            largest.append(otherwise)
            words.append(f"{100 * otherwise:g} %")
            assumed.append(f"{name}_percent")
        else:
            value, column = printed
            largest.append(column.span(value).high)
            words.append(column.text(value))
    assumed += ["cycles"] if table.cycles is None else []
    cycles = "any number of cycles" if table.cycles is None else f"{table.cycles} cycle{'s'[: table.cycles != 1]}"
    basis = f"{cycles} with deviations of {words[0]} and {words[1]}" + (" (assumed)" if assumed else "")
    return Repeatability(largest[0], largest[1], table.cycles, basis, tuple(assumed))
