//! Ports and the priority crossbar (datasheet chapter "Port Input/Output").
//!
//! A pin drives high only as push-pull output with the crossbar enabled; the world can pull it hard to either side.

use crate::chip::sfr;

pub const PORTS: usize = 5;
const URT0E: u8 = 0x01;
const WEAKPUD: u8 = 0x80;
const XBARE: u8 = 0x40;
const PCA0ME: u8 = 0x07;
const TX: u8 = 0x10;
const RX: u8 = 0x20;
const PCA_MODULES: u8 = 5;

/// A pin: port number and bit number.
pub type Pin = (usize, u8);

/// What the world does to the pins of the ports, one bit each.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Pulls {
    pub low: [u8; PORTS],
    pub high: [u8; PORTS],
}

pub struct Ports {
    latch: [u8; PORTS],
    push_pull: [u8; PORTS],
    digital: [u8; PORTS],
    skip: [u8; 4],
    xbr0: u8,
    xbr1: u8,
    pub pulls: Pulls,
    /// A register was written since this was last cleared: what the chip drives may have changed.
    pub changed: bool,
}

impl Ports {
    pub fn new() -> Self {
        Self {
            latch: [0xFF; PORTS],
            push_pull: [0; PORTS],
            digital: [0xFF; PORTS],
            skip: [0; 4],
            xbr0: 0,
            xbr1: 0,
            pulls: Pulls::default(),
            changed: true,
        }
    }

    pub fn latch(&self, address: u8) -> u8 {
        self.latch[port_of_latch(address)]
    }

    /// A register's value; of a port, its latch if a read-modify-write instruction asks, else its pins.
    pub fn read(&self, address: u8, latch: bool) -> u8 {
        match address {
            sfr::P0 | sfr::P1 | sfr::P2 | sfr::P3 | sfr::P4 if latch => self.latch(address),
            sfr::P0 | sfr::P1 | sfr::P2 | sfr::P3 | sfr::P4 => self.levels(port_of_latch(address)),
            sfr::P0MDOUT..=sfr::P3MDOUT => self.push_pull[(address - sfr::P0MDOUT) as usize],
            sfr::P4MDOUT => self.push_pull[4],
            sfr::P0MDIN..=sfr::P4MDIN => self.digital[(address - sfr::P0MDIN) as usize],
            sfr::P0SKIP..=sfr::P2SKIP => self.skip[(address - sfr::P0SKIP) as usize],
            sfr::P3SKIP => self.skip[3],
            sfr::XBR0 => self.xbr0,
            sfr::XBR1 => self.xbr1,
            _ => 0,
        }
    }

    pub fn write(&mut self, address: u8, value: u8) {
        self.changed = true;
        match address {
            sfr::P0 | sfr::P1 | sfr::P2 | sfr::P3 | sfr::P4 => self.latch[port_of_latch(address)] = value,
            sfr::P0MDOUT..=sfr::P3MDOUT => self.push_pull[(address - sfr::P0MDOUT) as usize] = value,
            sfr::P4MDOUT => self.push_pull[4] = value,
            sfr::P0MDIN..=sfr::P4MDIN => self.digital[(address - sfr::P0MDIN) as usize] = value,
            sfr::P0SKIP..=sfr::P2SKIP => self.skip[(address - sfr::P0SKIP) as usize] = value,
            sfr::P3SKIP => self.skip[3] = value,
            sfr::XBR0 => self.xbr0 = value,
            sfr::XBR1 => self.xbr1 = value,
            _ => {}
        }
    }

    /// Pins of a port that the chip drives high with strength: what moves a ULN2003, a TRIG input or a LED.
    pub fn driven_high(&self, port: usize) -> u8 {
        if self.enabled() { self.latch[port] & self.push_pull[port] & self.digital[port] } else { 0 }
    }

    /// Pins of a port that the chip pulls low, push-pull or open drain.
    pub fn driven_low(&self, port: usize) -> u8 {
        if self.enabled() { !self.latch[port] & self.digital[port] } else { 0 }
    }

    /// Whether a pin is left to the analog side: an analog input that the crossbar skips.
    pub fn is_analog(&self, (port, bit): Pin) -> bool {
        self.digital[port] >> bit & 1 == 0 && self.skip[port] >> bit & 1 != 0
    }

    /// Pins of a port that are push-pull outputs.
    pub fn outputs(&self, port: usize) -> u8 {
        if self.enabled() { self.push_pull[port] & self.digital[port] } else { 0 }
    }

    /// Whether UART0 reaches its pins; TX also needs a push-pull driver to make 115200 baud edges.
    pub fn uart0_transmits(&self) -> bool {
        self.uart0_has(TX) && self.push_pull[0] & TX != 0
    }

    pub fn uart0_receives(&self) -> bool {
        self.uart0_has(RX)
    }

    fn uart0_has(&self, pin: u8) -> bool {
        self.enabled() && self.xbr0 & URT0E != 0 && self.digital[0] & pin != 0
    }

    /// The pin of CEXn, by the crossbar's priority: the first pin that is neither skipped nor taken, unless it is analog.
    pub fn cex_pin(&self, module: u8) -> Option<Pin> {
        let modules = (self.xbr1 & PCA0ME).min(PCA_MODULES);
        if !self.enabled() || module >= modules {
            return None;
        }
        let taken = if self.xbr0 & URT0E != 0 { TX | RX } else { 0 };
        (0..4usize)
            .flat_map(|port| (0..8u8).map(move |bit| (port, bit)))
            .filter(|&(port, bit)| {
                let used = self.skip[port] | if port == 0 { taken } else { 0 };
                used >> bit & 1 == 0
            })
            .nth(module as usize)
            .filter(|&(port, bit)| self.digital[port] >> bit & 1 != 0)
    }

    /// The digital levels of a port's pins. A pin that nothing pulls (WEAKPUD set) reads as 0.
    pub fn levels(&self, port: usize) -> u8 {
        let outputs = self.outputs(port);
        let weak = if self.xbr1 & WEAKPUD == 0 { 0xFF } else { 0 };
        let open_drain_low = !self.latch[port];
        let input = (weak | self.pulls.high[port]) & !self.pulls.low[port] & !open_drain_low;
        ((outputs & self.latch[port]) | (!outputs & input)) & self.digital[port]
    }

    fn enabled(&self) -> bool {
        self.xbr1 & XBARE != 0
    }
}

fn port_of_latch(address: u8) -> usize {
    if address == sfr::P4 { 4 } else { ((address - sfr::P0) >> 4) as usize }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn board() -> Ports {
        let mut ports = Ports::new();
        ports.write(sfr::XBR0, URT0E);
        ports.write(sfr::P0SKIP, 0xCF);
        ports.write(sfr::XBR1, XBARE | 1);
        ports
    }

    #[test]
    fn cex0_lands_on_p1_0_when_the_rest_of_port_0_is_skipped() {
        assert_eq!(board().cex_pin(0), Some((1, 0)));
        assert_eq!(board().cex_pin(1), None);
    }

    #[test]
    fn cex0_lands_on_p0_0_when_nothing_is_skipped() {
        let mut ports = board();
        ports.write(sfr::P0SKIP, 0);
        assert_eq!(ports.cex_pin(0), Some((0, 0)));
    }

    #[test]
    fn cex0_takes_the_uarts_pin_when_the_uart_is_off() {
        let mut ports = board();
        ports.write(sfr::XBR0, 0);
        assert_eq!(ports.cex_pin(0), Some((0, 4)));
    }

    #[test]
    fn an_analog_pin_carries_neither_cex0_nor_uart0() {
        let mut ports = board();
        ports.write(sfr::P0MDOUT, TX);
        ports.write(sfr::P1MDIN, 0xFE);
        assert_eq!(ports.cex_pin(0), None);
        for (digital, transmits, receives) in [(0xFF, true, true), (!TX, false, true), (!RX, true, false)] {
            ports.write(sfr::P0MDIN, digital);
            assert_eq!((ports.uart0_transmits(), ports.uart0_receives()), (transmits, receives));
        }
    }

    #[test]
    fn uart0_is_mute_without_urt0e_xbare_or_a_push_pull_tx_and_deaf_without_the_first_two() {
        for (xbr0, xbr1, mdout, transmits, receives) in [
            (URT0E, XBARE, 0x10, true, true),
            (0, XBARE, 0x10, false, false),
            (URT0E, 0, 0x10, false, false),
            (URT0E, XBARE, 0, false, true),
        ] {
            let mut ports = Ports::new();
            for (address, value) in [(sfr::XBR0, xbr0), (sfr::XBR1, xbr1), (sfr::P0MDOUT, mdout)] {
                ports.write(address, value);
            }
            assert_eq!((ports.uart0_transmits(), ports.uart0_receives()), (transmits, receives));
        }
    }

    #[test]
    fn nothing_drives_high_without_xbare_or_push_pull() {
        let mut ports = board();
        assert_eq!(ports.driven_high(2), 0);
        ports.write(sfr::P0MDOUT + 2, 0x0F);
        assert_eq!(ports.driven_high(2), 0x0F);
        ports.write(sfr::XBR1, 0);
        assert_eq!(ports.driven_high(2), 0);
    }

    #[test]
    fn a_switch_to_ground_reads_0_and_an_open_one_1_by_the_weak_pull_up() {
        let mut ports = board();
        assert_eq!(ports.levels(1) & 0x08, 0x08);
        ports.pulls.low[1] = 0x08;
        assert_eq!(ports.levels(1) & 0x08, 0);
        ports.pulls.low[1] = 0;
        ports.write(sfr::XBR1, XBARE | WEAKPUD);
        assert_eq!(ports.levels(1) & 0x08, 0);
    }

    #[test]
    fn an_input_whose_latch_is_0_reads_0_whatever_the_world_does() {
        let mut ports = board();
        ports.pulls.high[1] = 0x01;
        assert_eq!(ports.levels(1) & 0x01, 1);
        ports.write(sfr::P1, 0xFE);
        assert_eq!(ports.levels(1) & 0x01, 0);
    }
}
