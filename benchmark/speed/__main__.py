"""Command ``python -m benchmark.speed``."""

import typer

from benchmark.speed.report import bench

typer.run(bench)
