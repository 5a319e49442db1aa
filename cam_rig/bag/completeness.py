"""What a recording lacks, in numbers: by its scene, by its states, by its sequence numbers.

The ticks of a scene are counted from 1, and so are the messages of a topic.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby, pairwise, takewhile
from pathlib import Path

from cam_rig.bag.reader import decoded, read_counts
from cam_rig.errors import BagError, RefusedError
from cam_rig.messages import topics
from cam_rig.messages.codec import cam_state_of
from cam_rig.messages.serialization import read_message
from cam_rig.messages.topics import RECEIVED, RECORDING, Topic, occasions, recorded_topic
from cam_rig.schema import SceneConfig
from cam_rig.simulation.schedule import CamState, cam_states, tick_count

# Whether a bag holds every message of every tick of its scene.


def require_complete(bag: Path, scene: SceneConfig) -> dict[str, int]:
    """Messages a topic, when none is missing that the states in the bag make it hold."""
    counts = read_counts(bag)
    states = [state for _, state in decoded(bag, {topics.CAM_STATE: cam_state_of})]
    if len(states) <= tick_count(scene):
        raise BagError(
            f"{bag}: has {len(states)} states of the cam; the scene has {tick_count(scene) + 1}"
        )
    expected = expected_counts(states)
    for topic in RECEIVED:
        if topic.per in expected and counts.get(topic.name, 0) != expected[topic.per]:
            raise BagError(
                f"{bag}: {topic.name} has {counts.get(topic.name, 0)} messages; expected: "
                f"{expected[topic.per]}, one for each {topic.per}"
            )
    return counts


def belonging(before: CamState | None, state: CamState) -> tuple[Topic, ...]:
    """Topics that have a message at a state's time, by the state before it (None at the first)."""
    there = occasions(before, state)
    return tuple(topic for topic in RECEIVED if topic.per in there)


def expected_counts(states: list[CamState]) -> dict[str, int]:
    """How many ticks, states, cams and speeds there are in a series of states."""
    moves = zip([None, *states], states, strict=False)
    found = Counter(per for move in moves for per in occasions(*move))
    return {per: found[per] for per in ("tick", "state", "cam", "speed")}


#: Ticks of a scene, at most, of which what a recording lacks at its end is counted.
MAX_COUNTED = 100_000
#: Gaps that are named one by one; of more, the number is given.
MAX_NAMED = 6
#: The number of a state, the one before it where that is known, and the state.
Move = tuple[int, CamState | None, CamState]
#: The numbers of states at which topics have no message, and the names of these.
Lacking = list[tuple[int, frozenset[str]]]


@dataclass
class Holdings:
    """The times (ns) of the messages that a recording has, their numbers, and its states."""

    times: dict[str, set[int]] = field(default_factory=dict)
    numbers: dict[str, set[int]] = field(default_factory=dict)
    states: list[tuple[int, CamState]] = field(default_factory=list)

    def add(self, name: str, log_time: int, number: int, cdr: bytes) -> None:
        """Note a message, if it is of a topic of the rig."""
        if (topic := recorded_topic(name)) is None:
            return
        self.times.setdefault(topic.name, set()).add(log_time)
        self.numbers.setdefault(topic.name, set()).add(number)
        if topic is topics.CAM_STATE:
            try:
                message = read_message(topics.CAM_STATE, cdr)[0]
                self.states.append((number, cam_state_of(message)))
            except RefusedError:  # of a damaged part; it is counted where that is reported
                pass

    def follows(self, scene: SceneConfig) -> bool:
        """Whether every state is one of the scene's; not where an operator overrode it."""
        newest = max((state.time_ns for _, state in self.states), default=0)
        planned = takewhile(lambda state: state.time_ns <= newest, cam_states(scene))
        known = {state.time_ns: state for state in planned}
        return bool(self.states) and all(
            (there := known.get(state.time_ns)) is not None and there.cam == state.cam
            for _, state in self.states
        )


@dataclass(frozen=True)
class Loss:
    """What is missing: each gap in words, how many messages, and where the recording ends.

    ``gaps`` are those that are known; ``open_end`` says that what came after the last message is
    missing too, and it is not known how much; ``ends`` is how far a recording went that was closed
    before its scene was at its end, empty for others.
    """

    gaps: tuple[str, ...] = ()
    messages: int = 0
    open_end: bool = False
    ends: str = ""

    @property
    def words(self) -> str:
        """The gaps as text; empty if there is none."""
        more = [f"{len(self.gaps) - MAX_NAMED} gaps more"] if len(self.gaps) > MAX_NAMED else []
        named = "; ".join([*self.gaps[:MAX_NAMED], *more])
        return f"{named} ({self.messages} messages)" if named else ""


def loss_of(holdings: Holdings, scene: SceneConfig | None, whole: bool, ours: bool) -> Loss:
    """What a recording of a scene (None where it is not known) lacks.

    ``whole``: it was closed, so that nothing was to come after its end; ``ours``: this package
    wrote the file, numbering each topic's messages from 1.
    """
    total = 0 if scene is None else tick_count(scene)
    # What is missing of the rest is counted tick by tick: of a bench's hundred thousand turns, not.
    countable = whole or total <= MAX_COUNTED
    if scene is not None and countable and holdings.follows(scene):
        newest = max(state.time_ns for _, state in holdings.states)
        planned = cam_states(scene)
        if whole:
            planned = takewhile(lambda state: state.time_ns <= newest, planned)
        states = list(enumerate(planned))
        ends, numbered = "", [topic for topic in RECORDING if topic.per in ("instant", "any")]
        if whole and states[-1][0] < total:  # what was never recorded is not lost
            ends = f"it was closed after tick {states[-1][0]} of {total}"
        lacking = _lacking(holdings, list(_moves(states)))
        last = max(holdings.times.get(topics.DIAGNOSTICS.name, {0}))
        open_end, rest = False, not whole and last < states[-1][1].time_ns
    else:
        states = sorted((number - 1, state) for number, state in holdings.states) if ours else []
        known = [move for move in _moves(states) if move[0] == 0 or move[1] is not None]
        lacking = _lacking(holdings, known, only_last=True)  # else by the sequence numbers
        ends, open_end, rest, numbered, total = "", not whole, False, list(RECORDING), 0
    gaps = [_gap_words(run, total) for run in _runs(lacking)]
    if rest:  # the number of them is not known
        gaps.append(f"and {topics.DIAGNOSTICS.name} after {last / 1e9:.6g} s, not counted here")
    count = sum(len(names) for _, names in lacking)
    if ours:
        for topic in numbered:
            there = sorted({0, *(n for n in holdings.numbers.get(topic.name, ()) if n > 0)})
            absent = [range(a + 1, b) for a, b in pairwise(there) if b > a + 1]
            count += sum(len(run) for run in absent)
            gaps += [f"{_range_words('message', run)} of {topic.name}" for run in absent]
    return Loss(tuple(gaps), count, open_end, ends)


def _moves(states: list[tuple[int, CamState]]) -> Iterator[Move]:
    if states:
        yield states[0][0], None, states[0][1]
    for (k, before), (n, state) in pairwise(states):
        yield n, before if n == k + 1 else None, state


def _lacking(holdings: Holdings, moves: list[Move], only_last: bool = False) -> Lacking:
    """What is missing at states; ``only_last`` leaves out topics that have a message later on."""
    newest = {name: max(times) for name, times in holdings.times.items()} if only_last else {}
    found: Lacking = []
    for k, before, state in moves:
        names = frozenset(
            topic.name
            for topic in (topics.CLOCK, *belonging(before, state))
            if state.time_ns not in holdings.times.get(topic.name, ())
            and state.time_ns > newest.get(topic.name, -1)
        )
        if names:
            found.append((k, names))
    return found


def _runs(lacking: Lacking) -> Iterator[Lacking]:
    """Neighbours that lack the same; a new speed's or cam's messages make no difference."""

    def alike(item: tuple[int, tuple[int, frozenset[str]]]) -> tuple[int, frozenset[str] | bool]:
        place, (k, names) = item
        return k - place, _is_all(names) or names

    for _, run in groupby(enumerate(lacking), key=alike):
        yield [entry for _, entry in run]


def _is_all(names: frozenset[str]) -> bool:
    return topics.CAM_STATE.name in names


def _gap_words(run: Lacking, total: int) -> str:
    numbers = range(run[0][0], run[-1][0] + 1)
    names = run[0][1]
    of = f" of {total}" if total else ""
    if numbers.start == 0:
        first = "the first state" if _is_all(names) else f"{', '.join(sorted(names))} at the start"
        rest = run[1:]
        return f"{first}, {_gap_words(rest, total)}" if rest else first
    ticks = _range_words("tick", numbers) + of
    return ticks if _is_all(names) else f"{', '.join(sorted(names))} of {ticks}"


def _range_words(what: str, numbers: range) -> str:
    last = numbers.stop - 1
    return f"{what} {last}" if len(numbers) == 1 else f"{what}s {numbers.start} to {last}"
