//! The CPU: the i8051 core behind the one interface that the board uses, and what the core lacks or gets wrong.
//!
//! Made good here, through the core's public interface: clocks per instruction; the chip's interrupts in place of
//! the core's five; the parity flag, which the core lets go stale; OV and AC of ADD, ADDC, SUBB and DA; the page of
//! AJMP and ACALL at the end of a 2 KB page; reads of port latches by read-modify-write instructions.

use crate::chip::{Chip, sfr};
use crate::cycles::INTERRUPT_ENTRY;
use crate::fault::Violation;
use crate::opcode::{
    DA, Operand, RESERVED_OPCODE, RETI, TRAITS, is_jump_in_page, moves_by_page, reads_latch,
    sets_core_flags_wrong,
};
use i8051::{Cpu as Core, Flag, Interrupt};

pub const IRAM_SIZE: usize = 256;

pub struct Cpu {
    core: Core,
    defers_interrupts: bool,
}

impl Cpu {
    /// A CPU at reset, with `iram` as its internal memory (which outlives every reset but a power-up).
    pub fn new(iram: [u8; IRAM_SIZE]) -> Self {
        let mut cpu = Self { core: Core::new(), defers_interrupts: false };
        cpu.silence_core_interrupts();
        cpu.core.internal_ram = iram;
        cpu
    }

    pub fn reset(&mut self) {
        *self = Self::new(self.core.internal_ram);
    }

    pub fn write_iram(&mut self, address: u8, value: u8) {
        self.core.internal_ram_write(address, value);
    }

    pub fn pc(&self) -> u16 {
        self.core.pc
    }

    pub fn sp(&self) -> u8 {
        self.core.sp()
    }

    /// Whether the last instruction was a RETI or a write to IE or IP, after which one more runs before an interrupt.
    pub fn defers_interrupts(&self) -> bool {
        self.defers_interrupts
    }

    /// Goes to an interrupt's vector; gives the clocks that it takes.
    pub fn interrupt(&mut self, vector: u16) -> u64 {
        self.core.push_stack16(self.core.pc);
        self.core.pc = vector;
        INTERRUPT_ENTRY
    }

    /// Runs one instruction and gives the SYSCLKs that it takes. What the chip forbids is in [`Chip::violation`].
    #[inline]
    pub fn step(&mut self, chip: &mut Chip) -> u64 {
        let pc = self.core.pc;
        let opcode = chip.flash.byte(pc);
        let traits = &TRAITS[opcode as usize];
        if traits.special {
            self.step_special(opcode, pc, chip);
        } else {
            self.core.step(chip);
        }
        let jumped = self.core.pc != pc.wrapping_add(u16::from(traits.length));
        u64::from(traits.clocks) + u64::from(traits.taken) * u64::from(jumped)
    }

    /// An instruction before and after which something must be made good.
    fn step_special(&mut self, opcode: u8, pc: u16, chip: &mut Chip) {
        let touches_interrupts = self.prepare(opcode, pc, chip);
        let flags = self.arithmetic_flags(opcode, pc, chip);
        chip.prepare_movx(moves_by_page(opcode));

        self.core.step(chip);

        chip.prepare_movx(false);
        if let Some((carry_half, overflow)) = flags {
            self.core.psw_set(Flag::AC, carry_half);
            self.core.psw_set(Flag::OV, overflow);
        }
        self.defers_interrupts = touches_interrupts || opcode == RETI;
        if touches_interrupts {
            chip.set_interrupt_registers(self.core.ie(), self.core.ip());
            self.core.ie_set(0);
        }
        match opcode {
            RETI => {
                chip.leave_interrupt();
                self.silence_core_interrupts();
            }
            RESERVED_OPCODE => chip.report(Violation::rule("opcode 0xA5 is reserved")),
            _ if is_jump_in_page(opcode) => {
                self.core.pc = pc.wrapping_add(2) & 0xF800 | self.core.pc & 0x07FF;
            }
            _ => {}
        }
    }

    /// Readies chip and core for the registers that the instruction names; tells whether it may touch IE or IP, which
    /// live in the core only while an instruction works on them.
    fn prepare(&mut self, opcode: u8, pc: u16, chip: &mut Chip) -> bool {
        let first = chip.flash.byte(pc.wrapping_add(1));
        let (first, second) = match TRAITS[opcode as usize].operand {
            Operand::None => return false,
            Operand::Direct => (first, 0),
            Operand::Bit => (first & 0xF8, 0),
            Operand::DirectDirect => (first, chip.flash.byte(pc.wrapping_add(2))),
        };
        let mut touches_interrupts = false;
        for address in [first, second] {
            if address < 0x80 {
                continue;
            }
            chip.prepare_access(address, reads_latch(opcode));
            if address == sfr::PSW {
                self.core.psw_set(Flag::P, self.core.a().count_ones() % 2 == 1);
            }
            touches_interrupts |= matches!(address, sfr::IE | sfr::IP);
        }
        if touches_interrupts {
            self.core.ie_set(chip.interrupts.read(sfr::IE));
            self.core.ip_set(chip.interrupts.read(sfr::IP));
        }
        touches_interrupts
    }

    /// AC and OV after ADD, ADDC and SUBB, and after DA, which leaves them alone.
    fn arithmetic_flags(&self, opcode: u8, pc: u16, chip: &Chip) -> Option<(bool, bool)> {
        if !sets_core_flags_wrong(opcode) {
            return None;
        }
        if opcode == DA {
            return Some((self.core.psw(Flag::AC), self.core.psw(Flag::OV)));
        }
        let next = chip.flash.byte(pc.wrapping_add(1));
        let operand = match opcode & 0x0F {
            0x04 => next,
            0x05 if next < 0x80 => self.core.internal_ram(next),
            0x05 => self.core.sfr(next, chip),
            0x06 | 0x07 => self.core.internal_ram(self.core.r(opcode & 1)),
            _ => self.core.r(opcode & 7),
        };
        let a = self.core.a();
        let carry = u8::from(self.core.psw(Flag::C) && opcode & 0xF0 != 0x20);
        if opcode & 0xF0 == 0x90 {
            let half = (a & 0x0F) < (operand & 0x0F) + carry;
            let difference = i16::from(a as i8) - i16::from(operand as i8) - i16::from(carry);
            return Some((half, i8::try_from(difference).is_err()));
        }
        let half = (a & 0x0F) + (operand & 0x0F) + carry > 0x0F;
        let sum = i16::from(a as i8) + i16::from(operand as i8) + i16::from(carry);
        Some((half, i8::try_from(sum).is_err()))
    }

    /// The core takes no interrupt of its own while it believes that it is serving one.
    fn silence_core_interrupts(&mut self) {
        let (pc, sp) = (self.core.pc, self.core.sp());
        let stack = [1, 2].map(|above| sp.wrapping_add(above));
        let overwritten = stack.map(|address| self.core.internal_ram(address));
        self.core.ie_set(0x82);
        self.core.interrupt(Interrupt::Timer0);
        self.core.ie_set(0);
        self.core.sp_set(sp);
        self.core.pc = pc;
        for (address, byte) in stack.into_iter().zip(overwritten) {
            self.core.internal_ram_write(address, byte);
        }
    }
}
