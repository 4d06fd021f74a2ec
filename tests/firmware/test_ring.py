"""The ring of waiting sweeps: first in, first out, never overwritten; only what memory spoils is dropped."""

import zlib
from dataclasses import dataclass

import pytest
from cobs import cobs
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, precondition, rule, run_state_machine_as_test

# firmware/README.md: HELLO's ring_capacity. A slot has 3 bytes of its own and fills blocks of 12 bytes: there are 255.
CAPACITY = 3048
BLOCK_BYTES = 12
MEMORY_BYTES = 255 * BLOCK_BYTES
SWEEP_OF_13 = 19 + 13 * 8
SWEEP_OF_64 = 19 + 64 * 8
SWEEPS_OF_13_THAT_FIT = 23
# firmware/src/core/ring.c: one call skips up to 64 blocks or adds 128 bytes to a CRC. At worst each block looks like
# a frame that fills the ring.
MOST_CALLS = 255 * (CAPACITY // 128 + 2)


def slot_bytes(content: bytes) -> int:
    return -(-(3 + len(content) + 4) // BLOCK_BYTES) * BLOCK_BYTES


def with_crc(content: bytes) -> bytes:
    return content + zlib.crc32(content).to_bytes(4, "little")


@dataclass
class Slot:
    """A frame in the ring; ``start`` is where its slot begins."""

    content: bytes
    start: int
    spoiled: bool = False


def make_ring_machine(pure_modules) -> type[RuleBasedStateMachine]:
    class Ring(RuleBasedStateMachine):
        def __init__(self):
            super().__init__()
            pure_modules.ask("ring_clear")
            self.slots: list[Slot] = []
            self.next = 0
            self.found = False  # the oldest: it could be sent, and then be acknowledged

        @rule(content=st.binary(min_size=1, max_size=SWEEP_OF_64))
        def add(self, content):
            used = int(pure_modules.ask("ring_show").split()[1])
            fits = used + slot_bytes(content) <= CAPACITY
            assert pure_modules.ask("ring_add", content.hex()) == ("added" if fits else "full")
            if fits:
                self.slots.append(Slot(content, self.next))
                self.next = (self.next + slot_bytes(content)) % MEMORY_BYTES

        @precondition(lambda self: self.found)
        @rule()
        def acknowledge(self):
            pure_modules.ask("ring_drop")
            del self.slots[0]
            self.found = False

        @rule()
        def reset(self):
            pure_modules.ask("ring_recover")
            self.found = False

        @precondition(lambda self: not all(slot.spoiled for slot in self.slots))
        @rule(bits=st.integers(1, 255), where=st.integers(0, 10_000), which=st.integers(0, 300))
        def spoil(self, bits, where, which):
            sound = [slot for slot in self.slots if not slot.spoiled]
            slot = sound[which % len(sound)]
            offset = where % (3 + len(slot.content) + 4)
            pure_modules.ask("ring_flip", (slot.start + offset) % MEMORY_BYTES, bits)
            slot.spoiled = True

        @rule()
        def seek_for_one_round(self):
            # No longer found is what has been spoiled since.
            self.found = pure_modules.ask("ring_seek", 1).startswith("found")
            if self.found:
                self.drop_spoiled()

        @rule()
        def seek_and_send(self):
            answer = pure_modules.ask("ring_seek", MOST_CALLS).split()
            self.drop_spoiled()
            assert answer[0] == ("found" if self.slots else "empty")
            self.found = bool(self.slots)
            frames, used, *oldest = pure_modules.ask("ring_show").split()
            assert int(used) == sum(slot_bytes(slot.content) for slot in self.slots)
            assert oldest == [with_crc(slot.content).hex() for slot in self.slots[:1]]
            if not any(slot.spoiled for slot in self.slots):
                assert int(frames) == len(self.slots)
            if self.slots:
                wire = bytes.fromhex(pure_modules.ask("ring_send_oldest"))
                assert wire == cobs.encode(with_crc(self.slots[0].content)) + b"\0"

        def drop_spoiled(self):
            while self.slots and self.slots[0].spoiled:
                del self.slots[0]

    return Ring


def test_the_ring_behaves_as_a_queue_of_bounded_size_that_leaves_out_what_is_spoiled(pure_modules):
    run_state_machine_as_test(
        make_ring_machine(pure_modules), settings=settings(max_examples=60, stateful_step_count=60)
    )


def fill(pure_modules, length: int) -> list[bytes]:
    """Fills an empty ring with frames of so many bytes."""
    pure_modules.ask("ring_clear")
    contents: list[bytes] = []
    while pure_modules.ask("ring_add", (content := bytes([len(contents) + 1] * length)).hex()) == "added":
        contents.append(content)
    return contents


def deliver_all(pure_modules) -> list[bytes]:
    """The frames that the ring gives out, one after the other, until it is empty."""
    delivered = []
    while pure_modules.ask("ring_seek", MOST_CALLS).startswith("found"):
        delivered.append(bytes.fromhex(pure_modules.ask("ring_show").split()[2]))
        pure_modules.ask("ring_drop")
    assert pure_modules.ask("ring_show").split() == ["0", "0"]
    return delivered


def test_23_sweeps_of_13_readings_fit(pure_modules):
    assert len(fill(pure_modules, SWEEP_OF_13)) == SWEEPS_OF_13_THAT_FIT


# Bytes 0 to 2 of a slot are its mark and its length; with 0x02 in byte 2 the length reaches over the next slots.
@pytest.mark.parametrize("recovers", [False, True])
@pytest.mark.parametrize("spoiled", [[0], [22], [5, 6, 11, 17], list(range(23))], ids=len)
@pytest.mark.parametrize(
    ("byte", "bits"), [(0, 0xFF), (1, 0x01), (1, 0x80), (2, 0x02), (2, 0x08), (2, 0x80), (40, 0x10)]
)
def test_of_a_full_ring_all_is_delivered_in_order_but_the_spoiled(pure_modules, byte, bits, spoiled, recovers):
    contents = fill(pure_modules, SWEEP_OF_13)
    for number in spoiled:
        pure_modules.ask("ring_flip", number * slot_bytes(contents[0]) + byte, bits)
    if recovers:
        pure_modules.ask("ring_recover")
    sound = [with_crc(content) for number, content in enumerate(contents) if number not in spoiled]
    assert deliver_all(pure_modules) == sound


def test_a_reset_between_two_rounds_of_the_search_loses_nothing(pure_modules):
    contents = fill(pure_modules, SWEEP_OF_64)
    pure_modules.ask("ring_flip", 50, 0x10)
    calls = 0
    while pure_modules.ask("ring_seek", calls + 1) == "seeking":
        calls += 1
        pure_modules.ask("ring_recover")
    assert calls >= -(-SWEEP_OF_64 // 128)
    assert deliver_all(pure_modules) == [with_crc(content) for content in contents[1:]]


def test_a_frame_acknowledged_after_its_length_was_spoiled_takes_no_other_with_it(pure_modules):
    contents = fill(pure_modules, SWEEP_OF_13)
    assert pure_modules.ask("ring_seek", MOST_CALLS).startswith("found")
    pure_modules.ask("ring_flip", 2, 0x02)
    pure_modules.ask("ring_drop")
    assert deliver_all(pure_modules) == [with_crc(content) for content in contents[1:]]
