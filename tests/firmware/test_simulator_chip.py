"""The simulator's chip, tried with small programs: what the C8051F340 forbids has the chip's consequence here too."""

import random
import re
import socket
import subprocess
import time
from pathlib import Path

import pytest
from firmware.small_programs import PREAMBLE, Compile, Run
from system.processes import PATIENCE_S

SDCC_HEADER = Path("/usr/share/sdcc/include/mcs51/C8051F340.h")


def fault_of(image: Path, *options: str) -> str:
    """The words with which a simulation that must fail does."""
    command = ["noctule-sim", "--firmware", str(image), "--tcp", "127.0.0.1:0", "--speed", "max", "--duration", "1"]
    ended = subprocess.run([*command, *options], capture_output=True, text=True, timeout=120)
    assert ended.returncode != 0, ended.stdout
    return ended.stderr


def test_an_sfr_without_a_model_is_fatal_and_named_with_unit_and_place(compiled: Compile):
    words = fault_of(compiled(PREAMBLE + "void main(void) { start(); P1 = USB0ADR; for (;;); }"))
    assert re.search(r"unit 1: SFR 0x96 \(USB0ADR\) read is not modelled \(PC 0x[0-9A-F]{4}, tick \d+", words), words


def test_a_function_of_a_modelled_sfr_without_a_model_is_fatal(compiled: Compile):
    assert "bits 0x08 are not modelled" in fault_of(compiled(PREAMBLE + "void main(void) { TMR3CN = 0x08; }"))


def test_the_multiplied_clock_before_it_is_ready_is_fatal(compiled: Compile):
    assert "before MULRDY" in fault_of(compiled(PREAMBLE + "void main(void) { CLKSEL = 3; }"))


def test_the_readme_holds_the_table_of_registers_that_the_simulator_enforces():
    printed = subprocess.run(["noctule-sim", "--registers"], capture_output=True, text=True, check=True).stdout
    readme = (Path(__file__).parents[2] / "firmware" / "simulator" / "README.md").read_text()
    table = readme.partition("<!-- registers -->\n")[2].partition("<!-- registers end -->")[0]
    assert table.split() == printed.split()  # a README wraps its lines


def test_registers_are_where_sdccs_header_has_them_with_the_bits_that_it_names():
    printed = subprocess.run(["noctule-sim", "--registers"], capture_output=True, text=True, check=True).stdout
    rows = re.findall(r"^\| (\w+) \| 0x(..) \| (.*?) \|", printed, re.MULTILINE)
    here = {name: int(address, 16) for name, address, _ in rows}
    header = SDCC_HEADER.read_text()
    there = {name: int(address, 16) for address, name in re.findall(r"__sfr __at \(0x(..)\) (\w+)", header)}
    assert len(here) > 80
    assert here == {name: there[name] for name in here}

    # The header names the bits of the registers whose bits have addresses, too.
    bits = {name: int(address, 16) & 0xF8 for address, name in re.findall(r"__sbit __at \(0x(..)\) (\w+)", header)}
    named = [(register, bit) for register, _, words in rows for bit in words.split(", ") if bit in bits]
    assert len(named) > 30
    assert [here[register] for register, _ in named] == [bits[bit] for _, bit in named]


def test_a_fault_in_one_of_several_units_names_it(compiled: Compile):
    words = fault_of(compiled(PREAMBLE + "void main(void) { P1 = USB0ADR; }"), "--units", "3")
    assert words.startswith("noctule-sim: unit 1: ")


def test_a_watchdog_that_is_not_fed_resets_the_chip_and_xram_survives(running: Run):
    program = """
    __xdata __at(0x800) uint8_t kept[4];
    void main(void) {
        uint8_t cause = RSTSRC;
        start();
        if (cause == 0x08) { /* after a power-up the bit means nothing */
            send(cause); send(kept[0]); send(kept[3]);
            for (;;);
        }
        receive();
        kept[0] = 0x5A; kept[3] = 0xC3;
        PCA0CPL4 = 0xFF;
        PCA0MD = 0x40;
        PCA0CPH4 = 0;
        for (;;);
    }
    """
    with running(program) as board:
        assert board.ask(b"g", 3) == bytes([0x08, 0x5A, 0xC3])


FLASH = """
__xdata uint8_t dummy;
void poke(uint16_t address, uint8_t value, uint8_t mode) {
    FLKEY = 0xA5; FLKEY = 0xF1;
    PSCTL = mode;
    *(__xdata uint8_t *)address = value;
    PSCTL = 0;
}
uint8_t peek(uint16_t address) { return *(__code uint8_t *)address; }
void main(void) {
    uint8_t cause = RSTSRC;
    start();
    if (cause & 0x40) { send(cause); for (;;); }
    MONITOR
    receive();
    poke(0xF400, 0x0F, 1); send(peek(0xF400));
    poke(0xF400, 0xF5, 1); send(peek(0xF400));
    poke(0xF5FF, 0x00, 3); send(peek(0xF400));
    FLKEY = 0xF1;
    poke(0xF400, 0x0F, 1); send(peek(0xF400));
    for (;;);
}
"""


def test_flash_is_written_with_keys_erased_by_the_page_and_locked_by_a_wrong_key(running: Run):
    with running(FLASH.replace("MONITOR", "VDM0CN = 0x80; wait_us(150); RSTSRC = 0x02;")) as board:
        assert board.ask(b"g", 4) == bytes([0x0F, 0x05, 0xFF, 0xFF])


def test_a_flash_write_without_the_supply_monitor_resets_the_chip(running: Run):
    with running(FLASH.replace("MONITOR", "")) as board:
        assert board.ask(b"g", 1) == bytes([0x40])


def test_the_temperature_sensor_tells_the_warmth_of_the_die(running: Run):
    program = """
    void main(void) {
        start();
        P1MDIN = 0xDF; P1SKIP = 0x20; /* VREF */
        REF0CN = 0x07; AMX0P = 0x1E; AMX0N = 0x1F;
        ADC0CF = 15 << 3; AD0EN = 1;
        wait_ms(3);
        receive();
        AD0BUSY = 1;
        while (!AD0INT);
        send(ADC0L); send(ADC0H);
        for (;;);
    }
    """
    with running(program) as board:
        code = int.from_bytes(board.ask(b"g", 2), "little")
    # 776 mV + 2.86 mV/K, 3 K above the air's 20 degrees, against 2.44 V: the chip's own errors come to 24 mV or so
    assert code * 2.44 / 1024 == pytest.approx(0.776 + 0.00286 * 23.0, abs=0.04)


def test_bytes_that_nobody_takes_in_time_are_lost(running: Run):
    program = """
    void main(void) {
        uint8_t first;
        start();
        first = receive();
        wait_ms(2);
        send(first); send(SBUF0); send(RI0);
        for (;;);
    }
    """
    with running(program) as board:
        assert board.ask(b"xyz", 3) == b"xy\x01"


def test_a_high_priority_interrupt_breaks_into_a_low_one(running: Run):
    program = """
    volatile __xdata uint8_t order[4];
    volatile uint8_t count;
    void slow(void) __interrupt(5) { TF2H = 0; TR2 = 0; order[count++] = 'a'; wait_us(3000); order[count++] = 'b'; }
    void fast(void) __interrupt(14) { TMR3CN = 0; order[count++] = 'c'; }
    void main(void) {
        start();
        receive();
        TMR2RL = 65536 - 4000; TMR2 = 65536 - 4000;
        TMR3RL = 65536 - 8000; TMR3 = 65536 - 8000;
        EIP1 = PRIORITY; EIE1 = 0x80; ET2 = 1; EA = 1;
        TMR2CN = 0x04; TMR3CN = 0x04;
        while (count != 3) PCON |= 1;
        send(order[0]); send(order[1]); send(order[2]);
        for (;;);
    }
    """
    with running(program.replace("PRIORITY", "0x80")) as board:
        assert board.ask(b"g", 3) == b"acb"
    with running(program.replace("PRIORITY", "0x00")) as board:
        assert board.ask(b"g", 3) == b"abc"


ARITHMETIC = """
__xdata __at(0x000) uint8_t results[256];
static uint8_t at;
static void keep(uint32_t value) { results[at++] ^= value; results[at++] ^= value >> 8;
                                   results[at++] ^= value >> 16; results[at++] ^= value >> 24; }
static void flags(uint8_t a, uint8_t b) {
    a; b;
    __asm
        mov a,dpl
        mov b,a
        clr c
        add a,_flags_PARM_2
        mov _flag_bytes,psw
        mov a,b
        subb a,_flags_PARM_2
        mov _flag_bytes+1,psw
        mov a,b
        addc a,_flags_PARM_2
        da a
        mov _flag_bytes+2,psw
        mov acc,b
        push psw
        pop _flag_bytes+3
    __endasm;
}
__data uint8_t flag_bytes[4];
static uint32_t state = SEED;
static uint32_t next(void) { state ^= state << 13; state ^= state >> 17; state ^= state << 5; return state; }

void compute(void) {
    uint16_t round;
    uint8_t i;
    for (i = 0; i != 255; i++) results[i] = 0;
    results[255] = 0;
    for (round = 0; round != 200; round++) {
        uint32_t a = next(), b = next();
        int16_t c = a, d = b;
        keep(a * b); keep(b ? a / (b >> 16 | 1) : 0); keep(a % (b >> 8 | 1)); keep(a << (b & 31));
        keep((int32_t)a >> (b & 15)); keep(c / (d | 1)); keep(c % (d | 1)); keep((uint32_t)((float)c * d));
        keep(c < d); keep((int8_t)a < (int8_t)b);
        flags(a, b);
        for (i = 0; i != 4; i++) keep(flag_bytes[i]);
    }
}
"""


def test_the_cpu_computes_what_ucsim_computes(compiled: Compile, running: Run):
    program = ARITHMETIC.replace("SEED", f"0x{random.Random(1).getrandbits(32) | 1:08X}UL")
    alone = "#include <stdint.h>\n#include <8052.h>\n" + program
    image = compiled(alone + "void done(void) { for (;;); } void main(void) { compute(); done(); }")
    done = re.search(r"0000([0-9A-F]{4})  _done\b", image.with_suffix(".map").read_text())
    assert done
    commands = f"tbreak 0x{done[1]}\nrun\ndump xram 0 255\nquit\n"
    said = subprocess.run(["s51", "-t", "52", image], input=commands, capture_output=True, text=True, timeout=120)
    lines = re.findall(r"^0x00([0-9a-f]{2}) +((?:[0-9a-f]{2} )+)", said.stdout, re.MULTILINE)
    expected = {
        int(address, 16) + offset: int(byte, 16) for address, row in lines for offset, byte in enumerate(row.split())
    }
    assert len(expected) == 256, said.stdout[-2000:]

    report = (
        "void main(void) { uint16_t i; start(); receive(); compute(); for (i = 0; i != 256; i++) send(results[i]); }"
    )
    with running(program + report) as board:
        dump = board.ask(b"g", 256)
    assert dump == bytes(expected[address] for address in range(256))


def test_a_second_client_is_turned_away_and_the_first_goes_on(running: Run):
    with running("void main(void) { start(); for (;;) send(receive() + 1); }") as board:
        assert board.ask(b"a", 1) == b"b"
        second = socket.create_connection(board.connection.getpeername())
        with second:
            second.settimeout(PATIENCE_S)
            assert second.recv(1) == b""
        assert board.ask(b"c", 1) == b"d"


def test_a_client_may_come_again(running: Run):
    with running("void main(void) { start(); for (;;) send(receive() + 1); }") as board:
        address = board.connection.getpeername()
        assert board.ask(b"a", 1) == b"b"
        board.connection.shutdown(socket.SHUT_RDWR)
        deadline = time.monotonic() + PATIENCE_S
        answer = b""
        while answer != b"c" and time.monotonic() < deadline:
            with socket.create_connection(address) as again:
                again.sendall(b"b")
                again.settimeout(PATIENCE_S)
                answer = again.recv(1)
        assert answer == b"c"
