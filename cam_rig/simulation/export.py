"""Export of the samples of a run to CSV, NumPy, Parquet and WAV files.

Rows are written in chunks, so memory does not grow with the length of the run.
"""

from __future__ import annotations

import shutil
import struct
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cam_rig.errors import ConfigError, OutputError
from cam_rig.extras import friendly_import_errors, require
from cam_rig.files import atomic_write, temporary_folder
from cam_rig.laws import Law
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.simulate import TickSamples
from cam_rig.units import FloatArray, to_rpm

#: Smallest number of rows that are written to a file together, except at the end. The samples of
#: one tick (time between two cam states) alone may be very few.
CHUNK_ROWS = 1 << 16
#: Name of the column with the cam's name. All other columns contain numbers.
CAM = "cam"


class ExportColumn(NamedTuple):
    """Column of numbers in an exported file."""

    name: str  #: contains the unit
    unit: str
    meaning: str
    values: Callable[[TickSamples, Law], FloatArray]  #: numbers of a tick, on the law of its cam


def _attribute(name: str) -> Callable[[TickSamples, Law], FloatArray]:
    """Return the function of a tick that returns one of its attributes."""
    return lambda tick, _: np.asarray(getattr(tick, name))


def _torque(tick: TickSamples, law: Law) -> FloatArray:
    """Return the torque F s′ (N·m) of the contact force on the cam."""
    return tick.force * law(tick.angle_in_turn, 1)


#: Columns of numbers of an exported file, in their order.
COLUMNS = (
    ExportColumn("time_s", "s", "rig time", _attribute("time")),
    ExportColumn("rpm", "rpm", "cam speed", _attribute("rpm")),
    ExportColumn("angle_rad", "rad", "cam angle θ with all its turns", _attribute("angle")),
    ExportColumn(
        "angle_in_turn_rad", "rad", "cam angle θ from 0 to 2π", _attribute("angle_in_turn")
    ),
    ExportColumn("lift_m", "m", "follower displacement", _attribute("lift")),
    ExportColumn("velocity_m_s", "m/s", "follower velocity", _attribute("velocity")),
    ExportColumn("acceleration_m_s2", "m/s²", "follower acceleration", _attribute("acceleration")),
    ExportColumn("force_N", "N", "contact force, 0 in flight", _attribute("force")),
    ExportColumn("impulse_N_s", "N·s", "landings since the sample before", _attribute("impulse")),
    ExportColumn("torque_N_m", "N·m", "torque F s' of the contact force on the cam", _torque),
)


@dataclass(frozen=True, eq=False)
class Chunk:
    """Successive rows of an exported file."""

    numbers: FloatArray  #: ``(k, n)``, one row per entry of `COLUMNS`
    cams: tuple[str, ...]  #: cam of each tick
    counts: tuple[int, ...]  #: number of rows of each tick

    @property
    def names(self) -> NDArray[np.str_]:
        """Name of the cam in each row, shape `(n,)`."""
        return np.repeat(np.array(self.cams), self.counts)


@dataclass
class Contents:
    """Summary of the exported samples, complete when the export is finished."""

    rate: int  #: sample rate, Hz
    rows: int = 0
    #: Number of interruptions of the exported samples: lost messages, a stopped cam, or a speed
    #: that was left out.
    gaps: int = 0
    start: float = 0.0  #: time of the first sample, s
    end: float = 0.0  #: time of the last sample, s
    #: Cams with their speeds in the run that were not selected for the export, as text, in order (a
    #: dict as an ordered set).
    available: dict[str, None] = field(default_factory=dict)

    def track(self, chunks: Iterable[Chunk]) -> Iterator[Chunk]:
        """Yield chunks of rows unchanged, and update the summary with each of them.

        A chunk is a series of successive rows of the exported file.
        """
        for chunk in chunks:
            number = np.rint(chunk.numbers[0] * self.rate)
            if not self.rows:
                self.start = float(chunk.numbers[0, 0])
            else:
                self.gaps += int(number[0] != np.rint(self.end * self.rate) + 1.0)
            self.gaps += int(np.count_nonzero(np.diff(number) != 1.0))
            self.rows += number.size
            self.end = float(chunk.numbers[0, -1])
            yield chunk


def chunks(ticks: Iterable[TickSamples], laws: Mapping[str, Law]) -> Iterator[Chunk]:
    """Join ticks to chunks of rows, and yield them.

    At most one chunk is in memory. `laws` are the laws by the name of the cam.
    """
    pending: list[TickSamples] = []
    count = 0
    for tick in ticks:
        pending.append(tick)
        count += tick.time.size
        if count >= CHUNK_ROWS:
            yield _join(pending, laws)
            pending, count = [], 0
    if count:
        yield _join(pending, laws)


def _join(ticks: list[TickSamples], laws: Mapping[str, Law]) -> Chunk:
    numbers = [
        np.hstack([column.values(tick, laws[tick.cam]) for tick in ticks]) for column in COLUMNS
    ]
    cams, counts = zip(*((tick.cam, tick.time.size) for tick in ticks), strict=True)
    return Chunk(np.stack(numbers), cams, counts)


def write_csv(path: Path, chunks: Iterable[Chunk], _about: dict[str, str], _rate: int) -> None:
    """Write rows to a CSV file, with all digits of the numbers.

    The name of the cam is in the second column.
    """
    time, *others = (column.name for column in COLUMNS)
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join([time, CAM, *others]) + "\n")
        for chunk in chunks:
            times, *numbers = (map(repr, row.tolist()) for row in chunk.numbers)
            rows = zip(times, chunk.names.tolist(), *numbers, strict=True)
            file.writelines(",".join(row) + "\n" for row in rows)


def write_npz(path: Path, chunks: Iterable[Chunk], about: dict[str, str], rate: int) -> None:
    """Write the samples of a run as a NumPy archive (.npz).

    `chunks` are successive rows of samples. The columns are stored in temporary files until their
    length is known.
    """
    rows, cams = 0, dict[str, int]()
    with temporary_folder() as folder:
        with ExitStack() as stack:
            files = [stack.enter_context((folder / c.name).open("wb")) for c in COLUMNS]
            codes = stack.enter_context((folder / CAM).open("wb"))
            for chunk in chunks:
                rows += chunk.numbers.shape[1]
                for file, row in zip(files, chunk.numbers, strict=True):
                    file.write(row.tobytes())
                numbers = [cams.setdefault(cam, len(cams)) for cam in chunk.cams]
                codes.write(np.repeat(np.array(numbers, dtype=np.int32), chunk.counts).tobytes())
        with zipfile.ZipFile(path, "w") as archive:
            for column in COLUMNS:
                with (
                    _member(archive, column.name, np.dtype(np.float64), rows) as out,
                    (folder / column.name).open("rb") as source,
                ):
                    shutil.copyfileobj(source, out)
            names = np.array(list(cams))
            with (
                _member(archive, CAM, names.dtype, rows) as out,
                (folder / CAM).open("rb") as source,
            ):
                while data := source.read(1 << 14):
                    out.write(names[np.frombuffer(data, dtype=np.int32)].tobytes())
            for name, text in {**about, "sample_rate_Hz": str(rate)}.items():
                with archive.open(f"{name}.npy", "w") as out:
                    np.lib.format.write_array(out, np.array(text))


def _member(archive: zipfile.ZipFile, name: str, dtype: np.dtype[Any], rows: int) -> IO[bytes]:
    """Open a column of a NumPy archive, write its header, and return its file.

    `rows` is the number of values that the caller writes.
    """
    out = archive.open(f"{name}.npy", "w", force_zip64=True)
    description = np.lib.format.dtype_to_descr(dtype)
    header = {"descr": description, "fortran_order": False, "shape": (rows,)}
    np.lib.format.write_array_header_1_0(out, header)
    return out


def write_parquet(path: Path, chunks: Iterable[Chunk], about: dict[str, str], rate: int) -> None:
    """Write rows as Parquet, one row group per chunk, with units in the schema."""
    with friendly_import_errors():
        import pyarrow as pa
        import pyarrow.parquet as pq

    schema = _schema(pa, {**about, "sample_rate_Hz": str(rate)})
    with pq.ParquetWriter(path, schema) as writer:
        for chunk in chunks:
            time, *numbers = (pa.array(row) for row in chunk.numbers)
            cams = pa.array(chunk.names).dictionary_encode()
            writer.write_table(pa.Table.from_arrays([time, cams, *numbers], schema=schema))


def _schema(pa: Any, about: dict[str, str]) -> Any:
    time, *others = (
        pa.field(
            column.name,
            pa.float64(),
            nullable=False,
            metadata={"unit": column.unit, "meaning": column.meaning},
        )
        for column in COLUMNS
    )
    names = pa.dictionary(pa.int32(), pa.string())
    cam = pa.field(CAM, names, nullable=False, metadata={"meaning": "the mounted cam"})
    return pa.schema([time, cam, *others], metadata=about)


#: Columns without a channel in a WAV file. The time follows from the index of the sample. An angle
#: of many turns would lose its digits in 32 bits.
NO_CHANNEL = ("time_s", "angle_rad")
#: Indices in `COLUMNS` of the channels of a WAV file.
CHANNELS = tuple(i for i, column in enumerate(COLUMNS) if column.name not in NO_CHANNEL)
#: Largest size of the samples of a WAV file, bytes: sizes in its header are 32-bit numbers, and 64
#: KiB are left for the header.
MAX_BYTES = 2**32 - 2**16
#: Format code of floating-point samples in a WAV file (WAVE_FORMAT_IEEE_FLOAT).
IEEE_FLOAT = 3
#: End of the error messages on runs that a WAV file cannot contain.
REMEDY = "so select one --cam and --rpm, or write .parquet, .npz or .csv"


def write_wav(path: Path, chunks: Iterable[Chunk], about: dict[str, str], rate: int) -> None:
    """Write rows to a WAV file, with one channel per quantity.

    Samples are 32-bit floats in SI units.

    Raises
    ------
    OutputError
        If samples are missing in the run, or the file would be larger than 4 GiB.
    """
    rows, start, last = 0, 0.0, None
    with path.open("w+b") as file:
        file.write(_header(0, rate, _comment(about, 0.0)))
        for chunk in chunks:
            times = chunk.numbers[0]
            start = float(times[0]) if last is None else start
            _require_no_gap(path, times if last is None else np.append(last, times), rate)
            last, rows = times[-1], rows + times.size
            if rows * 4 * len(CHANNELS) > MAX_BYTES:
                raise OutputError(f"{path}: more than 4 GiB; allowed: less in a WAV file, {REMEDY}")
            file.write(chunk.numbers[CHANNELS, :].T.astype("<f4").tobytes())
        file.seek(0)
        file.write(_header(rows, rate, _comment(about, start)))


def _require_no_gap(path: Path, times: np.ndarray, rate: int) -> None:
    steps = np.rint(np.diff(times) * rate)
    if (steps != 1.0).any():
        i = int(np.argmax(steps != 1.0))
        raise OutputError(
            f"{path}: no samples from {times[i]:.6g} to {times[i + 1]:.6g} s; allowed: a sound "
            f"file without gaps, {REMEDY}"
        )


def _comment(about: dict[str, str], start: float) -> bytes:
    """Return the comment of a WAV file: names and units of the channels.

    Its length does not depend on the start time `start` (s).
    """
    names = ", ".join(f"{COLUMNS[i].name} [{COLUMNS[i].unit}]" for i in CHANNELS)
    run = ", ".join(f"{name} {text}" for name, text in about.items())
    text = f"channels: {names}; begins at {start:024.12f} s; {run}".encode()
    return text + b"\0" * (2 - len(text) % 2)


def _header(rows: int, rate: int, comment: bytes) -> bytes:
    """Return the header of a WAV file with `rows` samples per channel.

    It contains all chunks before the samples, and the header of the chunk of samples.
    """
    frame = 4 * len(CHANNELS)
    layout = struct.pack("<HHIIHHH", IEEE_FLOAT, len(CHANNELS), rate, rate * frame, frame, 32, 0)
    chunks = (
        _chunk(b"fmt ", layout)
        + _chunk(b"fact", struct.pack("<I", rows))
        + _chunk(b"LIST", b"INFO" + _chunk(b"ICMT", comment))
        + struct.pack("<4sI", b"data", rows * frame)
    )
    return struct.pack("<4sI4s", b"RIFF", 4 + len(chunks) + rows * frame, b"WAVE") + chunks


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack("<4sI", name, len(data)) + data


#: Functions that write a file, by its suffix. Their parameters are the path, the rows, metadata by
#: name, and the sample rate in Hz.
FORMATS: dict[str, Callable[[Path, Iterable[Chunk], dict[str, str], int], None]] = {
    ".parquet": write_parquet,
    ".csv": write_csv,
    ".npz": write_npz,
    ".wav": write_wav,
}


def require_format(path: Path) -> None:
    """Raise `ConfigError` if there is no writer for the suffix of a file."""
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
    """Write the samples of a run to a file, with bounded memory.

    The file is written completely or not at all.

    Parameters
    ----------
    path : Path
        File with a suffix in `FORMATS`.
    ticks : iterable of TickSamples
        Samples of the run, tick by tick.
    loaded : LoadedScene
        Scene of the run.
    cam : str, optional
        Name of a cam (default: all cams).
    rpm : float, optional
        A constant cam speed in rpm (default: all speeds and ramps).

    Returns
    -------
    Contents
        Number of rows and gaps, and the times.

    Raises
    ------
    ConfigError
        If the suffix is unknown, or the run has no samples of the cam at the speed.
    OutputError
        If the format cannot contain the samples.
    """
    require_format(path)
    rate = int(loaded.scene.sample_rate.si)
    contents, scene = Contents(rate), loaded.scene
    about = {"scene": scene.name, "model": scene.model, "rig": loaded.rig.name}
    rows = contents.track(chunks(_select(ticks, cam, rpm, contents.available), loaded.laws))
    with atomic_write(path) as part:
        FORMATS[path.suffix.lower()](part, rows, about, rate)
        if not contents.rows:
            selection = f"{cam or 'a cam'} at {'a speed' if rpm is None else f'{rpm:g} rpm'}"
            available = ", ".join(contents.available) or "a run with ticks"
            raise ConfigError(f"{path}: no samples of {selection}; allowed: {available}")
    return contents


def _select(
    ticks: Iterable[TickSamples], cam: str | None, rpm: float | None, available: dict[str, None]
) -> Iterator[TickSamples]:
    """Yield the ticks with a given cam and a constant speed (rpm).

    A tick is the time between two cam states. None selects any cam or any speed. The cams and
    constant speeds that are not selected are added to `available`.
    """
    for tick in ticks:
        if tick.is_of(cam, rpm):
            yield tick
        elif tick.steady:
            available[f"{tick.cam} at {to_rpm(tick.start.speed):g} rpm"] = None
