"""Permanent-magnet generator, diodes, DC link and load."""

from __future__ import annotations

import msgspec

ROLLOFF_KNOTS = (0.0, 4.0, 5.0, 6.0, 7.0, 9.0, 11.0, 14.0, 20.0)
"""Stator currents, rms, at which the back-EMF constant's roll-off is given, closest about the rated 5.16 A where it begins; a
monotone cubic between them, constant beyond. [A]"""

NO_ROLLOFF = (1.0,) * (len(ROLLOFF_KNOTS) - 1)
"""All of the back-EMF constant is left at every current."""


class Generator(msgspec.Struct, frozen=True):
    """Machine of constant parameters: `pole_pairs`, back-EMF `k_e` line to line, rms [V/rpm], `r_s` [ohm] and `l_s` [H] of a
    phase, and the drop of each of the two conducting diodes `v_diode` [V].

    Absent by default: `rolloff`, what is left of k_e at the stator currents of `ROLLOFF_KNOTS` beyond the first [1].
    """

    pole_pairs: float
    k_e: float
    r_s: float
    l_s: float
    v_diode: float
    rolloff: tuple[float, ...] = NO_ROLLOFF


class DcLink(msgspec.Struct, frozen=True):
    """Capacitor [F], and the resistance that bleeds it where no load is connected [ohm].

    `load_change` is the relative deviation of a load from its nominal value, absent by default [1].
    """

    c_dc: float
    r_bleed: float
    load_change: float = 0.0
