//! The interrupt system (datasheet chapter "CIP-51", section "Interrupt Handler"): 17 vectors, two priorities.

use crate::chip::sfr;

/// Sources that have a model, by their interrupt number: Timer 0, Timer 1, UART0, Timer 2, PCA0, Timer 3.
pub const TIMER0: u8 = 1;
pub const TIMER1: u8 = 3;
pub const UART0: u8 = 4;
pub const TIMER2: u8 = 5;
pub const PCA0: u8 = 11;
pub const TIMER3: u8 = 14;

/// How many sources there are, and their names.
pub const SOURCES: usize = 17;
pub const NAMES: [&str; SOURCES] = [
    "INT0",
    "Timer 0",
    "INT1",
    "Timer 1",
    "UART0",
    "Timer 2",
    "SPI0",
    "SMB0",
    "USB0",
    "ADC0 window",
    "ADC0",
    "PCA0",
    "Comparator 0",
    "Comparator 1",
    "Timer 3",
    "VBUS",
    "UART1",
];

const EA: u8 = 0x80;
/// EIE1 begins with interrupt 7, EIE2 with 15.
const EIE1_SHIFT: u32 = 7;

#[derive(Default)]
pub struct Interrupts {
    ie: u8,
    ip: u8,
    eie1: u8,
    eip1: u8,
    low_in_service: bool,
    high_in_service: bool,
}

impl Interrupts {
    pub fn read(&self, address: u8) -> u8 {
        match address {
            sfr::IE => self.ie,
            sfr::IP => self.ip | 0x80,
            sfr::EIE1 => self.eie1,
            sfr::EIP1 => self.eip1,
            _ => 0,
        }
    }

    pub fn write(&mut self, address: u8, value: u8) {
        match address {
            sfr::IE => self.ie = value,
            sfr::IP => self.ip = value,
            sfr::EIE1 => self.eie1 = value,
            sfr::EIP1 => self.eip1 = value,
            _ => {}
        }
    }

    /// The interrupt to take now, out of those pending (one bit each).
    pub fn select(&self, pending: u32) -> Option<u8> {
        if self.ie & EA == 0 || self.high_in_service {
            return None;
        }
        let ready = pending & spread(self.ie & !EA, self.eie1);
        let high = ready & spread(self.ip & !EA, self.eip1);
        let candidates = match (high, self.low_in_service) {
            (0, true) => 0,
            (0, false) => ready,
            (high, _) => high,
        };
        (candidates != 0).then(|| candidates.trailing_zeros() as u8)
    }

    pub fn enables(&self, interrupt: u8) -> bool {
        self.enabled() >> interrupt & 1 != 0
    }

    /// The interrupts whose own enable bit is set, one bit each.
    pub fn enabled(&self) -> u32 {
        spread(self.ie & !EA, self.eie1)
    }

    pub fn enter(&mut self, interrupt: u8) {
        if spread(self.ip & !EA, self.eip1) >> interrupt & 1 != 0 {
            self.high_in_service = true;
        } else {
            self.low_in_service = true;
        }
    }

    /// RETI ends the highest level in service.
    pub fn leave(&mut self) {
        if self.high_in_service {
            self.high_in_service = false;
        } else {
            self.low_in_service = false;
        }
    }
}

pub fn vector(interrupt: u8) -> u16 {
    0x03 + 8 * u16::from(interrupt)
}

fn spread(standard: u8, extended: u8) -> u32 {
    u32::from(standard & 0x7F) | u32::from(extended) << EIE1_SHIFT
}

#[cfg(test)]
mod tests {
    use super::*;

    fn enabled() -> Interrupts {
        let mut interrupts = Interrupts::default();
        interrupts.write(sfr::IE, EA | 0x3A);
        interrupts.write(sfr::EIE1, 0x90);
        interrupts
    }

    #[test]
    fn vectors_are_those_of_the_datasheets_table() {
        let expected = [(TIMER0, 0x0B), (UART0, 0x23), (TIMER2, 0x2B), (PCA0, 0x5B), (TIMER3, 0x73)];
        for (interrupt, address) in expected {
            assert_eq!(vector(interrupt), address);
        }
    }

    #[test]
    fn among_equals_the_lowest_number_wins() {
        assert_eq!(enabled().select(1 << PCA0 | 1 << UART0), Some(UART0));
    }

    #[test]
    fn a_high_priority_interrupt_wins_and_breaks_into_a_low_one() {
        let mut interrupts = enabled();
        interrupts.write(sfr::EIP1, 0x10);
        assert_eq!(interrupts.select(1 << PCA0 | 1 << UART0), Some(PCA0));
        interrupts.enter(UART0);
        assert_eq!(interrupts.select(1 << TIMER2), None);
        assert_eq!(interrupts.select(1 << PCA0), Some(PCA0));
        interrupts.enter(PCA0);
        assert_eq!(interrupts.select(1 << PCA0), None);
        interrupts.leave();
        assert_eq!(interrupts.select(1 << TIMER2), None);
        interrupts.leave();
        assert_eq!(interrupts.select(1 << TIMER2), Some(TIMER2));
    }

    #[test]
    fn nothing_is_taken_while_ea_is_clear_or_the_source_is_not_enabled() {
        assert_eq!(Interrupts::default().select(!0), None);
        let mut interrupts = enabled();
        interrupts.write(sfr::IE, EA);
        assert_eq!(interrupts.select(1 << UART0), None);
    }
}
