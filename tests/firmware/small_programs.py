"""Small programs for the simulated chip, and the board that they run on."""

import select
import socket
import subprocess
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

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
