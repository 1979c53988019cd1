"""The logs of a rig as a problem of least squares in the fields of its suspects."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.fit.entries import price_of
from winchcascade.diagnosis.fit.marginal import WILD, Columns, Together, huber
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.fit.suspects import with_values
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

    `exclusive` are suspects that change numbers which the logs know together alone. A fit takes
    own derivatives at each of its places.
    """

    data: Fitted
    suspects: Suspects
    exclusive: tuple[Together, ...] = ()

    @property
    def groups(self) -> NDArray[np.intp]:
        """Number of the stretch of one phase of a cycle that each residual belongs to, (M * 5,)."""
        return np.repeat(np.cumsum(~self.data.blocks.joined) - 1, len(CHANNELS))

    @property
    def begins(self) -> dict[str, tuple[float, ...]]:
        """Usual multiples of wrong entries, and simplifications as a whole, with which the logs of
        the smallest and the largest resistance deviate less than with none.
        """
        usual = {name: effect.fields[0].usual for name, effect in self.suspects.items()}
        usual |= {name: (1.0,) for name in self.suspects if name in SIMPLIFICATIONS}
        begins = [(name, value) for name, values in usual.items() for value in values]
        effects = [[with_values(self.suspects[name], np.array([x]))] for name, x in begins]
        data, nothing = self.data, np.zeros(self.nuisances)
        few = data.extreme_loads
        rows = np.concatenate([np.arange(data.measured.shape[0])[data.rows[k]] for k in few])
        gap = np.zeros((*data.measured.shape, len(begins) + 1))
        predicted = data.predictions([(nothing, own) for own in ([], *effects)], few)
        gap[rows] = data.measured[rows, :, None] - predicted
        given, *sizes = (huber(z) for z in self._whitened(gap).T)
        lower = [one for one, size in zip(begins, sizes, strict=True) if size < given]
        return {name: tuple(x for other, x in lower if other == name) for name, _ in lower}

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
        serves: float = 0.0,
    ) -> Signal:
        """Measured minus predicted blocks with each of several lists of effects, whitened, (M *
        5, k).
        """
        data, variants = self.data, [(nu, effects) for effects in several]
        if near is None:
            return self._whitened(data.measured[:, :, None] - data.predictions(variants))
        predicted = data.predictions_near((nu, near), variants, serves)
        return self._whitened(data.measured[:, :, None] - predicted)

    def _whitened(self, gap: Signal) -> Signal:
        """Blocks, (M, 5, k), as residuals; `WILD` where nothing can be simulated."""
        return np.clip(np.nan_to_num(self.data.whiten(gap), nan=WILD), -WILD, WILD)

    def nuisance_columns(self, effects: Sequence[ActiveEffect], nu: Signal) -> Columns:
        """Whitened derivative of the prediction over the nuisances."""
        return self.data.columns(nu, effects, serves=0.0)
