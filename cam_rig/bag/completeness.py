"""Search for missing messages of a recording.

A recording is compared with its scene (the planned run: cams and speeds). If the scene is not known
or was not followed, it is compared with its recorded cam states and with the sequence numbers of
its messages. A tick is the time between two successive cam states. The ticks of a scene and the
messages of a topic are counted from 1.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
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

# Check that a bag contains every message of every tick of its scene.


def require_complete(bag: Path, scene: SceneConfig) -> dict[str, int]:
    """Check that no message is missing in a bag, and return its messages per topic.

    The key of the result is the name of the topic. Raises BagError if the bag has fewer cam states
    than its scene plans, or if a topic does not have one message for each recorded state, tick,
    speed or cam, as its entry in the table of topics requires. A tick is the time between two cam
    states.
    """
    counts = read_counts(bag)
    states = [state for _, state in decoded(bag, {topics.CAM_STATE: cam_state_of})]
    if len(states) <= tick_count(scene):
        raise BagError(
            f"{bag}: must have {tick_count(scene) + 1} cam states, as its scene, got {len(states)}"
        )
    expected = expected_counts(states)
    for topic in RECEIVED:
        if topic.per in expected and counts.get(topic.name, 0) != expected[topic.per]:
            raise BagError(
                f"{bag}: {topic.name} must have {expected[topic.per]} messages, one per "
                f"{topic.per}, got {counts.get(topic.name, 0)}"
            )
    return counts


def belonging(before: CamState | None, state: CamState) -> tuple[Topic, ...]:
    """Return the topics that have a message at the time of a cam state.

    `before` is the previous state, or None for the first. A topic with one message per cam or per
    speed is included only if the cam or the speed has changed.
    """
    current = occasions(before, state)
    return tuple(topic for topic in RECEIVED if topic.per in current)


def expected_counts(states: list[CamState]) -> dict[str, int]:
    """Return the number of ticks, states, cams and speeds in a series of cam states.

    A tick is the time between two cam states. The keys of the result are the values of `Topic.per`,
    the occasion of a topic's messages. The number is that of the messages that each topic with this
    value must have.
    """
    moves = zip([None, *states], states, strict=False)
    counts = Counter(per for move in moves for per in occasions(*move))
    return {per: counts[per] for per in ("tick", "state", "cam", "speed")}


#: Largest number of ticks (times between two cam states) of a scene for which the ticks missing at
#: the end of an unclosed recording are counted one by one. For a longer scene this takes too long,
#: and the loss at the end is reported without a number.
MAX_COUNTED = 100_000
#: Largest number of gaps that a text on missing messages lists. For further gaps it only states
#: their number.
MAX_NAMED = 6
#: Step from one cam state to the next: number of the second state (0 for the first state of the
#: run), the state before it (None if it is not known), and the second state.
Move = tuple[int, CamState | None, CamState]
#: Cam states at which messages are missing: number of the state, and names of the topics without a
#: message at its time.
MissingMessages = list[tuple[int, frozenset[str]]]


@dataclass
class Holdings:
    """Times (ns), sequence numbers and cam states of the messages in a recording.

    `times` and `numbers` are those of the messages by topic name. `states` contains each cam state
    with the sequence number of its message. `loss_of` determines the missing messages from them.
    """

    times: dict[str, set[int]] = field(default_factory=dict)
    numbers: dict[str, set[int]] = field(default_factory=dict)
    states: list[tuple[int, CamState]] = field(default_factory=list)

    def add(self, name: str, log_time: int, number: int, cdr: bytes) -> None:
        """Add a message if its topic belongs to the rig.

        `name` is the topic, `log_time` is in ns, `number` is the sequence number, and `cdr` the
        serialized message. Messages of other topics are ignored.
        """
        if (topic := recorded_topic(name)) is None:
            return
        self.times.setdefault(topic.name, set()).add(log_time)
        self.numbers.setdefault(topic.name, set()).add(number)
        if topic is topics.CAM_STATE:
            try:
                message = read_message(topics.CAM_STATE, cdr)[0]
                self.states.append((number, cam_state_of(message)))
            except RefusedError:  # from damaged bytes, which the reader reports
                pass

    def follows(self, scene: SceneConfig) -> bool:
        """Return True if every recorded cam state is a state of the scene.

        Times and cams of the states are compared. The result is False if an operator has changed
        the speed or the cam during the run, or if no state was recorded.
        """
        newest = max((state.time_ns for _, state in self.states), default=0)
        planned = takewhile(lambda state: state.time_ns <= newest, cam_states(scene))
        by_time = {state.time_ns: state for state in planned}
        return bool(self.states) and all(
            (match := by_time.get(state.time_ns)) is not None and match.cam == state.cam
            for _, state in self.states
        )


@dataclass(frozen=True)
class Loss:
    """Missing messages of a recording.

    `gaps` contains the known gaps as text, and `messages` the number of missing messages.
    `open_end` is True if an unknown number of messages is missing after the last recorded message.
    `ends` is a text on the last recorded tick (time between two cam states) if the recording was
    closed before the end of its scene, otherwise empty.
    """

    gaps: tuple[str, ...] = ()
    messages: int = 0
    open_end: bool = False
    ends: str = ""

    @property
    def text(self) -> str:
        """Known gaps of a recording as text, empty if there is no gap."""
        more = [f"{len(self.gaps) - MAX_NAMED} further gaps"] if len(self.gaps) > MAX_NAMED else []
        named = "; ".join([*self.gaps[:MAX_NAMED], *more])
        return f"{named} ({self.messages} messages)" if named else ""


def loss_of(holdings: Holdings, scene: SceneConfig | None, closed: bool, own: bool) -> Loss:
    """Return the missing messages of a recording.

    `holdings` describes the messages that the recording contains. `scene` is None if it is not
    known. `closed` is True if the recording was closed, so that nothing is missing after its end.
    `own` is True if this package wrote the file, with the messages of each topic numbered from 1.
    """
    # The missing end is counted tick by tick, which takes too long for the hundred thousand turns
    # of a long scene.
    is_countable = scene is not None and (closed or tick_count(scene) <= MAX_COUNTED)
    if scene is not None and is_countable and holdings.follows(scene):
        loss = _loss_by_scene(holdings, scene, closed)
        numbered = [topic for topic in RECORDING if topic.per in ("instant", "any")]
    else:
        loss = _loss_by_states(holdings, closed, own)
        numbered = list(RECORDING)
    gaps, count = list(loss.gaps), loss.messages
    for topic in numbered if own else ():
        present = sorted({0, *(n for n in holdings.numbers.get(topic.name, ()) if n > 0)})
        absent = [range(a + 1, b) for a, b in pairwise(present) if b > a + 1]
        count += sum(len(run) for run in absent)
        gaps += [f"{_range_words('message', run)} of {topic.name}" for run in absent]
    return replace(loss, gaps=tuple(gaps), messages=count)


def _loss_by_scene(holdings: Holdings, scene: SceneConfig, closed: bool) -> Loss:
    """Return the missing messages, by a comparison with the cam states of the scene.

    Each topic must have its messages at the times of the planned states. If the recording was
    closed, planned states after its newest state are not missing, because the run was stopped
    there.
    """
    newest, total = max(state.time_ns for _, state in holdings.states), tick_count(scene)
    planned = cam_states(scene)
    if closed:
        planned = takewhile(lambda state: state.time_ns <= newest, planned)
    states = list(enumerate(planned))
    last_tick, last_state = states[-1]
    missing = _missing_messages(holdings, list(_moves(states)))
    gaps = [_gap_words(run, total) for run in _runs(missing)]
    last_ns = max(holdings.times.get(topics.DIAGNOSTICS.name, {0}))
    if not closed and last_ns < last_state.time_ns:  # how many are missing is unknown
        gaps.append(f"{topics.DIAGNOSTICS.name} after {last_ns / 1e9:.6g} s (not counted)")
    ends = f"it was closed after tick {last_tick} of {total}" if last_tick < total else ""
    return Loss(tuple(gaps), sum(len(names) for _, names in missing), ends=ends)


def _loss_by_states(holdings: Holdings, closed: bool, own: bool) -> Loss:
    """Return the messages missing at the end of a recording, from its cam states.

    A topic must have its messages at the recorded states that follow its newest message. The caller
    finds all other gaps from the sequence numbers. The parameters are those of `loss_of`.
    """
    states = sorted((number - 1, state) for number, state in holdings.states) if own else []
    moves = [move for move in _moves(states) if move[0] == 0 or move[1] is not None]
    missing = _missing_messages(holdings, moves, only_last=True)
    gaps = tuple(_gap_words(run, 0) for run in _runs(missing))
    return Loss(gaps, sum(len(names) for _, names in missing), open_end=not closed)


def _moves(states: list[tuple[int, CamState]]) -> Iterator[Move]:
    if states:
        yield states[0][0], None, states[0][1]
    for (k, before), (n, state) in pairwise(states):
        yield n, before if n == k + 1 else None, state


def _missing_messages(
    holdings: Holdings, moves: list[Move], only_last: bool = False
) -> MissingMessages:
    """Return the cam states at which messages are missing, with their topics.

    `moves` contains the states to check, each with the state before it. If `only_last` is True, a
    topic is reported only at states after its newest message.
    """
    newest = {name: max(times) for name, times in holdings.times.items()} if only_last else {}
    missing: MissingMessages = []
    for k, before, state in moves:
        names = frozenset(
            topic.name
            for topic in (topics.CLOCK, *belonging(before, state))
            if state.time_ns not in holdings.times.get(topic.name, ())
            and state.time_ns > newest.get(topic.name, -1)
        )
        if names:
            missing.append((k, names))
    return missing


def _runs(missing: MissingMessages) -> Iterator[MissingMessages]:
    """Group the missing messages by successive cam states that lack the same topics.

    Each group becomes one entry of a text, such as "ticks 3 to 7". States without any message form
    one group, even if a new speed or cam requires additional messages. A tick is the time between
    two cam states.
    """

    def run_key(item: tuple[int, tuple[int, frozenset[str]]]) -> tuple[int, frozenset[str] | bool]:
        index, (k, names) = item
        return k - index, _is_all(names) or names

    for _, run in groupby(enumerate(missing), key=run_key):
        yield [entry for _, entry in run]


def _is_all(names: frozenset[str]) -> bool:
    return topics.CAM_STATE.name in names


def _gap_words(run: MissingMessages, total: int) -> str:
    numbers = range(run[0][0], run[-1][0] + 1)
    names = run[0][1]
    total_text = f" of {total}" if total else ""
    if numbers.start == 0:
        first = "the first state" if _is_all(names) else f"{', '.join(sorted(names))} at the start"
        remainder = run[1:]
        return f"{first}, {_gap_words(remainder, total)}" if remainder else first
    ticks = _range_words("tick", numbers) + total_text
    return ticks if _is_all(names) else f"{', '.join(sorted(names))} of {ticks}"


def _range_words(noun: str, numbers: range) -> str:
    last = numbers.stop - 1
    return f"{noun} {last}" if len(numbers) == 1 else f"{noun}s {numbers.start} to {last}"
