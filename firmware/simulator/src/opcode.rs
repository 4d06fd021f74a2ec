//! What the simulator must know of each opcode besides what the core does with it.

use crate::cycles::{CLOCKS, TAKEN_BRANCH};

pub const RETI: u8 = 0x32;
pub const DA: u8 = 0xD4;
pub const RESERVED_OPCODE: u8 = 0xA5;

#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Operand {
    None,
    Direct,
    Bit,
    DirectDirect,
}

/// What `step` must know of an opcode beforehand.
#[derive(Clone, Copy)]
pub struct Traits {
    pub clocks: u8,
    /// Further clocks if the program counter does not go on to the next instruction.
    pub taken: u8,
    pub length: u8,
    pub operand: Operand,
    /// The core can't be left alone with it.
    pub special: bool,
}

pub static TRAITS: [Traits; 256] = {
    let mut table = [Traits { clocks: 0, taken: 0, length: 0, operand: Operand::None, special: false }; 256];
    let mut index = 0;
    while index < 256 {
        let opcode = index as u8;
        table[index] = Traits {
            clocks: CLOCKS[index],
            taken: if is_conditional_branch(opcode) { TAKEN_BRANCH } else { 0 },
            length: branch_length(opcode),
            operand: operand(opcode),
            special: !matches!(operand(opcode), Operand::None)
                || sets_core_flags_wrong(opcode)
                || moves_by_page(opcode)
                || is_jump_in_page(opcode)
                || matches!(opcode, RETI | RESERVED_OPCODE),
        };
        index += 1;
    }
    table
};

const fn operand(opcode: u8) -> Operand {
    match opcode {
        0x85 => Operand::DirectDirect,
        0x10 | 0x20 | 0x30 | 0x72 | 0x82 | 0x92 | 0xA0 | 0xA2 | 0xB0 | 0xB2 | 0xC2 | 0xD2 => Operand::Bit,
        0x42 | 0x43 | 0x52 | 0x53 | 0x62 | 0x63 | 0xC0 | 0xD0 => Operand::Direct,
        0x86..=0x8F | 0xA6..=0xAF => Operand::Direct,
        0xA5 => Operand::None,
        _ if opcode & 0x0F == 0x05 => Operand::Direct,
        _ => Operand::None,
    }
}

/// Instructions that read the latch of a port, not its pins (8051 manuals: "read-modify-write").
pub const fn reads_latch(opcode: u8) -> bool {
    matches!(
        opcode,
        0x05 | 0x15 | 0xD5 | 0x42 | 0x43 | 0x52 | 0x53 | 0x62 | 0x63 | 0x10 | 0x92 | 0xB2 | 0xC2 | 0xD2
    )
}

const fn is_conditional_branch(opcode: u8) -> bool {
    matches!(opcode, 0x10 | 0x20 | 0x30 | 0x40 | 0x50 | 0x60 | 0x70 | 0xB4..=0xBF | 0xD5 | 0xD8..=0xDF)
}

/// The length of a conditional branch.
const fn branch_length(opcode: u8) -> u8 {
    if matches!(opcode, 0x40..=0x7F | 0xD8..=0xDF) { 2 } else { 3 }
}

/// ADD, ADDC, SUBB and DA.
pub const fn sets_core_flags_wrong(opcode: u8) -> bool {
    matches!(opcode, 0x24..=0x2F | 0x34..=0x3F | 0x94..=0x9F | DA)
}

/// MOVX @Ri.
pub const fn moves_by_page(opcode: u8) -> bool {
    matches!(opcode, 0xE2 | 0xE3 | 0xF2 | 0xF3)
}

/// AJMP and ACALL.
pub const fn is_jump_in_page(opcode: u8) -> bool {
    opcode & 0x0F == 0x01
}
