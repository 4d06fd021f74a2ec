//! How long instructions take (C8051F34x datasheet, chapter "CIP-51", table of the instruction set, prefetch on).
//!
//! The prefetch engine reads flash two bytes at a time, over two clocks at 48 MHz, ahead of the CPU: code without jumps
//! runs at full speed, and a jump may have to wait for its target (chapter "Prefetch Engine"). How long depends on
//! alignment and on what the engine was at. So there are two tables: none waits, and each waits as long as can be.
//! Peripheral timing is exact in SYSCLKs, and everything that is measured is measured by it.

/// Clocks of each opcode, a branch not being taken.
pub const CLOCKS: [u8; 256] = {
    let mut table = [1u8; 256];
    let mut opcode = 0;
    while opcode < 256 {
        table[opcode] = clocks(opcode as u8);
        opcode += 1;
    }
    table
};

/// A conditional branch that is taken refills the pipeline.
pub const TAKEN_BRANCH: u8 = 2;
/// An interrupt: one clock to see it and the LCALL to its vector.
pub const INTERRUPT_ENTRY: u64 = 6;
/// What a jump, or a branch that is taken, waits for its target at most.
pub const PREFETCH_MISS: u8 = 2;
/// MOVC takes 4 to 7 clocks, by alignment and flash read time.
pub const SLOWER_MOVC: u8 = 3;

const fn clocks(opcode: u8) -> u8 {
    match opcode {
        0x02 => 5,                                    // LJMP
        0x12 => 5,                                    // LCALL
        0x22 | 0x32 => 6,                             // RET, RETI
        0x73 | 0x80 => 4,                             // JMP @A+DPTR, SJMP
        0x83 | 0x93 => 4,                             // MOVC
        0xE0 | 0xE2 | 0xE3 | 0xF0 | 0xF2 | 0xF3 => 3, // MOVX
        0x84 => 8,                                    // DIV
        0xA4 => 4,                                    // MUL
        0x10 | 0x20 | 0x30 => 3,                      // JBC, JB, JNB
        0x40 | 0x50 | 0x60 | 0x70 => 2,               // JC, JNC, JZ, JNZ
        0xB4 | 0xB5 | 0xB8..=0xBF => 3,               // CJNE
        0xB6 | 0xB7 => 4,                             // CJNE @Ri
        0xD5 => 3,                                    // DJNZ direct
        0xD8..=0xDF => 2,                             // DJNZ Rn
        0x43 | 0x53 | 0x63 | 0x75 | 0x85 | 0x90 => 3, // three-byte moves and logic
        0xA3 | 0xC3 | 0xD3 | 0xB3 | 0xC4 | 0xD4 | 0xE4 | 0xF4 => 1,
        0x03 | 0x13 | 0x23 | 0x33 | 0x04 | 0x14 | 0x00 => 1,
        0xD6 | 0xD7 => 2, // XCHD
        _ => match opcode & 0x1F {
            0x01 | 0x11 => 4, // AJMP, ACALL
            _ => match (opcode >> 4, opcode & 0x0F) {
                (0x7 | 0xA, 0x8..) => 2, // MOV Rn,#data and MOV Rn,direct
                (0x8, 0x6..) => 2,       // MOV direct,@Ri and MOV direct,Rn
                (_, 0x8..) => 1,         // the rest with Rn
                _ => 2,                  // two-byte instructions, and those with @Ri
            },
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_are_those_of_the_datasheets_table() {
        let expected = [
            (0x00, 1), // NOP
            (0x05, 2), // INC direct
            (0x06, 2), // INC @R0
            (0x08, 1), // INC R0
            (0x11, 4), // ACALL
            (0x24, 2), // ADD A,#
            (0x28, 1), // ADD A,R0
            (0x26, 2), // ADD A,@R0
            (0x53, 3), // ANL direct,#
            (0x74, 2), // MOV A,#
            (0x78, 2), // MOV R0,#
            (0x88, 2), // MOV direct,R0
            (0xA3, 1), // INC DPTR
            (0xA8, 2), // MOV R0,direct
            (0xC0, 2), // PUSH
            (0xE5, 2), // MOV A,direct
            (0xE8, 1), // MOV A,R0
            (0xF0, 3), // MOVX @DPTR,A
            (0xF8, 1), // MOV R0,A
        ];
        for (opcode, clocks) in expected {
            assert_eq!(CLOCKS[opcode], clocks, "opcode 0x{opcode:02X}");
        }
    }
}
