"""A campaign from Python: thousands of rigs that differ in some numbers, a row of each."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cam_rig.api.arguments import checked
from cam_rig.api.notebook import shown
from cam_rig.extras import libraries_named, require
from cam_rig.schema.load import Library, config_root, named_path
from cam_rig.studies.campaign.campaign import Campaign, campaign_from, open_campaign
from cam_rig.studies.campaign.dataset import CampaignDataset
from cam_rig.studies.campaign.results import CampaignResults
from cam_rig.studies.campaign.run import InThisProcess, run_campaign

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame


class CampaignRun(CampaignResults):
    """A finished campaign: ``quantiles(measure)``, ``yields()``, ``shares(measure)``."""

    def __repr__(self) -> str:
        """What, how many, and where."""
        return f"CampaignRun({self.campaign.config.name}: {self.points} points)"

    def to_pandas(self) -> DataFrame:
        """A row each point in the order of the plan, as in the dataset.

        Raises
        ------
        MissingLibraryError : pandas is not installed
        OutputError : a file is not as it was written
        """
        with libraries_named():
            from pandas import concat
        return concat([table.to_pandas() for table in self.dataset.tables()], ignore_index=True)

    def plot(self) -> Figure:
        """A map of a grid of two inputs or more; else distributions and what each input does.

        Raises
        ------
        MissingLibraryError : matplotlib is not installed
        """
        with libraries_named():
            from cam_rig.plots.campaign import figure
        return shown(figure(self))


def opened(study: str | Path | Mapping[str, Any]) -> Campaign:
    """A study by its name in ``config/campaigns``, a path, or what such a file holds.

    Raises
    ------
    ConfigError, LawError : something wrong in the study
    """
    if isinstance(study, Mapping):
        return campaign_from(study, Library((config_root(),)))
    return open_campaign(named_path("campaigns", study))


@checked
def campaign(
    study: str | Path | Mapping[str, Any],
    out: str | Path,
    *,
    points: int | None = None,
    seed: int | None = None,
    resume: bool = False,
    executor: Executor | None = None,
    workers: int = 1,
) -> CampaignRun:
    """Measure many rigs that differ in some numbers; rows go into a folder of Parquet files.

    Parameters
    ----------
    study : a name in ``config/campaigns``, a path, or what such a file holds
    out : folder of the dataset
    points, seed : in place of the study's
    resume : go on with the points that the folder has not; a file that is not as it was written
        is named in a warning, and its points are made again
    executor : where points are measured: a `ProcessPoolExecutor`, Dask's
        ``client.get_executor()``; None is this process. Rows are the same
    workers : batches the executor takes at a time

    Raises
    ------
    ConfigError : something wrong in the study, or a folder of other rows
    OutputError : the folder cannot be written
    RunError : the executor broke down; what is finished stays
    MissingLibraryError : pyarrow is not installed

    Examples
    --------
    >>> import tempfile, cam_rig
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     found = cam_rig.campaign("tolerance_poly345", folder, points=8)
    ...     found.to_pandas().jump_speed_rpm.round(1).tolist()[:3]
    [173.8, 416.3, 274.9]
    """
    require("pyarrow")
    dataset = CampaignDataset(Path(out), opened(study).planned(points, seed))
    with dataset.opened(resume) as damaged:
        if damaged:
            warnings.warn(damaged, stacklevel=2)
        run_campaign(dataset, executor or InThisProcess(), max(1, workers))
    return CampaignRun(dataset)
