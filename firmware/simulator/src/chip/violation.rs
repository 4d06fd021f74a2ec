//! What ends a simulation: the firmware did what the chip forbids, or what the simulator does not model.

use crate::chip::sfr;
use crate::time::{Tick, to_seconds};
use thiserror::Error;

/// What the firmware did.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum Violation {
    #[error("SFR 0x{address:02X} ({}) {access} is not modelled", sfr::name(*address))]
    UnmodelledSfr { address: u8, access: &'static str },
    #[error("SFR 0x{address:02X} ({}) written with 0x{value:02X}: bits 0x{bits:02X} are not modelled", sfr::name(*address))]
    UnmodelledBits { address: u8, value: u8, bits: u8 },
    #[error("{0}")]
    Rule(String),
}

impl Violation {
    pub fn rule(text: impl Into<String>) -> Self {
        Self::Rule(text.into())
    }
}

/// A violation with where and when it happened.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{violation} (PC 0x{pc:04X}, tick {tick} of 48 MHz, {:.6} s){}", to_seconds(*tick), cause(*flash_outrun))]
pub struct Breach {
    pub violation: Violation,
    pub pc: u16,
    pub tick: Tick,
    /// Code was read too fast: the violation is but what came of it.
    pub flash_outrun: bool,
}

fn cause(flash_outrun: bool) -> &'static str {
    if flash_outrun { ", running wild: SYSCLK is over 25 MHz and FLSCL.FLRT is clear" } else { "" }
}
