"""Each fault does what it says, and the ledger agrees with what a decoder makes of the bytes."""

import numpy as np
import pytest
from emulator_line import HEALED, angles_of, listen, make, ranges_of

from drivers.rplidar import Join
from drivers.rplidar.protocol.requests import express_scan
from sim.emulator import FAULTS

SECONDS = {"unplug": 40.0, "protection-stop": 40.0, "stall": 24.0, "encoder-reset": 24.0}
SENSITIVITY, DENSE_BOOST = 3, 1


@pytest.mark.slow
@pytest.mark.parametrize("name", [*FAULTS, "all"])
def test_the_ledger_agrees_with_the_decoder(name: str) -> None:
    """Packets, samples, restarts and dropped bytes to the last one."""
    device = make(faults=tuple(FAULTS) if name == "all" else (name,))
    heard = listen(device, DENSE_BOOST, 60.0 if name == "all" else SECONDS.get(name, 14.0))
    ledger = device.ledger
    losses = ledger.losses
    assert heard.counts.packets == ledger.packets > 1000
    assert heard.total == ledger.samples
    assert heard.counts.dropped_bytes == sum(loss.debris for loss in losses.values())
    resets = losses["encoder-reset"].events if "encoder-reset" in losses else 0
    # The capsule that tells of a reset may be hit itself.
    assert resets - (name == "all") <= heard.counts.restarts <= resets
    assert heard.counts.discontinuities == 0
    gaps = sum(part.join is Join.GAP for part in heard.samples)
    assert gaps <= sum(loss.packets for loss in losses.values())
    if name in FAULTS and np.isfinite(FAULTS[name][0]):
        assert losses[name].events > 0, "it struck"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["flipped-bytes", "lost-bytes", "encoder-reset"])
def test_the_ledger_agrees_with_the_decoder_of_ultra_capsules(name: str) -> None:
    device = make("A3", faults=(name,))
    heard = listen(device, SENSITIVITY, 22.0)
    assert heard.counts.packets == device.ledger.packets > 1000
    assert heard.total == device.ledger.samples


@pytest.mark.slow
@pytest.mark.parametrize("name", ["flipped-bytes", "lost-bytes"])
def test_standard_nodes_are_lost_one_by_one(name: str) -> None:
    """Nodes have no checksum: a decoder takes a damaged one, or a false one, for good; some wait for the next bytes."""
    device = make("A1", faults=(name,))
    heard = listen(device, 0, 24.0)
    loss = device.ledger.losses[name]
    assert loss.events > 5
    assert loss.samples == loss.packets < 5 * loss.events
    assert abs(heard.counts.packets - device.ledger.packets) <= loss.packets + 16


def test_split_reads_split_and_lose_nothing() -> None:
    whole, split = (listen(make(faults=faults), DENSE_BOOST, 8.0) for faults in ((), ("split-reads",)))
    assert max(map(len, split.data)) <= 16
    assert b"".join(whole.data).startswith(b"".join(split.data)[:-84])
    assert np.diff(split.arrivals).min() >= 0.0


def test_zero_sectors_return_nothing_and_nothing_else_is_lost() -> None:
    device = make(faults=("zero-sectors",))
    heard = listen(device, DENSE_BOOST, 14.0)
    gone = ranges_of(heard.samples) == 0.0
    assert 10 / 360 * 0.9 < gone.mean() < 60 / 360 * 1.1
    # The last capsule was sent and cannot be decoded.
    assert 0 <= device.ledger.losses["zero-sectors"].samples - gone.sum() <= 40
    sector = np.degrees(angles_of(heard.samples)[: 40 * 24][gone[: 40 * 24]])
    assert min(np.ptp(sector), np.ptp((sector + 180.0) % 360.0)) < 61.0


@pytest.mark.slow
def test_speed_changes_stay_within_a_fifth() -> None:
    heard = listen(make(faults=("speed-change",)), DENSE_BOOST, 30.0)
    starts = np.array([int.from_bytes(data[2:4], "little") & 0x7FFF for data in heard.data if len(data) == 84]) / 64.0
    speeds = np.diff(starts) % 360.0 / (3600.0 * 4320e-6)
    assert 0.78 < speeds.min() < 0.99
    assert 1.01 < speeds.max() < 1.22


@pytest.mark.slow
def test_a_stalled_host_gets_all_it_can_keep_at_once() -> None:
    """2 s of an S1 are 39 kB, those of an S2 are 170 kB, of which 64 KiB are kept."""
    heard = listen(make(faults=("stall",)), DENSE_BOOST, 30.0)
    arrivals = np.array(heard.arrivals)
    assert np.diff(arrivals).max() == pytest.approx(2.0, abs=0.01)
    assert (np.diff(arrivals) == 0.0).sum() > 400
    device = make("S2", faults=("stall",))
    device.write(express_scan(1), 0.0)
    assert sum(len(data) for _, data in device.chunks(30.0)) > 1000000
    loss = device.ledger.losses["stall"]
    assert loss.events > 0
    assert loss.bytes == pytest.approx(loss.events * (2.0 * 85000 - 65536), rel=0.01)
    assert loss.packets == loss.bytes / 170
    assert loss.revolutions == pytest.approx(loss.bytes / 8500, abs=2 * loss.events)


@pytest.mark.slow
def test_an_encoder_reset_costs_a_part_of_a_turn() -> None:
    device = make(faults=("encoder-reset",))
    heard = listen(device, DENSE_BOOST, 40.0)
    loss = device.ledger.losses["encoder-reset"]
    assert loss.events <= loss.revolutions <= 2 * loss.events
    assert loss.samples == 40 * loss.events, "the capsule before has no next one"
    gaps = np.diff(heard.arrivals[1:])
    assert ((gaps > 0.02) & (gaps < 0.1)).sum() == loss.events


@pytest.mark.slow
def test_faults_of_a_kind_come_at_the_same_times_whichever_others_are_on() -> None:
    alone, mixed = make(faults=("flipped-bytes",)), make(faults=("flipped-bytes", "split-reads", "lost-bytes"))
    for device in (alone, mixed):
        listen(device, DENSE_BOOST, HEALED + 12.0)
    assert alone.ledger.losses["flipped-bytes"].events == mixed.ledger.losses["flipped-bytes"].events > 2
