//! UART0 in its 8-bit mode (datasheet chapter "UART0"): ten bit times a byte, timed by Timer 1.
//!
//! The far end is an adapter at 115200 baud, whose own clock times what comes in.

use crate::chip::sfr;
use crate::chip::violation::Violation;
use crate::time::{NEVER, TICKS_PER_SECOND, Tick};
use std::collections::VecDeque;

const RI: u8 = 0x01;
const TI: u8 = 0x02;
const REN: u8 = 0x10;
/// Reads as 1.
const UNUSED: u8 = 0x40;
pub const ADAPTER_BAUD: Tick = 115_200;
const ADAPTER_BYTE: Tick = TICKS_PER_SECOND * 10 / ADAPTER_BAUD;
/// A receiver samples the stop bit 9.5 bits after the start: half a bit of error is 5 %, split between both ends.
const BAUD_TOLERANCE: f64 = 0.025;

#[derive(Default)]
pub struct Uart {
    control: u8,
    received: u8,
    sending: Option<u8>,
    /// When the stop bit of the byte being sent begins, and TI goes up.
    stop_bit_at: Option<Tick>,
    line_free_at: Tick,
    incoming: VecDeque<(Tick, u8)>,
    incoming_free_at: Tick,
    pub outgoing: Vec<u8>,
}

impl Uart {
    /// A reset of the chip: what is on the wire from the far end keeps coming.
    pub fn reset(&mut self) {
        *self = Self {
            incoming: std::mem::take(&mut self.incoming),
            incoming_free_at: self.incoming_free_at,
            outgoing: std::mem::take(&mut self.outgoing),
            ..Self::default()
        };
    }

    pub fn read(&self, address: u8) -> u8 {
        if address == sfr::SCON0 { self.control | UNUSED } else { self.received }
    }

    pub fn write_control(&mut self, value: u8) {
        self.control = value & (RI | TI | REN);
    }

    /// Starts a byte. `overflow` is the time between two overflows of Timer 1, two of which make a bit, or `None`
    /// while it does not run.
    ///
    /// # Errors
    /// A [`Violation`] if the last byte's stop bit has not begun, or if the adapter could not read the baud rate.
    pub fn send(&mut self, value: u8, now: Tick, overflow: Option<Tick>) -> Result<(), Violation> {
        if self.stop_bit_at.is_some() {
            return Err(Violation::rule("SBUF0 written while the last byte is still being sent"));
        }
        let overflow =
            overflow.ok_or_else(|| Violation::rule("SBUF0 written while Timer 1 gives no baud rate"))?;
        let bit = 2 * overflow;
        check_baud(bit)?;
        let start = now.max(self.line_free_at);
        self.sending = Some(value);
        self.stop_bit_at = Some(start + 9 * bit);
        self.line_free_at = start + 10 * bit;
        Ok(())
    }

    /// Puts bytes of the far end on the wire, one after the other from `now` on.
    pub fn feed(&mut self, bytes: &[u8], now: Tick) {
        for &byte in bytes {
            self.incoming_free_at = self.incoming_free_at.max(now) + ADAPTER_BYTE;
            self.incoming.push_back((self.incoming_free_at, byte));
        }
    }

    pub fn incoming_len(&self) -> usize {
        self.incoming.len()
    }

    pub fn pending(&self) -> bool {
        self.control & (RI | TI) != 0
    }

    pub fn next_event(&self) -> Tick {
        let incoming = self.incoming.front().map_or(NEVER, |&(at, _)| at);
        self.stop_bit_at.unwrap_or(NEVER).min(incoming)
    }

    /// Does what is due by `now`. A byte that arrives while RI is still up is lost, as is one without a pin.
    pub fn service(&mut self, now: Tick, transmits: bool, receives: bool) {
        if self.stop_bit_at.is_some_and(|at| at <= now) {
            self.stop_bit_at = None;
            self.control |= TI;
            if let Some(byte) = self.sending.take().filter(|_| transmits) {
                self.outgoing.push(byte);
            }
        }
        while let Some(&(_, byte)) = self.incoming.front().filter(|&&(at, _)| at <= now) {
            self.incoming.pop_front();
            if receives && self.control & REN != 0 && self.control & RI == 0 {
                self.received = byte;
                self.control |= RI;
            }
        }
    }
}

fn check_baud(bit: Tick) -> Result<(), Violation> {
    let baud = TICKS_PER_SECOND as f64 / bit as f64;
    if (baud / ADAPTER_BAUD as f64 - 1.0).abs() > BAUD_TOLERANCE {
        return Err(Violation::rule(format!(
            "UART0 sends at {baud:.0} baud to an adapter at {ADAPTER_BAUD}"
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const BIT: Tick = 416;

    #[test]
    fn a_byte_raises_ti_after_nine_bits_and_the_next_one_starts_after_ten() {
        let mut uart = Uart::default();
        uart.send(b'a', 0, Some(BIT / 2)).unwrap();
        assert_eq!(uart.next_event(), 9 * BIT);
        uart.service(9 * BIT, true, true);
        assert_eq!(uart.read(sfr::SCON0) & TI, TI);
        uart.send(b'b', 9 * BIT, Some(BIT / 2)).unwrap();
        assert_eq!(uart.next_event(), 19 * BIT);
        assert_eq!(uart.outgoing, b"a");
    }

    #[test]
    fn a_byte_that_finds_ri_up_is_lost() {
        let mut uart = Uart::default();
        uart.write_control(REN);
        uart.feed(b"xy", 0);
        assert_eq!(uart.next_event(), 4166);
        uart.service(2 * ADAPTER_BYTE, true, true);
        assert_eq!(uart.read(sfr::SBUF0), b'x');
    }

    #[test]
    fn nothing_is_sent_or_received_without_pins() {
        let mut uart = Uart::default();
        uart.write_control(REN);
        uart.send(b'a', 0, Some(BIT / 2)).unwrap();
        uart.feed(b"x", 0);
        uart.service(2 * ADAPTER_BYTE, false, false);
        assert!(uart.outgoing.is_empty());
        assert_eq!(uart.read(sfr::SCON0) & RI, 0);
    }

    #[test]
    fn a_wrong_baud_rate_is_a_fault() {
        assert!(Uart::default().send(b'a', 0, Some(BIT)).is_err());
        assert!(Uart::default().send(b'a', 0, None).is_err());
    }

    #[test]
    fn a_second_byte_before_the_stop_bit_is_a_fault() {
        let mut uart = Uart::default();
        uart.send(b'a', 0, Some(BIT / 2)).unwrap();
        assert!(uart.send(b'b', 8 * BIT, Some(BIT / 2)).is_err());
    }
}
