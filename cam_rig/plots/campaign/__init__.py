"""Pictures of a campaign: a map of a grid; distributions, and what each input does, of draws."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from cam_rig.plots.campaign.distributions import distributions
from cam_rig.plots.campaign.map import measure_map, varied
from cam_rig.plots.figures import write
from cam_rig.studies.campaign.results import CampaignResults


def draw(results: CampaignResults, path: Path) -> None:
    """Write the figure to a file, of any kind that matplotlib knows by the suffix."""
    write(figure(results), path)


def figure(results: CampaignResults) -> Figure:
    """A map where a grid varies two inputs or more, else distributions."""
    grid = results.campaign.config.plan.kind == "grid"
    if grid and len(varied(results)) > 1:
        return measure_map(results)
    return distributions(results)
