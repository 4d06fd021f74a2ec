//! The CPU: the i8051 core behind the one interface that the board uses, and what the core lacks or gets wrong.
//!
//! Made good here, through the core's public interface: clocks per instruction; the chip's interrupts in place of
//! the core's five; the parity flag, which the core lets go stale; OV and AC of ADD, ADDC, SUBB and DA; the page of
//! AJMP and ACALL at the end of a 2 KB page; reads of port latches by read-modify-write instructions.

mod cycles;
mod opcode;

use crate::chip::violation::Violation;
use crate::chip::{Chip, sfr};
use crate::cpu::cycles::{INTERRUPT_ENTRY, PREFETCH_MISS};
use crate::cpu::opcode::{Kind, TRAITS, TRAITS_OF_MISSES, USES, subtracts, takes_carry};
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

    /// Whether a RETI or an access to IE or IP has run since this was last asked: one more instruction runs before an
    /// interrupt.
    pub fn take_deferral(&mut self) -> bool {
        std::mem::take(&mut self.defers_interrupts)
    }

    /// Goes to an interrupt's vector; gives the clocks that it takes.
    pub fn interrupt(&mut self, vector: u16, misses: bool) -> u64 {
        self.core.push_stack16(self.core.pc);
        self.core.pc = vector;
        INTERRUPT_ENTRY + if misses { u64::from(PREFETCH_MISS) } else { 0 }
    }

    /// Runs one instruction and gives the SYSCLKs that it takes; `MISSES`: its jumps miss the prefetch engine's bytes.
    /// What the chip forbids is in [`Chip::violation`].
    #[inline(always)]
    pub fn step<const MISSES: bool>(&mut self, chip: &mut Chip) -> u64 {
        let pc = self.core.pc;
        chip.check_code_address(pc);
        let opcode = chip.flash.byte(pc);
        let traits = if MISSES { &TRAITS_OF_MISSES } else { &TRAITS };
        let traits = &traits[opcode as usize];
        let second = chip.flash.byte(pc.wrapping_add(1));
        if USES[second as usize] & traits.cares_for == 0 {
            self.core.step(chip);
        } else {
            self.step_special(traits.kind, opcode, pc, chip);
        }
        let jumped = traits.taken != 0 && self.core.pc != pc.wrapping_add(u16::from(traits.length));
        u64::from(traits.clocks) + if jumped { u64::from(traits.taken) } else { 0 }
    }

    /// An instruction before and after which something else must be made good.
    #[inline(never)]
    fn step_special(&mut self, kind: Kind, opcode: u8, pc: u16, chip: &mut Chip) {
        let first = chip.flash.byte(pc.wrapping_add(1));
        match kind {
            Kind::Direct => self.step_on_registers(opcode, &[first], chip),
            Kind::Bit => self.step_on_registers(opcode, &[first & 0xF8], chip),
            Kind::DirectDirect => {
                let second = chip.flash.byte(pc.wrapping_add(2));
                self.step_on_registers(opcode, &[first, second], chip);
            }
            Kind::ArithmeticDirect => {
                let touches_interrupts = self.prepare(opcode, &[first], chip);
                self.step_arithmetic(opcode, chip);
                self.finish(touches_interrupts, chip);
            }
            Kind::DecimalAdjust => {
                let (half_carry, overflow) = (self.core.psw(Flag::AC), self.core.psw(Flag::OV));
                self.core.step(chip);
                self.set_flags(half_carry, overflow);
            }
            Kind::JumpInPage => {
                self.core.step(chip);
                self.core.pc = pc.wrapping_add(2) & 0xF800 | self.core.pc & 0x07FF;
            }
            Kind::MovxByPage => {
                chip.prepare_movx(true);
                self.core.step(chip);
                chip.prepare_movx(false);
            }
            Kind::MovcFromPc => self.step_movc(pc.wrapping_add(1), chip),
            Kind::MovcFromDptr => self.step_movc(self.core.dptr(), chip),
            Kind::ReturnFromInterrupt => {
                self.core.step(chip);
                self.defers_interrupts = true;
                chip.leave_interrupt();
                self.silence_core_interrupts();
            }
            Kind::Reserved => {
                self.core.step(chip);
                chip.report(Violation::rule("opcode 0xA5 is reserved"));
            }
            Kind::Arithmetic => self.step_arithmetic(opcode, chip),
            Kind::Plain => {
                self.core.step(chip);
            }
        }
    }

    fn step_on_registers(&mut self, opcode: u8, addresses: &[u8], chip: &mut Chip) {
        let touches_interrupts = self.prepare(opcode, addresses, chip);
        self.core.step(chip);
        self.finish(touches_interrupts, chip);
    }

    fn step_movc(&mut self, base: u16, chip: &mut Chip) {
        chip.check_code_address(base.wrapping_add(u16::from(self.core.a())));
        self.core.step(chip);
    }

    /// Readies chip and core for the registers among the addresses that the instruction names; tells whether IE or IP is
    /// among them, which live in the core only while an instruction works on them.
    #[inline]
    fn prepare(&mut self, opcode: u8, addresses: &[u8], chip: &mut Chip) -> bool {
        let mut touches_interrupts = false;
        let traits = &TRAITS[opcode as usize];
        for &address in addresses {
            match address {
                sfr::PSW => self.core.psw_set(Flag::P, self.core.a().count_ones() % 2 == 1),
                sfr::IE | sfr::IP => {
                    touches_interrupts = true;
                    self.core.ie_set(chip.interrupts.read(sfr::IE));
                    self.core.ip_set(chip.interrupts.read(sfr::IP));
                }
                _ => chip.prepare_access(address, traits.reads_latch, traits.clocks),
            }
        }
        touches_interrupts
    }

    #[inline]
    fn finish(&mut self, touched_interrupts: bool, chip: &mut Chip) {
        if touched_interrupts {
            self.defers_interrupts = true;
            chip.set_interrupt_registers(self.core.ie(), self.core.ip());
            self.core.ie_set(0);
        }
    }

    /// ADD, ADDC or SUBB. AC and OV follow from the accumulator before and after: the operand is their difference.
    #[inline(never)]
    fn step_arithmetic(&mut self, opcode: u8, chip: &mut Chip) {
        let before = self.core.a();
        let carry = u8::from(self.core.psw(Flag::C) && takes_carry(opcode));
        self.core.step(chip);
        let after = self.core.a();
        let (operand, overflow) = if subtracts(opcode) {
            let operand = before.wrapping_sub(after).wrapping_sub(carry);
            (operand, (before ^ operand) & (before ^ after))
        } else {
            let operand = after.wrapping_sub(before).wrapping_sub(carry);
            (operand, (before ^ after) & (operand ^ after))
        };
        self.set_flags((before ^ operand ^ after) & 0x10 != 0, overflow & 0x80 != 0);
    }

    fn set_flags(&mut self, half_carry: bool, overflow: bool) {
        self.core.psw_set(Flag::AC, half_carry);
        self.core.psw_set(Flag::OV, overflow);
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
