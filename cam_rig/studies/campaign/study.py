"""Python function that measures the points of a campaign and stores the rows."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from cam_rig.arguments import check_arguments
from cam_rig.datasets.batches import SerialExecutor, compute_missing
from cam_rig.extras import require
from cam_rig.schema.load import Library, config_root, resolve_path
from cam_rig.studies.campaign.campaign import Campaign, batch_task, campaign_from, open_campaign
from cam_rig.studies.campaign.dataset import CampaignDataset
from cam_rig.studies.campaign.results import CampaignResult


def load_study(study: str | Path | Mapping[str, Any]) -> Campaign:
    """Return a campaign from a name, a path or plain data.

    A name is that of a file in ``config/campaigns``. Plain data have the structure of a campaign
    file.
    """
    if isinstance(study, Mapping):
        return campaign_from(study, Library((config_root(),)))
    return open_campaign(resolve_path("campaigns", study))


@check_arguments
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
    """Measure many rigs that differ in some numbers, and store one row per rig.

    The command is ``cam-rig campaign``. Rows are stored in a folder of Parquet files.

    Parameters
    ----------
    study : str, Path or mapping
        Name in ``config/campaigns``, path of a campaign file, or its content.
    out : str or Path
        Folder of the dataset.
    points : int, optional
        Number of points, which are combinations of input values (default: that of the campaign).
    seed : int, optional
        Seed of the random numbers (default: that of the campaign).
    resume : bool, optional
        Compute only the points that the folder does not contain (default: False). A warning names
        damaged files, whose points are computed again.
    executor : Executor, optional
        Executor that measures the points, such as a `ProcessPoolExecutor` or Dask's
        ``client.get_executor()`` (default: this process). Rows do not depend on it.
    workers : int, optional
        Number of batches that the executor processes at a time (default: 1).

    Returns
    -------
    CampaignResult
        Rows of the campaign, with quantiles, yields and variance shares.

    Raises
    ------
    ConfigError
        If the campaign is invalid, or the folder has rows of another campaign, or any rows without
        ``resume``.
    OutputError
        If the folder cannot be written.
    RunError
        If the executor fails. Finished rows are kept.
    MissingLibraryError
        If pyarrow is not installed.

    Examples
    --------
    >>> import tempfile, cam_rig
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     result = cam_rig.campaign("tolerance_poly345", folder, points=8)
    ...     result.to_pandas().jump_speed_rpm.round(1).tolist()[:3]
    [173.8, 416.3, 274.9]
    """
    require("pyarrow")
    dataset = CampaignDataset(Path(out), load_study(study).with_plan(points, seed))
    with dataset.open(resume) as damaged:
        if damaged:
            warnings.warn(damaged, stacklevel=2)
        compute_missing(dataset, batch_task, executor or SerialExecutor(), max(1, workers))
    return CampaignResult(dataset)
