"""Of nodes that do not answer, the one that holds the others."""

from itertools import combinations

from cam_rig.runner.node_table import NODES, held_by

ORDER = ["law_server", "follower", "microphone", "viewer", "recorder"]


def test_the_first_of_the_chain_is_named_before_those_behind_it():
    """Whichever of them do not answer, in whatever order they are given."""
    assert [entry.name for entry in reversed(NODES)][1:] == ORDER
    assert held_by(["recorder"]) == "recorder"
    for number in range(2, len(ORDER) + 1):
        for names in combinations(ORDER, number):
            words = f"{names[0]}, and behind it {', '.join(names[1:])}"
            assert held_by(names) == held_by(names[::-1]) == words
