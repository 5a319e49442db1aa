"""Rows as NumPy's archive: an array each column, written without holding one in memory."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any

import numpy as np

from cam_rig.export.columns import CAM, COLUMNS, Chunk
from cam_rig.files import temporary_folder


def write(path: Path, chunks: Iterable[Chunk], about: dict[str, str], rate: int) -> None:
    """Write all rows; the columns lie in temporary files until their length is known."""
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
                kind = np.dtype(np.float64)
                with (
                    _member(archive, column.name, kind, rows) as out,
                    (folder / column.name).open("rb") as numbers_file,
                ):
                    shutil.copyfileobj(numbers_file, out)
            _write_cams(archive, folder / CAM, np.array(list(cams)), rows)
            for name, text in {**about, "sample_rate_Hz": str(rate)}.items():
                with archive.open(f"{name}.npy", "w") as out:
                    np.lib.format.write_array(out, np.array(text))


def _write_cams(archive: zipfile.ZipFile, codes: Path, names: Any, rows: int) -> None:
    """The cam of each row as text, chunk by chunk."""
    with _member(archive, CAM, names.dtype, rows) as out, codes.open("rb") as file:
        while data := file.read(1 << 14):
            out.write(names[np.frombuffer(data, dtype=np.int32)].tobytes())


def _member(archive: zipfile.ZipFile, name: str, dtype: np.dtype[Any], rows: int) -> IO[bytes]:
    """A column of the archive, open behind its header."""
    out = archive.open(f"{name}.npy", "w", force_zip64=True)
    header = {
        "descr": np.lib.format.dtype_to_descr(dtype),
        "fortran_order": False,
        "shape": (rows,),
    }
    np.lib.format.write_array_header_1_0(out, header)
    return out
