"""The paper's report: every experiment of the paper on one self-contained page."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from cam_rig.report.command import page_date
from cam_rig.report.document import Made, fill, render
from cam_rig.show.result import Progress
from cam_rig.studies.noise import calibration, methods
from examples.paper import factorial
from examples.paper.common import parser
from examples.paper.sections import SECTIONS
from examples.paper.shared import Paper

TITLE = "Cam rig: the paper's experiments, redone and taken further"
#: Random seeds of the report.
SEEDS = (
    f"{methods.SEED} (bootstrap of the noise study, {methods.DRAWS} draws), "
    f"{calibration.SEED} (starts of its transfer functions, {calibration.STARTS})"
)


class Printed(Progress):
    """Progress that is printed, a line per section."""

    def describe(self, text: str) -> None:
        """Print the title of a section."""
        print(f"  {text}", flush=True)


def main(argv: Sequence[str] | None = None) -> None:
    """Write the report in about a minute on two cores.

    A report in Markdown (.md) has no figures, and a date only if SOURCE_DATE_EPOCH is set.
    """
    command = parser(__doc__)
    command.set_defaults(out=Path("out/paper.html"))
    out: Path = command.parse_args(argv).out
    kind = out.suffix.lstrip(".")
    if kind not in ("html", "md"):
        command.error(f"{out}: unknown kind of page; allowed: .html, .md")
    with ProcessPoolExecutor() as pool:
        study = pool.submit(factorial.study)
        paper = Paper(study.result)
        contents = fill(SECTIONS, paper, kind == "html", Printed())
    made = Made("python -m examples.paper.report", page_date(out), SEEDS)
    templates = Path(__file__).with_name("templates")
    page = render(kind, TITLE, made, contents, paper, templates)
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(page, encoding="utf-8")
    print(f"report: {out} ({len(page) / 1e6:.1f} MB)")


if __name__ == "__main__":
    main()
