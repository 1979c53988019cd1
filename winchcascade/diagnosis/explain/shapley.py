"""The value of Shapley (1953): what each of several adds, averaged over the orders in which they
may be added.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.run import Signal


# -------------------------------------------------------------------------------------- the split
def shapley(values: Signal) -> Signal:
    """Split what all players reach among them by the mean of what each adds, over all orders of the
    players.

    Parameters
    ----------
    values : (2**k, ...) value of each subset; bit i of the index is set where player i takes part

    Returns
    -------
    (k, ...) in the unit of the values

    Examples
    --------
    >>> shapley(np.array([0.0, 1.0, 2.0, 5.0])).tolist()
    [2.0, 3.0]
    """
    count = values.shape[0].bit_length() - 1
    subsets = np.arange(values.shape[0])
    size = np.array([int(subset).bit_count() for subset in subsets])
    found = np.empty((count, *values.shape[1:]))
    for player in range(count):
        without = subsets[subsets >> player & 1 == 0]
        weight = np.array([1.0 / (count * math.comb(count - 1, int(n))) for n in size[without]])
        found[player] = np.tensordot(
            weight, values[without | 1 << player] - values[without], axes=1
        )
    return found


EXACT = 8
"""Maximum number of causes whose subsets are all simulated, 256 of them. [1]"""


PAIRS_OF_ORDERS = 16
"""Number of orders of more causes that are drawn, each with its reverse: about as many subsets
as the most of all. [1]
"""


def orders_of(count: int) -> list[tuple[int, ...]]:
    """Orders in which some players are added where their subsets are too many: drawn ones, each
    followed by its reverse.
    """
    drawn = np.random.default_rng(count)
    orders = [tuple(drawn.permutation(count).tolist()) for _ in range(PAIRS_OF_ORDERS)]
    return [each for order in orders for each in (order, order[::-1])]


def joined_by(order: Sequence[int]) -> list[int]:
    """Subsets as bits, from none to all, as players join in an order.

    >>> joined_by((1, 0))
    [0, 2, 3]
    """
    return [sum(1 << player for player in order[:size]) for size in range(len(order) + 1)]


def subsets_of(count: int) -> list[int]:
    """Subsets of some players whose values a split needs, as bits in rising order, from none to
    all.
    """
    if count <= EXACT:
        return list(range(1 << count))
    return sorted({subset for order in orders_of(count) for subset in joined_by(order)})


def split(values: Signal, count: int) -> tuple[Signal, Signal]:
    """Split as `shapley` does, of more than `EXACT` players by drawn orders; with the standard
    error of that, (k, ...) each.

    Parameters
    ----------
    values : value of each of `subsets_of` the players, in their order
    """
    if count <= EXACT:
        exact = shapley(values)
        return exact, np.zeros_like(exact)
    row = {subset: k for k, subset in enumerate(subsets_of(count))}
    added = np.zeros((2 * PAIRS_OF_ORDERS, count, *values.shape[1:]))
    for k, order in enumerate(orders_of(count)):
        added[k, list(order)] = np.diff(
            values[[row[subset] for subset in joined_by(order)]], axis=0
        )
    pairs = 0.5 * (added[::2] + added[1::2])
    return pairs.mean(axis=0), pairs.std(axis=0, ddof=1) / math.sqrt(PAIRS_OF_ORDERS)
