"""A campaign run: batches of points to an executor, their rows to the dataset as they come."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from cam_rig.arguments import checked
from cam_rig.datasets.batches import InThisProcess, compute_missing
from cam_rig.extras import require
from cam_rig.schema.load import Library, config_root, named_path
from cam_rig.studies.campaign.campaign import Campaign, campaign_from, measure_batch, open_campaign
from cam_rig.studies.campaign.dataset import CampaignDataset
from cam_rig.studies.campaign.results import CampaignResult


def opened(study: str | Path | Mapping[str, Any]) -> Campaign:
    """A study by its name in ``config/campaigns``, a path, or what such a file holds."""
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
) -> CampaignResult:
    """Measure many rigs that differ in some numbers; rows go into a folder of Parquet files.

    The command is ``cam-rig campaign``.

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
        compute_missing(dataset, measure_batch, executor or InThisProcess(), max(1, workers))
    return CampaignResult(dataset)
