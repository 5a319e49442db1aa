"""Measured runs, from recordings of the rig and from any bag of ROS 2 messages."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from cam_rig.acoustics import level_db
from cam_rig.bag.foreign.readings import read_signals
from cam_rig.bag.foreign.topic_line import EXAMPLE, MappedField
from cam_rig.bag.partial_reader import recovery_notes
from cam_rig.bag.reader import decoded, pressure_of, read_ticks, rigs_of, topic_list
from cam_rig.errors import BagError, did_you_mean
from cam_rig.messages import topics
from cam_rig.messages.codec import cam_state_of
from cam_rig.simulation.instruments import MeasuredRun, Signal
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, FloatArray, format_duration, format_time

#: Duration (s) from which a single gap in the readings is reported as a pause, in which the
#: recording was stopped. Other gaps are reported as gaps.
MIN_PAUSE_S = 10.0


def read_states(bag: Path, namespace: str | None = None) -> Iterator[CamState]:
    """Return an iterator over the cam states in the order of the bag.

    `namespace` chooses the rig of a bag with several rigs.
    """
    return (state for _, state in decoded(bag, {topics.CAM_STATE: cam_state_of}, namespace))


def read_pressures(bag: Path, namespace: str | None = None) -> dict[int, float]:
    """Return the r.m.s. sound pressure (Pa) of each tick, the time between cam states.

    The key is the stamp (ns) of the end of the tick. `namespace` chooses the rig of a bag with
    several rigs.
    """
    return dict(pressure for _, pressure in decoded(bag, {topics.PRESSURE: pressure_of}, namespace))


def read_measured(
    bag: Path,
    mapping: dict[str, MappedField] | None = None,
    cam: str | None = None,
    namespace: str | None = None,
) -> MeasuredRun:
    """Return the measured run of one cam.

    `mapping` contains the field of each quantity in a bag of another program, and is None for a
    recording of the rig. `cam` and `namespace` choose a cam and a rig of several. Raises BagError
    if a signal does not overlap the angle in time.
    """
    if mapping is None:
        return _read_rig(bag, cam, own_namespace(bag, namespace))
    run = read_signals(bag, mapping, cam or "")
    notes = [*recovery_notes(bag), *run.notes]
    for name in (count.quantity for count in run.counts):
        signal = getattr(run, name)
        _require_overlap(bag, name, signal, run.angle, run.begin_ns)
        notes += _gap_words(name, signal)
    return replace(run, notes=tuple(notes))


def own_namespace(bag: Path, namespace: str | None) -> str:
    """Return the namespace of the rig in a bag, which is empty for the root.

    `namespace` chooses a rig. Raises BagError if the bag does not contain that rig, or if it
    contains several and `namespace` is None.
    """
    rigs = rigs_of(bag)
    if not rigs:
        raise BagError(
            f"{bag}: is not a recording of cam_rig; name the measured fields with --topics "
            f"'{EXAMPLE}'; its topics are {topic_list(bag)}"
        )
    names = [name or "/" for name in rigs]
    if namespace is None and len(rigs) > 1:
        raise BagError(
            f"{bag}: contains several rigs, {', '.join(names)}; choose one with --namespace "
            f"{names[-1]}"
        )
    chosen = rigs[0] if namespace is None else f"/{namespace.strip('/')}".rstrip("/")
    if chosen not in rigs:
        raise BagError(
            f"{bag}: contains no rig {chosen or '/'}; allowed: {', '.join(names)}"
            f"{did_you_mean(chosen, names)}"
        )
    return chosen


def _read_rig(bag: Path, cam: str | None, namespace: str) -> MeasuredRun:
    """Return the measured run of one cam from a recording of the rig.

    It contains angle, lift and force samples, and the sound level per tick. A tick is the time
    between two cam states.
    """
    parts: dict[str, list[FloatArray]] = {}
    ends: dict[str, set[int]] = {}
    for tick in read_ticks(bag, namespace):
        rows = np.stack([tick.time, tick.angle, tick.lift, tick.force])
        parts.setdefault(tick.cam, []).append(rows)
        ends.setdefault(tick.cam, set()).add(tick.interval.stop_ns)
    chosen = _choose_cam(bag, list(parts), cam)
    time, angle, lift, force = np.hstack(parts[chosen])
    source = f"{namespace}{topics.FOLLOWER_SAMPLES.name}"
    angles = Signal(time, angle, f"{namespace}{topics.CAM_STATE.name}")
    lifts, forces = Signal(time, lift, source), Signal(time, force, source)
    level, notes = _levels(bag, namespace, ends[chosen]), tuple(_gap_words("samples", lifts))
    return MeasuredRun(bag, chosen, angles, lifts, forces, level, notes)


def _choose_cam(bag: Path, cams: list[str], cam: str | None) -> str:
    if not cams:
        raise BagError(f"{bag}: contains no samples of a turning cam; record at least one turn")
    if cam is None and len(cams) > 1:
        raise BagError(f"{bag}: contains cams {', '.join(cams)}; choose one with --cam {cams[0]}")
    chosen = cams[0] if cam is None else cam
    if chosen not in cams:
        raise BagError(
            f"{bag}: contains no samples of cam {cam!r}; allowed: {', '.join(cams)}"
            f"{did_you_mean(chosen, cams)}"
        )
    return chosen


def _levels(bag: Path, namespace: str, ends: set[int]) -> Signal | None:
    """Return the sound level (dB) of each tick of a cam, at the end of the tick.

    `ends` contains the stamps (ns) of the ends. Returns None without a pressure above 0. A tick is
    the time between two cam states.
    """
    pressures = read_pressures(bag, namespace).items()
    by_stamp = {
        stamp: pressure for stamp, pressure in pressures if stamp in ends and pressure > 0.0
    }
    if not by_stamp:
        return None
    time, level = np.array(list(by_stamp)) / NS, level_db(np.array(list(by_stamp.values())))
    return Signal(time, level, f"{namespace}{topics.PRESSURE.name}")


def _require_overlap(bag: Path, name: str, signal: Signal, angle: Signal, begin_ns: int) -> None:
    if signal.time[0] < angle.time[-1] and angle.time[0] < signal.time[-1]:
        return
    ends = [
        format_time(float(each.time[end]), begin_ns) for each in (signal, angle) for end in (0, -1)
    ]
    raise BagError(
        f"{bag}: {name} and angle must overlap in time, got {signal.source} from {ends[0]} to "
        f"{ends[1]} and the angle from {ends[2]} to {ends[3]}; if their stamps are of two clocks, "
        "append @bag to each item to use the time of the bag"
    )


def _gap_words(name: str, signal: Signal) -> list[str]:
    gaps = signal.gaps()
    if not len(gaps):
        return []
    longest = gaps[np.argmax(gaps[:, 1] - gaps[:, 0])]
    length = float(longest[1] - longest[0])
    text = f"{format_duration(length)} from {longest[0]:.6g} s on, not filled."
    if len(gaps) == 1 and length >= MIN_PAUSE_S:
        return [f"{name}: the readings pause for {text}"]
    count = "a gap" if len(gaps) == 1 else f"{len(gaps)} gaps"
    return [f"{name}: {count} in the readings, the longest of {text}"]
