"""Generator of hostile YAML and CSV files from a seed.

Each file must load, or raise an error of one line. The command
``python test/schema/fuzz_files.py yaml 300 1`` (kind, number of cases, seed) prints JSON: number of
cases and of errors, largest CPU time of a case (s), peak memory of the process (MB), and the
failures with their case numbers. A failure is any other exception, or a message that is too long.
"""

from __future__ import annotations

import json
import random
import string
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

from cam_rig.errors import CamRigError
from cam_rig.laws import build_law
from cam_rig.profile.contour_files import read_contour_table
from cam_rig.schema import load_cam, load_published, load_rig, load_scene
from cam_rig.schema.load import config_root, load_tables

#: Shipped files, and the functions that load them.
SHIPPED: dict[str, Callable[[Path], object]] = {
    "cams/tm21.yaml": load_cam,
    "cams/bezier15.yaml": load_cam,
    "cams/conjugate.yaml": load_cam,
    "rigs/tm21.yaml": load_rig,
    "scenes/quick.yaml": load_scene,
    "scenes/torsion.yaml": load_scene,
    "published/tm21_noise.yaml": load_published,
    "published/tables/paper.yaml": load_tables,
}
#: Sizes of generated files in bytes, below and above the limit of 1 MiB.
SIZES = (100, 10_000, 600_000, 1_040_000, 3_000_000, 10_000_000)
#: Characters with a meaning in YAML or CSV.
SIGNS = "[]{}:,-?&*!|>'\"%@`#\n\t \r.~<=0123456789eE+_xob\x00\x07\ufeff\u2028é\U0001f600"


def yaml_text(rng: random.Random, name: str) -> bytes:
    """Return a generated file, or a shipped file with random changes."""
    if rng.random() < 0.35:
        return piece(rng).encode("utf-8", "surrogatepass")
    return damaged(rng, (config_root() / name).read_text(encoding="utf-8"))


def piece(rng: random.Random) -> str:
    """Return a text that is too long, too deep, too large or otherwise hostile."""
    n, sign = rng.choice(SIZES), rng.choice(SIGNS)
    chain = "".join(f"a{i}: &a{i} [{f'*a{i - 1}, ' * 10}]\n" for i in range(1, rng.randint(2, 99)))
    deep = "".join(f"b{i}: &b{i} [*b{i - 1}]\n" for i in range(1, min(n, 90_000) // 10))
    digits = rng.choice(["1", "0b1", "0x1", "0o1", "-1", "1.", "1_", "1e"])
    return rng.choice(
        [
            lambda: sign * n,
            lambda: rng.choice(["[", "{", "- ", "? ", "{a: ", "[{", "!!map {a: "]) * n,
            lambda: f"mass: {digits}{rng.choice('01') * n}",
            lambda: "title: " + rng.choice(['"', "'", "", "|\n  ", ">\n  "]) + "word " * (n // 5),
            lambda: "a: [" + "1.25, " * (n // 6) + "]",
            lambda: "".join(f"k{i}: {i}\n" for i in range(n // 10)),
            lambda: "k: 1\n" * (n // 5),
            lambda: "a0: &a0 [1, 1, 1]\n" + chain,
            lambda: "b0: &b0 [1]\n" + deep,
            lambda: "a: &a {b: *a}\n<<: [*a, *a]",
            lambda: "<<: " + rng.choice(["1", "[1]", "{a: 1}", "[{a: 1}, {a: 2}]", "*x"]),
            lambda: "x: !!python/object/apply:os.system [echo]",
            lambda: "x: " + rng.choice(["!!binary aGk=", "!!set {a}", "!a b", "2001-01-01"]),
            lambda: "".join(rng.choice(SIGNS) for _ in range(rng.randint(1, 400))),
            lambda: "".join(chr(rng.randint(0, 0x10FFFF)) for _ in range(rng.randint(1, 200))),
            lambda: "".join(rng.choice(string.printable) for _ in range(rng.randint(1, 2000))),
        ]
    )()


def damaged(rng: random.Random, text: str) -> bytes:
    """Return a text with up to four changes of characters, lines or values.

    5 % of the texts are in another encoding.
    """
    for _ in range(rng.randint(1, 4)):
        lines, index = text.splitlines() or [""], rng.randrange(len(text) or 1)
        row, other = rng.randrange(len(lines)), rng.choice(SIGNS)
        match rng.randrange(4):
            case 0:
                text = text[:index] + other + text[index + rng.randint(0, 2) :]
            case 1:
                text = text[:index]
            case 2:
                text = "\n".join(lines[: row + 1] + lines[row + rng.choice((0, 2)) :])
            case 3:
                value = piece(rng)[: rng.choice((10, 400, 200_000))]
                lines[row] = f"{lines[row].partition(':')[0]}: {value}"
                text = "\n".join(lines)
    encoding = "utf-8" if rng.random() < 0.95 else rng.choice(["utf-16", "utf-32", "latin-1"])
    return text.encode(encoding, "surrogatepass" if encoding == "utf-8" else "replace")


def csv_text(rng: random.Random) -> bytes:
    """Return a generated table, or the shipped table with random changes."""
    n, text = rng.choice(SIZES), (config_root() / "cams" / "measured.csv").read_text("utf-8")
    header = rng.choice(["angle_deg,lift_mm\n", "x_mm,y_mm\n", "disc,x_mm,y_mm\n", ""])
    rows = [
        lambda: header + '"' + "1" * n,
        lambda: header + "1," + "1" * n,
        lambda: header + "1,1\n" * (n // 4),
        lambda: header + "\n".join(f"{i},{i}" for i in range(n // 12)),
        lambda: "a," * n + header,
        lambda: header + '"\n' * (n // 2),
        lambda: header + "1,nan\n1,inf\n1e999,1\n",
        lambda: header + rng.choice("\x00\n") * n,
        lambda: header + "".join(rng.choice(SIGNS + ',,"') for _ in range(rng.randint(1, 3000))),
    ]
    if rng.random() < 0.4:
        return rng.choice(rows)().encode("utf-8", "surrogatepass")
    return damaged(rng, text)


def read_yaml_case(rng: random.Random, folder: Path) -> None:
    """Load a random file as one of the kinds of config."""
    path = folder / "any.yaml"
    name = rng.choice(list(SHIPPED))
    path.write_bytes(yaml_text(rng, name))
    config = SHIPPED[name](path)
    if type(config).__name__ == "CamConfig":
        build_law(config)  # type: ignore[arg-type]


def read_csv_case(rng: random.Random, folder: Path) -> None:
    """Load a random table as points of a law, or as points of a contour."""
    cam, table = folder / "measured.yaml", folder / "measured.csv"
    cam.write_bytes((config_root() / "cams" / "measured.yaml").read_bytes())
    table.write_bytes(csv_text(rng))
    if rng.random() < 0.3:
        read_contour_table(table)
    else:
        build_law(load_cam(cam))


CASES = {"yaml": read_yaml_case, "csv": read_csv_case}


def find_failures(kind: str, cases: int, seed: int, tally: dict[str, float]) -> Iterator[str]:
    """Run the cases, count them in `tally`, and yield the failures."""
    with tempfile.TemporaryDirectory() as folder:
        for i in range(cases):
            start = time.process_time()
            try:
                CASES[kind](random.Random(f"{kind} {seed} {i}"), Path(folder))
            except CamRigError as error:
                tally["errors"] += 1
                if "\n" in str(error) or len(str(error)) > 2000:
                    yield f"case {i}: {str(error)[:300]!r}"
            except Exception:
                yield f"case {i}: {traceback.format_exc()}"
            cpu_s = time.process_time() - start
            tally["max_cpu_s"] = max(tally["max_cpu_s"], cpu_s)


def main(kind: str, cases: str, seed: str) -> None:
    """Run the cases and print the results as JSON."""
    tally = {"cases": int(cases), "errors": 0, "max_cpu_s": 0.0}
    failures = list(find_failures(kind, int(cases), int(seed), tally))
    # not ru_maxrss, which starts from the memory of the parent process
    status = Path("/proc/self/status").read_text(encoding="ascii")
    memory = float(status.split("VmHWM:")[1].split()[0]) / 1024.0
    print(json.dumps({**tally, "memory_mb": memory, "failures": failures}))


if __name__ == "__main__":
    main(*sys.argv[1:])
