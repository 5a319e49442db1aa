"""Error against time of cam_rig and its peers: the end of docs/accuracy.md.

It also writes docs/develop/cost.md and draws the figure. Run it from the root of the repository:
OMP_NUM_THREADS=1 .venv/bin/python -m benchmark.work_precision
"""

from __future__ import annotations

import math
import platform
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmark import live_rate, long_laws, scaling
from benchmark.speed.cases import BLOCKS, SPEEDS_RPM, rate_table, sample_rates
from benchmark.speed.event_cost import event_costs, event_table
from benchmark.speed.report import MeasuredPoint, figure, measure, notes
from benchmark.speed.start_up import command_table, command_times, node_starts, node_table
from benchmark.speed.steady_cost import RTOL, steady_costs, steady_table
from benchmark.speed.study import FULL, NEARLY_BEST
from cam_rig.show.figure import write
from cam_rig.show.tables import to_markdown

#: Page with the section on speed against error.
PAGE = Path("docs/accuracy.md")
#: Figure of that page.
PLOT = Path("docs/speed.png")
#: Page on computing times, for developers.
COST_PAGE = Path("docs/develop/cost.md")
#: Heading of the written section.
HEADING = "## Speed against error\n"

TEXT = """
Error relative to a 50-digit reference, and wall time, of the rig and of other solvers.

![error against wall time](speed.png)

{table}

The table contains the fastest of the other solvers, or of the most accurate ones if none is as
accurate as the rig, the figure all solvers. Error: the largest
error of displacement or velocity, relative to the largest value. Events: the largest time to the
nearest event of the same kind, including missed events. Time: median on one of {cores} cores
({machine}), without cached data of a law.

Peers (DOP853, LSODA and Radau of scipy, CVODE of scikit-sundae) use relative tolerances from
{loosest:.0e} to {tightest:.0e} as far as the time allows, and atol = 0.001 rtol x usual size. They
receive the Jacobian, event functions, and a restart at every joint of the law.

{cases}

**Limitations.** The right-hand sides of these peers are Python functions, which cost 4 to 5 µs per
evaluation. The peer `DOP853 numba` has no Python in its loop: law, right-hand side, events and
step control are one function compiled by numba. It solves the cases of linear phases only. The
cases are few, have the lift as their only excitation, and were chosen by the authors of the rig,
except `ball_on_table`, the standard problem of impact dynamics (P. J. Holmes, *The dynamics of
repeated impacts with a sinusoidally vibrating table*, Journal of Sound and Vibration 84, 1982). A
comparison with a program of others, Siconos, is an [independent check](#lift-offs-and-landings).

The references are closed forms of every linear phase with 60 digits. Their events are roots of
these closed forms. The reference of `torsional` is a Taylor series of order 40 with 45 digits
(`benchmark/make_reference.py`). Made by
`make bench` in {took:.0f} s. `python -m benchmark.speed` measures this machine.

[Computing time in detail](develop/cost.md) has samples, settled turns, jump search,
events, scaling and start-up.

### A campaign

The jump speed, 1.7 s from rest, of rigs with variations of spring, preload and mass by 10 %. The
peer receives each speed to 1 %. It continues by bisection, with CVODE (Adams) at rtol 1e-8 up to
the first root of the contact force.

{campaign}

{live}"""
COST = """\
# Computing time in detail

This page gives the computing time of each part of the rig, on the machine of
[Speed against error](../accuracy.md#speed-against-error). `make bench` writes it.

{rates}

{steady}

{jump_search}

{events}

{scaling}

{start_up}
"""

EVENTS = """\
## Events

Time of a lift-off and its landing: wall time divided by the number of landings of the run.

{table}

The search gives the same bits in plain Python and compiled by numba (`cam_rig[fast]`). A whole
solution includes the tables of cam and follower. The compiled search is an extension module in the
user's cache. Loading it takes 4 ms and does not import numba. `make setup` and
`python -m cam_rig.dynamics.events` build it, once per user, in about a minute. If it is missing, it
is built after a minute in plain Python. `CAM_RIG_EVENTS=plain` or `=compiled` selects the search.\
"""


def events() -> str:
    """Return the section on the cost of an event."""
    return EVENTS.format(table=to_markdown(event_table(event_costs())))


def scaled() -> str:
    """Return the section on time against the size of a problem, and draw its figure."""
    scalings = scaling.measure()
    scaling.draw(scalings, scaling.PLOT)
    return scaling.section(scalings)


START_UP = """\
## Start-up

Time before the computation starts, medians.

{nodes}

By itself: CPU time of the imports with `ros2 run` or a launch file. Forked: CPU time with
`cam-rig run`, from a process that has already imported the modules shared by the nodes.

{commands}

CPU: CPU time of all processes of the command.\
"""
SAMPLES = """\
## Samples

Computing a block of samples (Bézier 15 at 48 kHz, the six rows of /follower/samples) compared with
copying the same number of bytes. At {whole:g} rpm a turn is a whole number of samples, and its
polynomials are prepared once. At {broken:g} rpm a turn is not a whole number of samples.

{table}\
"""
STEADY_SECTION = """\
## Settled turns

One point of a sweep or a campaign: TM21 on its rig, ten turns at 12 kHz. The first two are for
settling. Above the jump speed, turns are computed before these until they repeat. CVODE
(rtol {rtol:.0e}) integrates only the flights of ten turns. All its samples are those of the law.

{table}\
"""
LIVE = """\
### Live runs

Rig time divided by wall time of the shipped sweep, run with the nodes. With a viewer, Rerun's
server receives the data that a screen can display.

{table}
"""
CLI = ("-m", "cam_rig.cli.main")


def start_up() -> str:
    """Return the section on the cost of a start."""
    with TemporaryDirectory() as folder:
        live = [
            (words, (*CLI, "run", scene, "--bag", f"{folder}/{scene}"))
            for words, scene in (("cam-rig run quick", "quick"), ("cam-rig run", "tm21_sweep"))
        ]
        commands = [
            ("cam-rig --help", (*CLI, "--help")),
            ("cam-rig simulate quick", (*CLI, "simulate", "quick")),
            ("cam-rig simulate", (*CLI, "simulate")),
        ]
        times = [*command_times(commands), *command_times(live, repeats=1)]
    return START_UP.format(
        nodes=to_markdown(node_table(node_starts())), commands=to_markdown(command_table(times))
    )


def steady() -> str:
    """Return the section on a sweep point of steady turns."""
    return STEADY_SECTION.format(rtol=RTOL, table=to_markdown(steady_table(steady_costs())))


def samples() -> str:
    """Return the section on samples per second."""
    whole, broken = SPEEDS_RPM
    table = to_markdown(rate_table(sample_rates(blocks=BLOCKS[1:])))
    return SAMPLES.format(whole=whole, broken=broken, table=table)


def quickest(points: Iterable[MeasuredPoint]) -> list[MeasuredPoint]:
    """Return the points of cam_rig and of the fastest peer in each case.

    If no peer is as accurate as cam_rig, it is the fastest of the most accurate peers. The figure
    has all peers.
    """
    of_case = defaultdict[str, list[MeasuredPoint]](list)
    for point in points:
        if point.compared:
            of_case[point.case].append(point)
    chosen = []
    for rig, *peers in of_case.values():
        limit = NEARLY_BEST * min(_error(peer) for peer in peers)

        def rank(peer: MeasuredPoint, limit: float = limit) -> tuple[bool, bool, float]:
            is_less_accurate = peer.only_a_bound and _error(peer) > limit
            has_reached = peer.point is not None and not peer.only_a_bound
            return not has_reached, is_less_accurate, peer.ratio or math.inf

        chosen += [rig, min(peers, key=rank)]
    return chosen


def _error(peer: MeasuredPoint) -> float:
    return math.inf if peer.point is None else peer.point.error


def main() -> None:
    """Measure, and write the pages and the figure."""
    before, mark, _ = PAGE.read_text(encoding="utf-8").partition(HEADING)
    assert mark, f"{PAGE}: has no line {HEADING!r}"
    comparison = measure(quick=False)
    write(figure(comparison), PLOT)
    study, (points, campaign, *_) = comparison.study, comparison.tables()
    (of_points,) = replace(points, records=quickest(points.records)).to_display()
    (of_campaign,) = campaign.to_display()
    print(*notes(study), sep="\n")
    text = TEXT.format(
        table=to_markdown(of_points),
        cores=study.cores,
        machine=f"{platform.machine()}, Python {platform.python_version()}",
        loosest=FULL.rtols[0],
        tightest=FULL.rtols[-1],
        campaign=to_markdown(of_campaign),
        live=LIVE.format(table=to_markdown(live_rate.live_table())),
        cases="\n".join(f"- `{name}`: {r.case.title}." for name, r in study.cases.items()),
        took=study.took_s,
    )
    PAGE.write_text(before + HEADING + text, encoding="utf-8")
    details = COST.format(
        rates=samples(),
        steady=steady(),
        jump_search=long_laws.section(long_laws.measure()),
        events=events(),
        scaling=scaled(),
        start_up=start_up(),
    )
    COST_PAGE.write_text(details, encoding="utf-8")
    print(f"{PAGE}, {COST_PAGE}, {PLOT}, {scaling.PLOT}")


if __name__ == "__main__":
    main()
