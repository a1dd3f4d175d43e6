"""The counts of the ledger against a recount of everything at once."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.emulator import Ledger

PACKETS = st.lists(st.tuples(st.booleans(), st.integers(0, 5)), min_size=1, max_size=60)
"""Whether each packet is hit, and an encoder reset before it (0 of 0 to 5: about one in six)."""


def revolutions_of(packets: list[tuple[bool, int]], per_packet: int, turn: int, first: int) -> list[np.ndarray]:
    at, found = first, []
    for k, (_, reset) in enumerate(packets):
        at += 7 if reset == 0 and k > 0 else 0
        found.append((at + np.arange(per_packet)) // turn)
        at += per_packet
    return found


@pytest.mark.slow
@given(packets=PACKETS, turn=st.integers(11, 40), first=st.integers(0, 39))
@settings(derandomize=True, deadline=None, max_examples=300)
def test_capsules_are_counted_as_a_recount_does(packets: list[tuple[bool, int]], turn: int, first: int) -> None:
    """Five samples a capsule, which need the next; a turn is longer than a gap and a capsule."""
    ledger, numbers = Ledger(), revolutions_of(packets, 5, turn, first)
    resets = [reset == 0 and k > 0 for k, (_, reset) in enumerate(packets)]
    for (hit, _), reset, own in zip(packets, resets, numbers, strict=True):
        ledger.packet(own, not reset, "flipped-bytes" if hit else None)
    ledger.end("stop")

    hits = [hit for hit, _ in packets]
    decoded = [not hits[k] and k + 1 < len(hits) and not hits[k + 1] and not resets[k + 1] for k in range(len(packets))]
    whole = set(range(int(numbers[0][0]) + 1, int(numbers[-1][-1])))
    for k, own in enumerate(numbers):
        if not decoded[k]:
            whole -= set(own.tolist())
        if resets[k]:
            whole -= {int(numbers[k - 1][-1]), int(own[0])}
    lost = ledger.losses
    assert ledger.packets == hits.count(False)
    assert ledger.packets + sum(loss.packets for loss in lost.values()) == len(packets)
    assert ledger.samples == 5 * decoded.count(True)
    assert ledger.samples + sum(loss.samples for loss in lost.values()) == 5 * len(packets)
    assert ledger.revolutions == len(whole)


@given(
    nodes=st.lists(st.lists(st.booleans(), min_size=4, max_size=4), min_size=1, max_size=40), turn=st.integers(5, 30)
)
@settings(derandomize=True, deadline=None, max_examples=200)
def test_nodes_are_counted_as_a_recount_does(nodes: list[list[bool]], turn: int) -> None:
    ledger, lost = Ledger(), np.array(nodes)
    numbers = (np.arange(lost.size) // turn).reshape(lost.shape)
    for own, hit in zip(numbers, lost, strict=True):
        ledger.nodes(own[:, None], follows=True, lost=hit, cause="lost-bytes" if hit.any() else None)
    ledger.end("stop")
    whole = set(range(1, int(numbers[-1, -1]))) - set(numbers[lost].tolist())
    assert ledger.packets == ledger.samples == (~lost).sum()
    assert ledger.revolutions == len(whole)
    if lost.any():
        assert ledger.losses["lost-bytes"].samples == lost.sum()
