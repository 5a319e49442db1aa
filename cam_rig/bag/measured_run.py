"""A recorded run as instruments saw it: of the rig's own bags, and of any bag of ROS 2 messages."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from cam_rig.acoustics import level_db
from cam_rig.bag.foreign_topics import EXAMPLE, MappedField, forward_turns, read_fields, topic_list
from cam_rig.bag.reader import messages, read_ticks, rigs_of
from cam_rig.errors import BagError, RefusedError, did_you_mean
from cam_rig.messages import topics
from cam_rig.messages.codec import cam_state_of, stamp_ns
from cam_rig.simulation.instruments import MeasuredRun, Signal
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, FloatArray

# The states of the cam and the sound pressures of a recording of the rig.


def read_states(bag: Path, namespace: str | None = None) -> Iterator[CamState]:
    """The states of the cam in the order of the bag."""
    try:
        for _, _, message in messages(bag, (topics.CAM_STATE,), namespace):
            yield cam_state_of(message)
    except RefusedError as error:
        raise BagError(f"{bag}: {error}") from None


def read_pressures(bag: Path, namespace: str | None = None) -> dict[int, float]:
    """r.m.s. sound pressure (Pa) of each tick by the stamp (ns) of its end."""
    try:
        return {
            stamp_ns(message.header.stamp): float(message.fluid_pressure)
            for _, _, message in messages(bag, (topics.PRESSURE,), namespace)
        }
    except RefusedError as error:
        raise BagError(f"{bag}: {error}") from None


def read_measured(
    bag: Path,
    mapping: dict[str, MappedField] | None = None,
    cam: str | None = None,
    namespace: str | None = None,
) -> MeasuredRun:
    """Read what was measured of one cam.

    Parameters
    ----------
    mapping : fields by quantity, as of `parse_topics`; a bag of the rig itself needs none
    cam : its name; a bag of the rig with one cam needs none
    namespace : of the rig, "/rig2", for a bag of several

    Examples
    --------
    >>> run = read_measured(Path("bags/golden"), cam="tm21")
    >>> run.angle.value.size, run.force.source
    (1643, '/follower/samples')
    """
    if mapping is None:
        return _own(bag, cam, own_namespace(bag, namespace))
    signals, begin_ns, notes = read_fields(bag, mapping)
    angle, turning = forward_turns(signals["angle"], f"{bag}: {signals['angle'].source}")
    signals["angle"] = angle
    for name, signal in signals.items():
        _require_overlap(bag, name, signal, angle)
        notes += _gap_words(name, signal)
    return MeasuredRun(bag, cam or "", **signals, notes=tuple(notes + turning), begin_ns=begin_ns)


def own_namespace(bag: Path, namespace: str | None) -> str:
    """The namespace of the rig that is meant; empty for the root."""
    rigs = rigs_of(bag)
    if not rigs:
        raise BagError(
            f"{bag}: is not a recording of cam_rig; name what was measured with --topics "
            f"'{EXAMPLE}'; it holds {topic_list(bag)}"
        )
    names = [name or "/" for name in rigs]
    if namespace is None and len(rigs) > 1:
        raise BagError(
            f"{bag}: holds several rigs, {', '.join(names)}; choose one with --namespace "
            f"{names[-1]}"
        )
    wanted = rigs[0] if namespace is None else f"/{namespace.strip('/')}".rstrip("/")
    if wanted not in rigs:
        raise BagError(
            f"{bag}: holds no rig {wanted or '/'}; allowed: {', '.join(names)}"
            f"{did_you_mean(wanted, names)}"
        )
    return wanted


def _own(bag: Path, cam: str | None, namespace: str) -> MeasuredRun:
    """A run of the rig: angle, lift and force at every sample, the level of every tick."""
    parts: dict[str, list[FloatArray]] = {}
    times: dict[str, list[tuple[float, float]]] = {}
    for tick in read_ticks(bag, namespace):
        rows = np.stack([tick.time, tick.angle, tick.lift, tick.force])
        parts.setdefault(tick.cam, []).append(rows)
        spans = times.setdefault(tick.cam, [])
        spans.append((tick.interval.start_ns / NS, tick.interval.stop_ns / NS))
    chosen = _one_cam(bag, list(parts), cam)
    time, angle, lift, force = np.hstack(parts[chosen])
    source = f"{namespace}{topics.FOLLOWER_SAMPLES.name}"
    level = _levels(bag, namespace, times[chosen])
    notes = _gap_words("samples", Signal(time, lift, source))
    return MeasuredRun(
        bag,
        chosen,
        Signal(time, angle, f"{namespace}{topics.CAM_STATE.name}"),
        Signal(time, lift, source),
        Signal(time, force, source),
        level,
        tuple(notes),
    )


def _one_cam(bag: Path, there: list[str], cam: str | None) -> str:
    if not there:
        raise BagError(f"{bag}: holds no samples of a cam that turns; run at least one turn")
    if cam is None and len(there) > 1:
        raise BagError(f"{bag}: holds cams {', '.join(there)}; choose one with --cam {there[0]}")
    chosen = there[0] if cam is None else cam
    if chosen not in there:
        raise BagError(
            f"{bag}: holds no samples of cam {cam!r}; allowed: {', '.join(there)}"
            f"{did_you_mean(chosen, there)}"
        )
    return chosen


def _levels(bag: Path, namespace: str, spans: list[tuple[float, float]]) -> Signal | None:
    """The level of each tick of a cam, at the tick's end."""
    rows = [
        (stamp / NS, float(level_db(pressure)))
        for stamp, pressure in read_pressures(bag, namespace).items()
        if pressure > 0.0
    ]
    ends = {end for _, end in spans}
    kept = np.array([row for row in rows if row[0] in ends]).reshape(-1, 2)
    if not kept.size:
        return None
    return Signal(kept[:, 0], kept[:, 1], f"{namespace}{topics.PRESSURE.name}")


def _require_overlap(bag: Path, name: str, signal: Signal, angle: Signal) -> None:
    if signal.time[0] < angle.time[-1] and angle.time[0] < signal.time[-1]:
        return
    raise BagError(
        f"{bag}: {name} of {signal.source} is from {signal.time[0]:.6g} to "
        f"{signal.time[-1]:.6g} s, the angle from {angle.time[0]:.6g} to {angle.time[-1]:.6g} s; "
        "allowed: of one time (if the stamps are of two clocks, put @bag behind an item: the time "
        "of the bag)"
    )


def _gap_words(name: str, signal: Signal) -> list[str]:
    gaps = signal.gaps()
    if not len(gaps):
        return []
    longest = gaps[np.argmax(gaps[:, 1] - gaps[:, 0])]
    count = "a gap" if len(gaps) == 1 else f"{len(gaps)} gaps"
    return [
        f"{name}: {count} in the readings, the longest of {longest[1] - longest[0]:.3g} s from "
        f"{longest[0]:.6g} s on; nothing is put in their place."
    ]
