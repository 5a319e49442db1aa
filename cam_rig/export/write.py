"""A run's samples into a file: the kind goes by the file's ending."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from cam_rig.errors import ConfigError
from cam_rig.export import csv_file, npz_file, parquet_file, wav_file
from cam_rig.export.columns import Chunk, Contents, chunks
from cam_rig.extras import require
from cam_rig.files import writing
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.simulation.tick_samples import TickSamples
from cam_rig.units import to_rpm

#: Writers by ending: path, rows, what the run was, samples a second.
FORMATS: dict[str, Callable[[Path, Iterable[Chunk], dict[str, str], int], None]] = {
    ".parquet": parquet_file.write,
    ".csv": csv_file.write,
    ".npz": npz_file.write,
    ".wav": wav_file.write,
}


def require_format(path: Path) -> None:
    """Refuse a file of which nobody knows how to write it.

    Raises
    ------
    ConfigError : its ending is none of `FORMATS`
    MissingLibraryError : pyarrow, for .parquet, is not installed
    """
    if path.suffix.lower() not in FORMATS:
        raise ConfigError(f"{path}: unknown kind of file; allowed: {', '.join(FORMATS)}")
    if path.suffix.lower() == ".parquet":
        require("pyarrow")


def export(
    path: Path,
    ticks: Iterable[TickSamples],
    loaded: LoadedScene,
    cam: str | None = None,
    rpm: float | None = None,
) -> Contents:
    """Write the samples of a run, in bounded memory, whole or not at all.

    Parameters
    ----------
    path : .parquet, .csv, .npz, or .wav (one channel each quantity, no gaps)
    ticks : of the run, in order
    loaded : the scene that was run
    cam, rpm : only this cam, only this held speed; None for all, ramps included

    Raises
    ------
    ConfigError : an unknown kind of file, or no such cam at such a speed
    OutputError : the place cannot be written, or the file cannot hold the run
    MissingLibraryError : pyarrow, for .parquet, is not installed
    """
    require_format(path)
    rate = int(loaded.scene.sample_rate.si)
    contents, scene = Contents(rate), loaded.scene
    about = {"scene": scene.name, "model": scene.model, "rig": loaded.rig.name}
    rows = contents.follow(chunks(_chosen(ticks, cam, rpm, contents.there)))
    with writing(path) as part:
        FORMATS[path.suffix.lower()](part, rows, about, rate)
        if not contents.rows:
            wanted = f"{cam or 'a cam'} at {'a speed' if rpm is None else f'{rpm:g} rpm'}"
            there = ", ".join(contents.there) or "a run with ticks"
            raise ConfigError(f"{path}: no samples of {wanted}; allowed: {there}")
    return contents


def _chosen(
    ticks: Iterable[TickSamples], cam: str | None, rpm: float | None, there: dict[str, None]
) -> Iterator[TickSamples]:
    """The ticks of a cam and a speed; ``there`` takes note of what else there is."""
    for tick in ticks:
        if tick.is_of(cam, rpm):
            yield tick
        elif tick.steady:
            there[f"{tick.cam} at {to_rpm(tick.start.speed):g} rpm"] = None
