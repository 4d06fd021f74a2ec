"""The ring of waiting sweeps: first in, first out, never overwritten, and itself again after a reset."""

import zlib
from collections import deque

import pytest
from cobs import cobs
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule, run_state_machine_as_test

# firmware/README.md: HELLO's ring_capacity. A slot has 3 bytes of its own and fills blocks of 12.
CAPACITY = 3048
SWEEP_OF_13 = 19 + 13 * 8


def slot_bytes(content: bytes) -> int:
    return -(-(3 + len(content) + 4) // 12) * 12


def with_crc(content: bytes) -> bytes:
    return content + zlib.crc32(content).to_bytes(4, "little")


def make_ring_machine(pure_modules) -> type[RuleBasedStateMachine]:
    class Ring(RuleBasedStateMachine):
        def __init__(self):
            super().__init__()
            pure_modules.ask("ring_clear")
            self.waiting: deque[bytes] = deque()

        @rule(content=st.binary(min_size=1, max_size=531))
        def add(self, content):
            fits = sum(map(slot_bytes, self.waiting)) + slot_bytes(content) <= CAPACITY
            assert pure_modules.ask("ring_add", content.hex()) == ("added" if fits else "full")
            if fits:
                self.waiting.append(content)

        @precondition(lambda self: self.waiting)
        @rule()
        def acknowledge(self):
            pure_modules.ask("ring_drop")
            self.waiting.popleft()

        @rule()
        def reset(self):
            pure_modules.ask("ring_recover")

        @precondition(lambda self: self.waiting)
        @rule(bits=st.integers(1, 255), where=st.integers(0, 10_000))
        def damage_the_oldest_and_reset(self, bits, where):
            pure_modules.ask("ring_flip", where % len(with_crc(self.waiting[0])), bits)
            pure_modules.ask("ring_recover")
            self.waiting.popleft()

        @precondition(lambda self: self.waiting)
        @rule(bits=st.integers(1, 255), where=st.integers(0, 10_000))
        def damage_the_oldest_and_sift(self, bits, where):
            assert pure_modules.ask("ring_is_sound") == "1"
            pure_modules.ask("ring_flip", where % len(with_crc(self.waiting[0])), bits)
            assert pure_modules.ask("ring_is_sound") == "0"
            pure_modules.ask("ring_sift")
            self.waiting.popleft()

        @precondition(lambda self: self.waiting)
        @rule()
        def send(self):
            wire = bytes.fromhex(pure_modules.ask("ring_send_oldest"))
            assert wire == cobs.encode(with_crc(self.waiting[0])) + b"\0"

        @invariant()
        def the_oldest_is_the_one_that_has_waited_longest(self):
            frames, used, *oldest = pure_modules.ask("ring_show").split()
            assert int(frames) == len(self.waiting)
            assert int(used) == sum(map(slot_bytes, self.waiting))
            assert oldest == ([with_crc(self.waiting[0]).hex()] if self.waiting else [])

    return Ring


def test_the_ring_behaves_as_a_queue_of_bounded_size(pure_modules):
    run_state_machine_as_test(
        make_ring_machine(pure_modules), settings=settings(max_examples=60, stateful_step_count=60, deadline=None)
    )


def test_23_sweeps_of_13_readings_fit(pure_modules):
    pure_modules.ask("ring_clear")
    answers = [pure_modules.ask("ring_add", bytes([number] * SWEEP_OF_13).hex()) for number in range(24)]
    assert answers == ["added"] * 23 + ["full"]


def test_a_damaged_sweep_between_sound_ones_is_dropped_alone(pure_modules):
    pure_modules.ask("ring_clear")
    contents = [bytes([number] * SWEEP_OF_13) for number in range(1, 4)]
    for content in contents:
        pure_modules.ask("ring_add", content.hex())
    pure_modules.ask("ring_flip", slot_bytes(contents[0]) + 40, 0x10)
    pure_modules.ask("ring_recover")
    assert pure_modules.ask("ring_show").split()[2] == with_crc(contents[0]).hex()
    pure_modules.ask("ring_drop")
    assert pure_modules.ask("ring_show").split()[2] == with_crc(contents[2]).hex()


@pytest.mark.parametrize("part", [0, 1, 2])
def test_a_slot_whose_mark_or_length_is_lost_is_dropped_alone(pure_modules, part):
    pure_modules.ask("ring_clear")
    contents = [bytes([number] * SWEEP_OF_13) for number in range(1, 4)]
    for content in contents:
        pure_modules.ask("ring_add", content.hex())
    pure_modules.ask("ring_flip", slot_bytes(contents[0]) - 3 + part, 0x01)
    pure_modules.ask("ring_recover")
    assert pure_modules.ask("ring_show").split() == [
        "2",
        str(3 * slot_bytes(contents[0])),
        with_crc(contents[0]).hex(),
    ]
    pure_modules.ask("ring_drop")
    assert pure_modules.ask("ring_show").split() == ["1", str(slot_bytes(contents[2])), with_crc(contents[2]).hex()]
