"""The columns of an exported run: names, units, and where each comes from."""

from __future__ import annotations

import shutil
import struct
import zipfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cam_rig.errors import ConfigError, OutputError
from cam_rig.extras import libraries_named, require
from cam_rig.files import temporary_folder, writing
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.simulate import TickSamples
from cam_rig.units import FloatArray, to_rpm

#: Rows that are written at once, at least: a tick alone may have a few.
CHUNK_ROWS = 1 << 16
#: The column of text; the others are numbers.
CAM = "cam"


class ExportColumn(NamedTuple):
    """A column of numbers: its name with the unit in it, the unit, what it is, of `TickSamples`."""

    name: str
    unit: str
    meaning: str
    of: str


COLUMNS = (
    ExportColumn("time_s", "s", "rig time", "time"),
    ExportColumn("rpm", "rpm", "cam speed", "rpm"),
    ExportColumn("angle_rad", "rad", "cam angle θ with all its turns", "angle"),
    ExportColumn("angle_in_turn_rad", "rad", "cam angle θ from 0 to 2π", "angle_in_turn"),
    ExportColumn("lift_m", "m", "follower displacement", "lift"),
    ExportColumn("velocity_m_s", "m/s", "follower velocity", "velocity"),
    ExportColumn("acceleration_m_s2", "m/s²", "follower acceleration", "acceleration"),
    ExportColumn("force_N", "N", "contact force, 0 in flight", "force"),
    ExportColumn("impulse_N_s", "N·s", "landings since the sample before", "impulse"),
)


@dataclass(frozen=True, eq=False)
class Chunk:
    """Some rows."""

    numbers: FloatArray  #: ``(k, n)`` as in `COLUMNS`
    cams: tuple[str, ...]  #: run by run
    counts: tuple[int, ...]  #: rows of each run

    @property
    def names(self) -> NDArray[np.str_]:
        """The cam of each row, ``(n,)``."""
        return np.repeat(np.array(self.cams), self.counts)


@dataclass
class Contents:
    """What an export held, known when it is over."""

    rate: int
    rows: int = 0
    #: How often samples are missing: messages were lost, the cam stood, or a step was left out.
    gaps: int = 0
    begin: float = 0.0  #: of the first sample, s
    end: float = 0.0  #: of the last sample, s
    there: dict[str, None] = field(default_factory=dict)

    def follow(self, chunks: Iterable[Chunk]) -> Iterator[Chunk]:
        """The same chunks, taken note of."""
        for chunk in chunks:
            number = np.rint(chunk.numbers[0] * self.rate)
            if not self.rows:
                self.begin = float(chunk.numbers[0, 0])
            else:
                self.gaps += int(number[0] != np.rint(self.end * self.rate) + 1.0)
            self.gaps += int(np.count_nonzero(np.diff(number) != 1.0))
            self.rows += number.size
            self.end = float(chunk.numbers[0, -1])
            yield chunk


def chunks(ticks: Iterable[TickSamples]) -> Iterator[Chunk]:
    """The ticks as chunks of rows; no more than one chunk is held."""
    held: list[TickSamples] = []
    count = 0
    for tick in ticks:
        held.append(tick)
        count += tick.time.size
        if count >= CHUNK_ROWS:
            yield _joined(held)
            held, count = [], 0
    if count:
        yield _joined(held)


def _joined(ticks: list[TickSamples]) -> Chunk:
    numbers = [np.hstack([getattr(tick, column.of) for tick in ticks]) for column in COLUMNS]
    cams, counts = zip(*((tick.cam, tick.time.size) for tick in ticks), strict=True)
    return Chunk(np.stack(numbers), cams, counts)


def write(path: Path, chunks: Iterable[Chunk], _about: dict[str, str], _rate: int) -> None:
    """Rows as CSV: one heading, the cam in the second column, every number with all its digits."""
    time, *others = (column.name for column in COLUMNS)
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join([time, CAM, *others]) + "\n")
        for chunk in chunks:
            times, *numbers = (map(repr, row.tolist()) for row in chunk.numbers)
            rows = zip(times, chunk.names.tolist(), *numbers, strict=True)
            file.writelines(",".join(row) + "\n" for row in rows)


def write_npz(path: Path, chunks: Iterable[Chunk], about: dict[str, str], rate: int) -> None:
    """Rows as NumPy's archive; columns lie in temporary files until their length is known."""
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
                    (folder / column.name).open("rb") as kept,
                ):
                    shutil.copyfileobj(kept, out)
            names = np.array(list(cams))
            with _member(archive, CAM, names.dtype, rows) as out, (folder / CAM).open("rb") as kept:
                while data := kept.read(1 << 14):
                    out.write(names[np.frombuffer(data, dtype=np.int32)].tobytes())
            for name, text in {**about, "sample_rate_Hz": str(rate)}.items():
                with archive.open(f"{name}.npy", "w") as out:
                    np.lib.format.write_array(out, np.array(text))


def _member(archive: zipfile.ZipFile, name: str, dtype: np.dtype[Any], rows: int) -> IO[bytes]:
    """A column of the archive, open behind its header."""
    out = archive.open(f"{name}.npy", "w", force_zip64=True)
    described = np.lib.format.dtype_to_descr(dtype)
    header = {"descr": described, "fortran_order": False, "shape": (rows,)}
    np.lib.format.write_array_header_1_0(out, header)
    return out


def write_parquet(path: Path, chunks: Iterable[Chunk], about: dict[str, str], rate: int) -> None:
    """Rows as Parquet, a row group for each chunk, units and meanings in the schema."""
    with libraries_named():
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


#: No channels: the sample's place says the time, and 32 bits do not hold an angle of many turns.
WITHOUT = ("time_s", "angle_rad")

CHANNELS = tuple(i for i, column in enumerate(COLUMNS) if column.name not in WITHOUT)
#: A format of its time: sizes in it are numbers of 32 bits.
MAX_BYTES = 2**32 - 2**16

IEEE_FLOAT = 3

REMEDY = "so name one --cam and --rpm, or write .parquet, .npz or .csv"


def write_wav(path: Path, chunks: Iterable[Chunk], about: dict[str, str], rate: int) -> None:
    """Rows as a sound file: a channel each quantity, 32-bit floats in SI units."""
    rows, begin, last = 0, 0.0, None
    with path.open("w+b") as file:
        file.write(_head(0, rate, _comment(about, 0.0)))
        for chunk in chunks:
            times = chunk.numbers[0]
            begin = float(times[0]) if last is None else begin
            _require_no_gap(path, times if last is None else np.append(last, times), rate)
            last, rows = times[-1], rows + times.size
            if rows * 4 * len(CHANNELS) > MAX_BYTES:
                raise OutputError(f"{path}: more than 4 GiB; allowed: what WAV can hold, {REMEDY}")
            file.write(chunk.numbers[CHANNELS, :].T.astype("<f4").tobytes())
        file.seek(0)
        file.write(_head(rows, rate, _comment(about, begin)))


def _require_no_gap(path: Path, times: np.ndarray, rate: int) -> None:
    steps = np.rint(np.diff(times) * rate)
    if (steps != 1.0).any():
        i = int(np.argmax(steps != 1.0))
        raise OutputError(
            f"{path}: no samples from {times[i]:.6g} to {times[i + 1]:.6g} s; allowed: a sound "
            f"file has no gaps, {REMEDY}"
        )


def _comment(about: dict[str, str], begin: float) -> bytes:
    """Names and units of the channels, of the same length for any beginning (s)."""
    names = ", ".join(f"{COLUMNS[i].name} [{COLUMNS[i].unit}]" for i in CHANNELS)
    run = ", ".join(f"{name} {text}" for name, text in about.items())
    text = f"channels: {names}; begins at {begin:024.12f} s; {run}".encode()
    return text + b"\0" * (2 - len(text) % 2)


def _head(rows: int, rate: int, comment: bytes) -> bytes:
    """All chunks before the samples, and the head of theirs."""
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


#: Writers by ending: path, rows, what the run was, samples a second.
FORMATS: dict[str, Callable[[Path, Iterable[Chunk], dict[str, str], int], None]] = {
    ".parquet": write_parquet,
    ".csv": write,
    ".npz": write_npz,
    ".wav": write_wav,
}


def require_format(path: Path) -> None:
    """Refuse a file of which nobody knows how to write it."""
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
    """Write a run's samples in bounded memory, whole or not at all; of a cam, of a held speed."""
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
