//! What the simulator must know of each opcode besides what the core does with it.

use crate::chip::sfr;
use crate::cpu::cycles::{CLOCKS, PREFETCH_MISS, SLOWER_MOVC, TAKEN_BRANCH};

/// What an instruction needs besides what the core does with it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Plain,
    /// Its second byte is an address, which may be that of a register.
    Direct,
    /// Its second byte is a bit's address.
    Bit,
    /// Its second and third bytes are addresses.
    DirectDirect,
    /// ADD, ADDC and SUBB, of which the core sets AC and OV wrong.
    Arithmetic,
    /// The same with an address as second byte.
    ArithmeticDirect,
    DecimalAdjust,
    /// AJMP and ACALL.
    JumpInPage,
    /// MOVX @Ri.
    MovxByPage,
    /// MOVC A,@A+PC and MOVC A,@A+DPTR.
    MovcFromPc,
    MovcFromDptr,
    ReturnFromInterrupt,
    Reserved,
}

/// What `step` must know of an opcode beforehand.
#[derive(Clone, Copy)]
#[repr(align(8))]
pub struct Traits {
    pub clocks: u8,
    /// Further clocks if the program counter does not go on to the next instruction.
    pub taken: u8,
    pub length: u8,
    /// It reads the latch of a port, not its pins.
    pub reads_latch: bool,
    pub kind: Kind,
    /// The core can be left alone with it if its second byte has none of these uses in [`USES`].
    pub cares_for: u8,
}

/// On a chip whose prefetch engine always has what is next.
pub static TRAITS: [Traits; 256] = traits(0, 0);
/// On one whose prefetch engine never has the target of a jump.
pub static TRAITS_OF_MISSES: [Traits; 256] = traits(PREFETCH_MISS, SLOWER_MOVC);

const fn traits(miss: u8, slower_movc: u8) -> [Traits; 256] {
    let mut table =
        [Traits { clocks: 0, taken: 0, length: 0, reads_latch: false, kind: Kind::Plain, cares_for: 0 }; 256];
    let mut index = 0;
    while index < 256 {
        let opcode = index as u8;
        table[index] = Traits {
            clocks: CLOCKS[index]
                + if always_jumps(opcode) { miss } else { 0 }
                + if is_movc(opcode) { slower_movc } else { 0 },
            taken: if is_conditional_branch(opcode) { TAKEN_BRANCH + miss } else { 0 },
            length: branch_length(opcode),
            reads_latch: reads_latch(opcode),
            kind: kind(opcode),
            cares_for: cares_for(kind(opcode)),
        };
        index += 1;
    }
    table
}

const fn kind(opcode: u8) -> Kind {
    match opcode {
        0x25 | 0x35 | 0x95 => Kind::ArithmeticDirect,
        0x24..=0x2F | 0x34..=0x3F | 0x94..=0x9F => Kind::Arithmetic,
        0xD4 => Kind::DecimalAdjust,
        0xE2 | 0xE3 | 0xF2 | 0xF3 => Kind::MovxByPage,
        0x83 => Kind::MovcFromPc,
        0x93 => Kind::MovcFromDptr,
        0x32 => Kind::ReturnFromInterrupt,
        0xA5 => Kind::Reserved,
        0x85 => Kind::DirectDirect,
        0x10 | 0x20 | 0x30 | 0x72 | 0x82 | 0x92 | 0xA0 | 0xA2 | 0xB0 | 0xB2 | 0xC2 | 0xD2 => Kind::Bit,
        0x42 | 0x43 | 0x52 | 0x53 | 0x62 | 0x63 | 0xC0 | 0xD0 => Kind::Direct,
        0x86..=0x8F | 0xA6..=0xAF => Kind::Direct,
        _ if opcode & 0x0F == 0x01 => Kind::JumpInPage,
        _ if opcode & 0x0F == 0x05 => Kind::Direct,
        _ => Kind::Plain,
    }
}

const ANYTHING: u8 = 0x01;
const ADDRESS: u8 = 0x02;
const BIT: u8 = 0x04;

/// What a byte is: always anything; as an address, or as that of a bit, that of a register outside the core, or of the
/// PSW, whose parity the core lets go stale.
pub static USES: [u8; 256] = {
    let mut uses = [ANYTHING; 256];
    let mut byte = 0;
    while byte < 256 {
        uses[byte] |= if leaves_core(byte as u8) { ADDRESS } else { 0 };
        uses[byte] |= if leaves_core(byte as u8 & 0xF8) { BIT } else { 0 };
        byte += 1;
    }
    uses
};

const fn leaves_core(address: u8) -> bool {
    let in_core = matches!(sfr::OWNERS[address as usize], Some(sfr::Owner::Core));
    address >= sfr::FIRST && (!in_core || address == sfr::PSW)
}

const fn cares_for(kind: Kind) -> u8 {
    match kind {
        Kind::Plain => 0,
        Kind::Direct => ADDRESS,
        Kind::Bit => BIT,
        _ => ANYTHING,
    }
}

/// SUBB, as against ADD and ADDC.
pub const fn subtracts(opcode: u8) -> bool {
    opcode & 0xF0 == 0x90
}

/// ADDC and SUBB, as against ADD.
pub const fn takes_carry(opcode: u8) -> bool {
    opcode & 0xF0 != 0x20
}

/// Instructions that read the latch of a port, not its pins (8051 manuals: "read-modify-write").
const fn reads_latch(opcode: u8) -> bool {
    matches!(
        opcode,
        0x05 | 0x15 | 0xD5 | 0x42 | 0x43 | 0x52 | 0x53 | 0x62 | 0x63 | 0x10 | 0x92 | 0xB2 | 0xC2 | 0xD2
    )
}

const fn is_conditional_branch(opcode: u8) -> bool {
    matches!(opcode, 0x10 | 0x20 | 0x30 | 0x40 | 0x50 | 0x60 | 0x70 | 0xB4..=0xBF | 0xD5 | 0xD8..=0xDF)
}

/// LJMP, LCALL, RET, RETI, JMP @A+DPTR, SJMP, AJMP and ACALL.
const fn always_jumps(opcode: u8) -> bool {
    matches!(opcode, 0x02 | 0x12 | 0x22 | 0x32 | 0x73 | 0x80) || opcode & 0x0F == 0x01
}

const fn is_movc(opcode: u8) -> bool {
    matches!(opcode, 0x83 | 0x93)
}

/// The length of a conditional branch.
const fn branch_length(opcode: u8) -> u8 {
    if matches!(opcode, 0x40..=0x7F | 0xD8..=0xDF) { 2 } else { 3 }
}
