//! What the CPU core sees of the chip: SFRs, XRAM or flash behind MOVX, and code.

use super::Chip;
use super::flash::{Operation, RESERVED};
use super::reset::Cause;
use i8051::{CpuContext, CpuView, MemoryMapper, PortMapper, ReadOnlyMemoryMapper};

pub const XRAM_SIZE: usize = 4096;
pub type Xram = Box<[u8; XRAM_SIZE]>;

impl CpuContext for Chip {
    type Ports = Chip;
    type Xdata = Chip;
    type Code = Chip;

    #[inline]
    fn ports(&self) -> &Chip {
        self
    }
    #[inline]
    fn xdata(&self) -> &Chip {
        self
    }
    #[inline]
    fn code(&self) -> &Chip {
        self
    }
    #[inline]
    fn ports_mut(&mut self) -> &mut Chip {
        self
    }
    #[inline]
    fn xdata_mut(&mut self) -> &mut Chip {
        self
    }
    #[inline]
    fn code_mut(&mut self) -> &mut Chip {
        self
    }
}

impl PortMapper for Chip {
    type WriteValue = (u8, u8);

    fn interest<C: CpuView>(&self, _cpu: &C, _address: u8) -> bool {
        true
    }

    fn read<C: CpuView>(&self, _cpu: &C, address: u8) -> u8 {
        self.read_sfr(address).unwrap_or_else(|violation| {
            self.report(violation);
            0
        })
    }

    /// The core also asks for the latch of P2 to complete the address of a MOVX @Ri, which on this chip is in EMI0CN.
    fn read_latch<C: CpuView>(&self, _cpu: &C, address: u8) -> u8 {
        if self.pages_movx { self.emi0cn } else { self.ports.latch(address) }
    }

    fn prepare_write<C: CpuView>(&self, _cpu: &C, address: u8, value: u8) -> (u8, u8) {
        (address, value)
    }

    fn write(&mut self, (address, value): (u8, u8)) {
        if let Err(violation) = self.write_sfr(address, value) {
            self.report(violation);
        }
    }
}

impl MemoryMapper for Chip {
    type WriteValue = (u16, u8);

    fn len(&self) -> u32 {
        XRAM_SIZE as u32
    }

    /// Addresses above the on-chip memory alias into it (EMI0CF's reset value: on-chip only).
    #[inline]
    fn read<C: CpuView>(&self, _cpu: &C, address: u32) -> u8 {
        self.xram[address as usize % XRAM_SIZE]
    }

    fn prepare_write<C: CpuView>(&self, _cpu: &C, address: u32, value: u8) -> (u16, u8) {
        (address as u16, value)
    }

    #[inline]
    fn write(&mut self, (address, value): (u16, u8)) {
        if self.flash.takes_movx() {
            self.write_flash(address, value);
        } else {
            self.xram[address as usize % XRAM_SIZE] = value;
        }
    }
}

impl ReadOnlyMemoryMapper for Chip {
    fn len(&self) -> u32 {
        0x1_0000
    }

    #[inline]
    fn read<C: CpuView>(&self, _cpu: &C, address: u32) -> u8 {
        self.flash.byte(address as u16)
    }
}

impl Chip {
    fn write_flash(&mut self, address: u16, value: u8) {
        self.touched.set(true);
        self.rescheduled = true;
        match self.flash.movx(address, value, self.resets.supply_monitored()) {
            Ok(Operation::Done(stall)) => self.stalled_until = self.now + stall,
            Ok(Operation::Refused) => {}
            Ok(Operation::FlashError) => self.fail_flash(),
            Err(violation) => self.report(violation),
        }
    }

    /// Fetching or reading (MOVC) the reserved area resets the chip.
    #[inline]
    pub fn check_code_address(&self, address: u16) {
        if address >= RESERVED {
            self.fail_flash();
        }
    }

    #[cold]
    fn fail_flash(&self) {
        self.touched.set(true);
        self.reset_request.set(Some(Cause::FlashError));
    }
}
