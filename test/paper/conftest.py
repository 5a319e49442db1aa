"""What the commands of the slices show is looked at for faults, as that of all commands."""

from ..cli.conftest import no_broken_heading, no_faulty_figure

__all__ = ["no_broken_heading", "no_faulty_figure"]
