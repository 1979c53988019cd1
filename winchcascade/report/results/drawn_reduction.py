"""The report of a log with its figures, its simulation and its loss map, for page, PDF and
files.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from winchcascade.diagnosis.explain.model_comparison import Account, modelled
from winchcascade.diagnosis.stages.stage_map import LossMap
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.uncertainty import Uncertainty, uncertainty
from winchcascade.reduction.wave_energies import waves_of
from winchcascade.report.content import Picture, Report, picture
from winchcascade.report.figures import reduction_figures as figures
from winchcascade.report.figures.histories import powers_of
from winchcascade.report.figures.style import house_style
from winchcascade.report.results.common import histories
from winchcascade.report.results.loss_map_report import loss_map_pictures, loss_map_section
from winchcascade.report.results.model_section import run_section
from winchcascade.report.results.reduction import reduction_report, stated_text
from winchcascade.report.results.waves import wave_picture
from winchcascade.report.wording import span_word

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@house_style()
def drawn_report(
    reduction: Reduction,
    found: Uncertainty | None = None,
    mapped: LossMap | None = None,
    *,
    model: Account | None = None,
    command: str = "",
) -> Report:
    """Report of a reduction with its figures.

    Parameters
    ----------
    found : uncertainty of the reduction; made here if not given
    mapped : loss map that the report shows too
    model : what is kept of the log beside its simulation; simulated here with the numbers of the
        rig file if not given
    """
    waves, found = waves_of(reduction), found or uncertainty(reduction)
    drawn = _pictures(reduction, found)
    if waves is not None:
        drawn["wave-energies"] = wave_picture(waves, reduction.rig.cascade)
    more = {
        "histories": histories(reduction),
        "model": run_section(reduction.run, model or modelled(reduction)),
    }
    if mapped is not None:
        more["loss-map"] = loss_map_section(mapped, loss_map_pictures(mapped))
    return reduction_report(reduction, found, waves=waves, drawn=drawn, more=more, command=command)


def _pictures(reduction: Reduction, found: Uncertainty) -> dict[str, Picture | None]:
    """Figures of a reduction by their names."""
    powers, repeats = powers_of(reduction), reduction.rig.phases.repeats
    means = {
        m: stated_text(reduction, found, m)
        for m, mean in reduction.mean.items()
        if mean is not None
    }
    best, worst = (c.cycle for c in reduction.extremes[:2]) if reduction.extremes else (None, None)
    over_speed = (
        f"; right: of all complete {span_word(reduction)}s, with means in bins"
        if reduction.bins
        else ""
    )
    made: dict[str, tuple[Figure | None, str, str]] = {
        "flow": (
            figures.window_flow(reduction, means),
            f"Where the energy goes in the window, {'mean of the' if repeats else 'all'} complete "
            f"cycles.",
            "Flow diagram of the energies, which are in the table.",
        ),
        "streams": (
            figures.power_streams(reduction, powers),
            f"Powers of a cycle; dashed: integration window{over_speed}.",
            "Line plot of the powers over time, and dots with binned means over generator speed.",
        ),
        "overlaid": (
            figures.overlaid(reduction, powers, best, worst) if repeats else None,
            "Cycles from their onsets on; dashed: end of the window.",
            "Line plots of the cycles laid over each other.",
        ),
        "trend": (
            figures.trend(reduction),
            "Complete cycles one after the other.",
            "Dots of the efficiencies and energies over the number of the cycle; the values are "
            "in the tables.",
        ),
    }
    return {name: picture(figure, name, *words) for name, (figure, *words) in made.items()}
