"""The logs of a rig as a problem of least squares in the fields of its suspects."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.fit.entries import price_of
from winchcascade.diagnosis.fit.marginal import WILD, Columns, Together
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.rig.effects.catalogue import SIMPLIFICATIONS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.fit.suspects import Suspects
    from winchcascade.rig.effects.effect import ActiveEffect


class RigProblem(msgspec.Struct, frozen=True):
    """The logs of a rig as a `Problem`: which effects explain what the model of the rig file
    leaves.

    `rows` (M * 5,) are weights of the residuals, 0 for what takes no part; None for all.
    `exclusive` are suspects that change numbers which the logs know together alone.
    """

    data: Fitted
    suspects: Suspects
    rows: Signal | None = None
    exclusive: tuple[Together, ...] = ()

    @property
    def groups(self) -> NDArray[np.intp]:
        """Number of the stretch of one phase of a cycle that each residual belongs to, (M * 5,)."""
        return np.repeat(np.cumsum(~self.data.blocks.joined) - 1, len(CHANNELS))

    @property
    def begins(self) -> dict[str, tuple[float, ...]]:
        """Usual multiples of wrong entries, and simplifications as a whole."""
        usual = {name: effect.fields[0].usual for name, effect in self.suspects.items()}
        return usual | {name: (1.0,) for name in self.suspects if name in SIMPLIFICATIONS}

    def price(self, name: str) -> float:
        """Logarithm of the prior odds against a suspect [1]."""
        return price_of(name)

    @property
    def nuisances(self) -> int:
        """Number of the nuisances."""
        return len(self.data.nuisances)

    def residuals(
        self,
        several: Sequence[Sequence[ActiveEffect]],
        nu: Signal,
        near: Sequence[ActiveEffect] | None = None,
    ) -> Signal:
        """Measured minus predicted blocks with each of several lists of effects, whitened, (M *
        5, k).
        """
        data, variants = self.data, [(nu, effects) for effects in several]
        predicted = (
            data.predictions(variants)
            if near is None
            else data.predictions_near((nu, near), variants)
        )
        z = data.whiten(data.measured[:, :, None] - predicted)
        z = np.clip(np.nan_to_num(z, nan=WILD), -WILD, WILD)
        return z if self.rows is None else z * self.rows[:, None]

    def nuisance_columns(self, effects: Sequence[ActiveEffect], nu: Signal) -> Columns:
        """Whitened derivative of the prediction over the nuisances."""
        columns = self.data.columns(nu, effects)
        return columns if self.rows is None else columns.masked(self.rows)
