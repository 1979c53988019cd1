"""A problem of least squares with its nuisances integrated out.

Whitened residuals z are linear in the nuisances nu about one place, each nuisance with a unit
normal prior about 0. Integrated out, they leave a normal distribution of covariance C = I + J J'.
One multiplication by C^(-1/2) makes independent numbers of unit variance of the residuals again,
and what remains is a small bounded problem in the fields of a few effects.
"""

from __future__ import annotations

from hashlib import blake2b
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray
    from scipy.sparse import csr_array

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.fit.suspects import Suspects
    from winchcascade.rig.effects.effect import ActiveEffect

HUBER = 3.0
"""Whitened residuals beyond this count by their magnitude, not by their square (Huber 1964)."""

WILD = 1e6
"""A whitened residual is no larger than this, and so is one of numbers with which nothing can be
simulated.
"""

IDLE = 1e-12
"""A direction in which all nuisances together move less than this share of the squares of the
first moves nothing. [1]
"""

ROUNDS, SETTLED = 100, 1e-2
"""Maximum number of steps to the best nuisances, and the improvement of the objective below
which they are found.
"""


def huber(z: Signal) -> float:
    """Robust half sum of squares of whitened residuals. [1]"""
    size = np.abs(z)
    return float(np.sum(np.where(size <= HUBER, 0.5 * size * size, HUBER * (size - 0.5 * HUBER))))


def weights(z: Signal) -> Signal:
    """Weights with which least squares follow `huber`, (n,)."""
    return np.asarray(HUBER / np.maximum(np.abs(z), HUBER))


class Columns(NamedTuple):
    """Derivative of a prediction, whitened, over nuisances: `dense` (n, k), then `local` (n, q)
    of those of few rows.
    """

    dense: Signal
    local: csr_array

    def __matmul__(self, step: Signal) -> Signal:
        """What a step of the nuisances moves, (n, ...) from (k + q, ...)."""
        first = self.dense.shape[1]
        return np.asarray(self.dense @ step[:first] + self.local @ step[first:])

    def onto(self, rows: Signal) -> Signal:
        """The columns times rows, (k + q, ...) from (n, ...)."""
        return np.concatenate((self.dense.T @ rows, self.local.T @ rows))

    def squared(self) -> Signal:
        """The columns times each other, (k + q, k + q)."""
        across = self.local.T @ self.dense
        return np.block(
            [[self.dense.T @ self.dense, across.T], [across, (self.local.T @ self.local).toarray()]]
        )

    def usable(self) -> Columns:
        """The columns without those of nuisances with which nothing can be simulated: they move
        nothing.
        """
        fine = np.all(np.abs(self.dense) < WILD, axis=0)
        return self if fine.all() else Columns(np.where(fine, self.dense, 0.0), self.local)

    def masked(self, rows: Signal) -> Columns:
        """The columns with each row times a weight, (n,)."""
        return Columns(self.dense * rows[:, None], self.local.multiply(rows[:, None]).tocsr())


Together = tuple[frozenset[str], ...]
"""Suspects by the number that each changes, where residuals show these numbers only together."""


def are_together(exclusive: Sequence[Together], one: str, other: str) -> bool:
    """Whether two suspects change the two numbers of which the residuals know one combination
    alone.
    """
    pairs = (groups for groups in exclusive if len(groups) == 2)
    return any(all({one, other} & group for group in groups) for groups in pairs)


class Problem(Protocol):
    """Measured numbers that effects may explain."""

    @property
    def suspects(self) -> Suspects:
        """Effects by name that may be named."""

    @property
    def groups(self) -> NDArray[np.intp]:
        """Number of the group of each residual, (n,): residuals of one group are not
        independent.
        """

    @property
    def begins(self) -> Mapping[str, Sequence[float]]:
        """Values of the only field of some suspects from which a fit may begin, far from where
        they are absent.
        """

    @property
    def exclusive(self) -> Sequence[Together]:
        """Groups of suspects of which no set holds one of each: the residuals know them together
        alone.
        """

    def price(self, name: str) -> float:
        """Logarithm of the prior odds against a suspect [1]."""

    @property
    def nuisances(self) -> int:
        """Number of the nuisances."""

    def residuals(
        self,
        several: Sequence[Sequence[ActiveEffect]],
        nu: Signal,
        near: Sequence[ActiveEffect] | None = None,
        serves: float = 0.0,
    ) -> Signal:
        """Measured minus predicted with each of several lists of effects and some nuisances,
        whitened, (n, k).

        Parameters
        ----------
        near : effects that each list differs from by a small change, so that it may follow a
            derivative
        serves : share of the way from another place that its derivatives may miss [1]
        """

    def nuisance_columns(self, effects: Sequence[ActiveEffect], nu: Signal) -> Columns:
        """Whitened derivative of the prediction over the nuisances, in units of their tolerance."""


class Marginal:
    """The nuisances of a problem, integrated out; `information` (q, q) is what the residuals tell
    of them.

    Parameters
    ----------
    place : nuisances about which residuals are linear, in units of their tolerance
    columns : whitened derivative of the prediction over the nuisances there
    """

    def __init__(self, place: Signal, columns: Columns) -> None:
        columns = columns.usable()
        self.place, self.columns, self._moved = place, columns, columns @ place
        self.information = columns.squared()
        square, ways = np.linalg.eigh(self.information)
        keep = (
            square > IDLE * max(float(square[-1]), 1e-300)
            if square.size
            else np.zeros(0, dtype=bool)
        )
        self._square, self._ways = square, ways = square[keep], ways[:, keep]
        self._shrink = (ways * ((1.0 - 1.0 / np.sqrt(1.0 + square)) / square)) @ ways.T
        self._stretch = (ways * ((np.sqrt(1.0 + square) - 1.0) / square)) @ ways.T
        self.spread = self.spread_in()
        self._masked: dict[bytes, Marginal] = {}

    def spread_in(self, scale: float = 1.0) -> Signal:
        """Covariance of the nuisances where nothing else is open, (q, q).

        Parameters
        ----------
        scale : square by which the noise exceeds its estimate
        """
        return np.asarray(
            np.eye(self._ways.shape[0])
            - (self._ways * (self._square / (scale + self._square))) @ self._ways.T
        )

    def __call__(self, z: Signal) -> Signal:
        """Residuals, (n, ...), as independent numbers of unit variance, nuisances included:
        C^(-1/2) z.
        """
        return np.asarray(z - self.columns @ (self._shrink @ self.columns.onto(z)))

    def centred(self, z: Signal) -> Signal:
        """Residuals at the place, (n, ...), as they are for nuisances of 0, which the prior is
        centred at.
        """
        return np.asarray(z + self._moved.reshape(-1, *(1,) * (z.ndim - 1)))

    def undone(self, r: Signal) -> Signal:
        """The inverse, C^(1/2) r, (n, ...)."""
        return np.asarray(r + self.columns @ (self._stretch @ self.columns.onto(r)))

    def best(self, z: Signal, begin: Signal | None = None) -> tuple[Signal, Signal]:
        """Nuisances that explain whitened residuals best, and what they leave: each step descends.

        Parameters
        ----------
        begin : nuisances to start from, 0 by default
        """
        nu = np.zeros(self.spread.shape[0]) if begin is None else begin
        left, loss = z - self.columns @ nu, np.inf
        for _ in range(ROUNDS):
            now = huber(left) + 0.5 * float(nu @ nu)
            if loss - now < SETTLED:
                break
            loss = now
            nu = nu + self.spread @ (self.columns.onto(weights(left) * left) - nu)
            left = z - self.columns @ nu
        return nu, left

    def masked(self, rows: Signal) -> Marginal:
        """The same with each row times a weight, (n,); 0 for what takes no part. It is kept:
        many sets are held out alike.
        """
        if np.all(rows == 1.0):
            return self
        which = blake2b(rows.tobytes()).digest()
        if which not in self._masked:
            self._masked[which] = Marginal(self.place, self.columns.masked(rows))
        return self._masked[which]
