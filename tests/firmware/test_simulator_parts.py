"""The parts around the simulated chip, driven by small programs: sensor and motor."""

import pytest
from firmware.small_programs import Run

PING = """
/* Triggers for this many quarter microseconds, then says whether ECHO rises within 20 ms. */
void main(void) {
    start();
    for (;;) {
        uint8_t quarters = receive();
        uint16_t i;
        uint8_t heard = 0;
        PCA0H = 0; PCA0L = 0;
        P1_1 = 1;
        while (PCA0L < quarters);
        P1_1 = 0;
        for (i = 0; i != 40 && !heard; i++) { wait_us(500); heard = P1_0; }
        while (P1_0);
        send(heard);
    }
}
"""


def test_a_trigger_needs_10_us_to_give_a_ping(running: Run):
    with running(PING) as board:
        assert board.ask(bytes([60]), 1) == b"\x01"
        assert board.ask(bytes([20]), 1) == b"\x00"
        assert board.ask(bytes([60]), 1) == b"\x01"


def test_a_trigger_pin_that_is_not_push_pull_gives_no_ping(running: Run):
    with running(PING.replace("start();", "start(); P1MDOUT = 0x04;")) as board:
        assert board.ask(bytes([60]), 1) == b"\x00"


def test_echo_is_high_for_the_time_of_flight(running: Run):
    program = """
    void main(void) {
        uint16_t rise, fall;
        start();
        PCA0CPM0 = 0x30;
        receive();
        P1_1 = 1; wait_us(15); P1_1 = 0;
        while (!CCF0);
        CCF0 = 0; rise = PCA0CPL0 | PCA0CPH0 << 8;
        while (!CCF0);
        fall = PCA0CPL0 | PCA0CPH0 << 8;
        fall -= rise;
        send(fall); send(fall >> 8);
        for (;;);
    }
    """
    with running(program) as board:
        ticks = int.from_bytes(board.ask(b"g", 2), "little")
    # 2 m there and back at 331.3 + 0.606 * 20 m/s, in ticks of 0.25 us
    assert ticks == pytest.approx(2 / 343.42 * 4e6, abs=1.5)


TURN = """
static const __code uint8_t coils[8] = {0x1, 0x3, 0x2, 0x6, 0x4, 0xC, 0x8, 0x9};
/* Turns down by a full turn and says whether the home switch is closed: the end stop is behind it. */
void main(void) {
    uint16_t i;
    start();
    receive();
    for (i = 4096; i != 0; i--) { P2 = 0xF0 | coils[i & 7]; wait_us(STEP_US); }
    send(!P1_4);
    for (;;);
}
"""


def test_the_motor_turns_to_the_home_switch(running: Run):
    with running(TURN.replace("STEP_US", "2000")) as board:
        assert board.ask(b"g", 1) == b"\x01"


@pytest.mark.parametrize(
    "change",
    [
        pytest.param("start(); P2MDOUT = 0;", id="coils not push-pull"),
        pytest.param("start(); XBR1 = 0x01; XBR1 = 0x01;", id="crossbar off"),
    ],
)
def test_the_motor_does_not_turn_if_the_chip_does_not_drive_it(running: Run, change: str):
    program = TURN.replace("STEP_US", "2000").replace("start();", change)
    program = program.replace("receive();", "XBR1 = 0x41; receive(); XBR1 = SAVED;")
    program = program.replace("SAVED", "0x01" if "XBR1 = 0x01" in change else "0x41")
    program = program.replace("send(!P1_4);", "XBR1 = 0x41; send(!P1_4);")
    with running(program) as board:
        assert board.ask(b"g", 1) == b"\x00"
