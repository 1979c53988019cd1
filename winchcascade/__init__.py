"""From the log of a winch-driven power take-off to energies and efficiencies that can be defended.

>>> from winchcascade import read_run, reduce
>>> round(reduce(read_run("fixtures/campaign/r36ohm.csv"), window=5.48).mean.eta_trans, 2)
0.9
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from winchcascade.cascade.reduce import Reduction, reduce
    from winchcascade.ingest.read import read_run
    from winchcascade.rigfile import Rig
    from winchcascade.rigtoml import load_rig
    from winchcascade.run import Finding, Run

__version__ = "0.1.0"

__all__ = ["Finding", "Reduction", "Rig", "Run", "__version__", "load_rig", "read_run", "reduce"]

_HOME = {
    "Finding": "winchcascade.run",
    "Reduction": "winchcascade.cascade.reduce",
    "Rig": "winchcascade.rigfile",
    "Run": "winchcascade.run",
    "load_rig": "winchcascade.rigtoml",
    "read_run": "winchcascade.ingest.read",
    "reduce": "winchcascade.cascade.reduce",
}


def __getattr__(name: str) -> Any:
    """Import a public name where it is first used, so that `winchcascade --help` waits for none of them."""
    if name not in _HOME:
        raise AttributeError(f"module 'winchcascade' has no attribute {name!r}")
    import importlib

    return getattr(importlib.import_module(_HOME[name]), name)
