"""The dataset of a campaign: a folder of Parquet files, one a batch, whole at every moment.

A file has its name only when all of it is on the disk, so readers take ``folder/*.parquet`` while
a campaign runs, and after whatever ended it. The one writer holds a lock on the folder.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.errors import ConfigError, OutputError
from cam_rig.extras import libraries_named
from cam_rig.studies.campaign.campaign import Campaign
from cam_rig.studies.campaign.point import FAILED, OK, BatchRows
from cam_rig.tables import counted

LOCK = ".lock"
_NAME = re.compile(r"points-(\d+)-(\d+)\.parquet")
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
#: Packages whose versions rows may depend on.
VERSIONS = ("cam_rig", "numpy", "scipy")
#: Differences between two studies that are named.
DIFFERENCES = 3


@dataclass(frozen=True, eq=False)
class CampaignDataset:
    """The rows of a study in a folder.

    Columns: ``point``, ``seed``, ``version`` of cam_rig, the inputs (SI), the measures (their
    unit is in the schema; null where a point has none), ``status`` and ``reason``. The schema also
    holds the study as JSON, its fingerprint, and the versions rows may depend on.
    """

    folder: Path
    campaign: Campaign

    @cached_property
    def schema(self) -> Any:
        """Of every file, a `pyarrow.Schema`."""
        with libraries_named():
            import pyarrow as pa

        def field(name: str, kind: Any, unit: str, meaning: str, nullable: bool = False) -> Any:
            about = {"unit": unit, "meaning": meaning}
            return pa.field(name, kind, nullable=nullable, metadata=about)

        word = pa.dictionary(pa.int32(), pa.string())
        fields = [
            field("point", pa.int64(), "1", "index in the plan"),
            field("seed", pa.int64(), "1", "of the plan"),
            field("version", word, "", "of cam_rig"),
        ]
        for one in self.campaign.inputs:
            fields.append(field(one.column, pa.float64(), one.si_unit, one.path))
        for measure in self.campaign.measures:
            words = measure.term.words
            fields.append(field(measure.column, pa.float64(), measure.unit, words, True))
        fields.append(field("status", word, "", f"{OK} or {FAILED}"))
        fields.append(field("reason", pa.string(), "", "what failed and why", True))
        about = {"study": self.campaign.text, "fingerprint": self.campaign.fingerprint}
        return pa.schema(fields, metadata={**about, **versions()})

    def write(self, rows: BatchRows) -> None:
        """Put a batch onto the disk, whole or not at all.

        Raises
        ------
        OutputError : the disk is full, or the folder cannot be written
        """
        import pyarrow.parquet as pq

        target = self.folder / f"points-{rows.first:010d}-{rows.last:010d}.parquet"
        part = target.with_name(f".{target.name}.part")
        try:
            try:
                pq.write_table(self._table(rows), part)
                _to_disk(part)
                part.replace(target)
                _to_disk(self.folder)
            finally:
                part.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(
                f"{target}: cannot be written ({error.strerror or error}); what is finished stays"
            ) from None

    def _table(self, rows: BatchRows) -> Any:
        import pyarrow as pa

        count = len(rows.reasons)
        seed, own = np.full(count, self.campaign.seed), versions()["cam_rig"]
        columns = [
            pa.array(np.arange(rows.first, rows.last)),
            pa.array(seed),
            pa.array([own] * count).dictionary_encode(),
            *(pa.array(column) for column in rows.inputs.T),
            *(pa.array(column, mask=np.isnan(column)) for column in rows.measures.T),
            pa.array([FAILED if text else OK for text in rows.reasons]).dictionary_encode(),
            pa.array([text or None for text in rows.reasons], pa.string()),
        ]
        return pa.Table.from_arrays(columns, schema=self.schema)

    def batches(self) -> list[tuple[int, int, Path]]:
        """First point, the point after the last, and the file of each batch, in order."""
        found = []
        for path in self.folder.glob("points-*.parquet"):
            if match := _NAME.fullmatch(path.name):
                found.append((int(match[1]), int(match[2]), path))
        return sorted(found)

    def missing(self) -> list[tuple[int, int]]:
        """The ranges of points that are in no file, in order."""
        gaps, at = [], 0
        for first, last, _ in self.batches():
            if first > at:
                gaps.append((at, first))
            at = max(at, last)
        if at < self.campaign.total:
            gaps.append((at, self.campaign.total))
        return gaps

    def size(self) -> tuple[float, float]:
        """Bytes of the files there are, and about those of all when every point is made.

        A file has bytes of its own, as many as the smallest, and others for each row; the files
        to come are as long as the longest.
        """
        batches = self.batches()
        if not batches:
            return 0.0, 0.0
        sizes = [path.stat().st_size for _, _, path in batches]
        counts = [last - first for first, last, _ in batches]
        own, made = min(sizes), sum(counts)
        left = max(0, self.campaign.total - made)
        row = (sum(sizes) - own * len(sizes)) / made
        return float(sum(sizes)), sum(sizes) + row * left + own * -(-left // max(counts))

    def column(self, name: str) -> FloatArray:
        """One column in the order of the points, NaN for null; no other column is read."""
        import pyarrow.parquet as pq

        parts = [
            pq.read_table(path, columns=[name], partitioning=None).column(name).to_numpy()
            for _, _, path in self.batches()
        ]
        return np.concatenate(parts) if parts else np.zeros(0)

    def reasons(self) -> list[tuple[str, int]]:
        """Why points failed and how many, the most frequent first.

        Reasons that differ in their numbers alone are one, in the words of the first of them.
        """
        import pyarrow.compute as pc
        import pyarrow.parquet as pq

        counts: Counter[str] = Counter()
        words: dict[str, str] = {}
        for _, _, path in self.batches():
            column = pq.read_table(path, columns=["reason"], partitioning=None).column("reason")
            for one in pc.value_counts(column.drop_null()).to_pylist():
                kind = _NUMBER.sub("#", one["values"])
                words.setdefault(kind, one["values"])
                counts[kind] += one["counts"]
        return [(words[kind], count) for kind, count in counts.most_common()]

    @contextmanager
    def opened(self, resume: bool) -> Iterator[None]:
        """Hold the folder for one writer; what a killed one left half written is removed.

        Raises
        ------
        ConfigError : it holds rows and is not to be resumed, or rows of another study
        OutputError : it cannot be written, or another process writes into it
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(self.folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise OutputError(f"{self.folder}: cannot be written ({error.strerror})") from None
        with os.fdopen(descriptor, "r+b") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise OutputError(
                    f"{self.folder}: another campaign writes into it; allowed: to wait for its "
                    "end, or another folder"
                ) from None
            self._require_own(resume)
            for path in self.folder.glob(".points-*.part"):
                path.unlink()
            yield

    def _require_own(self, resume: bool) -> None:
        """Refuse a folder of other rows; a damaged file's points are made again."""
        batches = self.batches()
        if batches and not resume:
            raise ConfigError(
                f"{self.folder}: holds {counted(len(batches), 'file')} of points already; "
                "allowed: --resume to go on with them, or another folder"
            )
        for first, last, path in batches:
            about = _about(path)
            if about is None or about[0] != last - first:
                path.unlink()
            elif about[1] != self._own:
                raise ConfigError(
                    f"{path}: is of another study, or of another version: "
                    f"{differences(about[1], self._own)}; allowed with --resume: the same, else "
                    "another folder"
                )

    @property
    def _own(self) -> dict[str, str]:
        return {"study": self.campaign.text, **versions()}


def differences(old: Mapping[str, str], new: Mapping[str, str]) -> str:
    """What differs between two origins of rows, with the old and the new value of each."""
    before, after = ({**_leaves(json.loads(one.get("study") or "{}"))} for one in (old, new))
    for name in VERSIONS:
        before[name], after[name] = old.get(name), new.get(name)
    found = [
        f"{key} is {_shown(after.get(key))}, was {_shown(before.get(key))}"
        for key in dict.fromkeys([*before, *after])
        if before.get(key) != after.get(key)
    ]
    rest = len(found) - DIFFERENCES
    return ", ".join(found[:DIFFERENCES]) + (f" and {rest} more" if rest > 0 else "")


def _leaves(node: Any, path: str = "") -> dict[str, Any]:
    """The numbers and words of plain data by their paths; those of the study without a prefix."""
    if isinstance(node, dict):
        parts = [(f"{path}.{key}" if path else key, one) for key, one in node.items()]
    elif isinstance(node, list):
        parts = [(f"{path}[{i}]", one) for i, one in enumerate(node)]
    else:
        return {path.removeprefix("config."): node}
    return {key: value for name, one in parts for key, value in _leaves(one, name).items()}


def _shown(value: object) -> str:
    return "not there" if value is None else str(value)


def _about(path: Path) -> tuple[int, dict[str, str]] | None:
    """Rows of a file and what its schema says of their origin; None where it is damaged."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        footer = pq.read_metadata(path)
        data = footer.metadata or {}
    except (pa.ArrowInvalid, OSError):
        return None
    keys = ("study", *VERSIONS)
    return footer.num_rows, {key: data.get(key.encode(), b"").decode() for key in keys}


def versions() -> dict[str, str]:
    """Versions of what rows may depend on."""
    found = {}
    for name in VERSIONS:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def _to_disk(path: Path) -> None:
    """Wait until a file or a folder's names are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
