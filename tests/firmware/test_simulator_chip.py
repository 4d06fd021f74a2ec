"""The simulator's chip, tried with small programs: what the C8051F340 forbids has the chip's consequence here too."""

import random
import re
import select
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest
from system.processes import PATIENCE_S

# 48 MHz, UART0 at 115385 baud on its pins, the watchdog off: what any program needs before it can say something.
PREAMBLE = """
#include <C8051F340.h>
#include <stdint.h>

uint8_t __sdcc_external_startup(void) { PCA0MD &= ~0x40; return 0; }

void send(uint8_t byte) { SBUF0 = byte; while (!TI0); TI0 = 0; }
uint8_t receive(void) { while (!RI0); RI0 = 0; return SBUF0; }
void wait_us(uint16_t us) { PCA0H = 0; PCA0L = 0; while ((PCA0L | PCA0H << 8) < us * 4); }
void wait_ms(uint8_t ms) { while (ms--) wait_us(1000); }

void start(void) {
    uint8_t i;
    OSCICN = 0x83;
    CLKMUL = 0x80;
    for (i = 0; i != 60; i++);
    CLKMUL |= 0xC0;
    while (!(CLKMUL & 0x20));
    FLSCL = 0x90;
    CLKSEL = 3;
    P0MDOUT = 0x10;
    P1MDOUT = 0x06;
    P1 = 0xF9;
    P2MDOUT = 0x0F;
    P2 = 0xF0;
    P0SKIP = 0xCF;
    XBR0 = 0x01;
    XBR1 = 0x41;
    CKCON = 0x08;
    TMOD = 0x20;
    TH1 = 0x30;
    TR1 = 1;
    SCON0 = 0x10;
    PCA0MD = 0;
    CR = 1;
}
"""

SDCC_HEADER = Path("/usr/share/sdcc/include/mcs51/C8051F340.h")

Compile = Callable[[str], Path]
Run = Callable[[str], AbstractContextManager["Board"]]


class Board:
    """A running simulator and the connection to its only unit."""

    def __init__(self, process: subprocess.Popen[str], connection: socket.socket):
        self._process = process
        self.connection = connection

    def ask(self, question: bytes, answer_length: int) -> bytes:
        """What the unit answers; fails with the simulator's words if it ends before."""
        self.connection.sendall(question)
        answer = b""
        while len(answer) < answer_length:
            readable, _, _ = select.select([self.connection], [], [], PATIENCE_S)
            assert readable, f"only {answer.hex()} came"
            part = self.connection.recv(answer_length - len(answer))
            assert part, self.last_words()
            answer += part
        return answer

    def last_words(self) -> str:
        """What the simulator says as it ends."""
        assert self._process.stderr is not None
        return self._process.stderr.read()


@pytest.fixture
def compiled(tmp_path: Path) -> Compile:
    """Compiles a C program."""

    def compile_program(program: str) -> Path:
        source = tmp_path / "program.c"
        source.write_text(program)
        memory = ["--xram-size", "4096", "--iram-size", "256"]
        target = tmp_path / "program.ihx"
        subprocess.run(["sdcc", "-mmcs51", *memory, source, "-o", target], check=True, cwd=tmp_path)
        return target

    return compile_program


@pytest.fixture
def running(compiled: Compile, tmp_path: Path) -> Run:
    """Runs the main function that follows the preamble, with a wall 1 m in front of a unit at rest."""
    room = tmp_path / "wall.toml"
    room.write_text(
        "name = 'wall'\nair_temperature_c = 20.0\n[sensor]\n"
        "lobe = [{ range_m = 0.0, half_angle_deg = 179.0 }]\n"
        "[[wall]]\nfrom_m = [1.0, -3.0]\nto_m = [1.0, 3.0]\n[unit]\nposition_m = [0.0, 0.0]\n"
    )

    @contextmanager
    def run(main: str) -> Iterator[Board]:
        image = compiled(PREAMBLE + main)
        command = ["noctule-sim", "--firmware", image, "--room", room, "--tcp", "127.0.0.1:0", "--speed", "10"]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        with subprocess.Popen(command, **pipes) as process:
            try:
                assert process.stdout is not None
                address = re.search(r"socket://([\d.]+):(\d+)", process.stdout.readline())
                assert address, process.communicate()[1]
                with socket.create_connection((address[1], int(address[2]))) as connection:
                    yield Board(process, connection)
            finally:
                process.send_signal(signal.SIGTERM)

    return run


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
                again.settimeout(5)
                answer = again.recv(1)
        assert answer == b"c"
