//! Every special function register of the chip, by its chapter of the datasheet: address, who answers for it, and which
//! of its bits have a model. A register without an owner and a bit that is not named here are fatal to touch; the table
//! in the README is printed from here.

use super::reload_timer::Register as Of;

/// Direct addresses from here on are registers.
pub const FIRST: u8 = 0x80;

/// Who answers for a register.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Owner {
    Core,
    Interrupts,
    Power,
    Resets,
    Flash,
    Clock,
    MovxPage,
    Ports,
    Uart,
    Timers,
    TimerClocks,
    Timer2Control,
    Timer2(Of),
    Timer3Control,
    Timer3(Of),
    Pca,
    Adc,
}

pub struct Field {
    pub mask: u8,
    /// The datasheet's name, and the values if not all are modelled.
    pub name: &'static str,
}

pub struct Register {
    pub address: u8,
    pub name: &'static str,
    pub chapter: &'static str,
    pub owner: Option<Owner>,
    pub fields: &'static [Field],
}

impl Register {
    /// The bits that have a model.
    pub const fn modelled(&self) -> u8 {
        let (mut bits, mut index) = (0, 0);
        while index < self.fields.len() {
            bits |= self.fields[index].mask;
            index += 1;
        }
        bits
    }
}

macro_rules! registers {
    ($($chapter:literal { $($name:ident $address:literal $owner:expr, [$($mask:literal $field:literal)*];)* })*) => {
        $($(pub const $name: u8 = $address;)*)*

        pub const TABLE: &[Register] = &[$($(Register {
            address: $name,
            name: stringify!($name),
            chapter: $chapter,
            owner: $owner,
            fields: &[$(Field { mask: $mask, name: $field }),*],
        }),*),*];
    };
}

registers! {
    "CIP-51" {
        SP       0x81 Some(Owner::Core), [0xFF "SP"];
        DPL      0x82 Some(Owner::Core), [0xFF "DPL"];
        DPH      0x83 Some(Owner::Core), [0xFF "DPH"];
        PSW      0xD0 Some(Owner::Core), [0x80 "CY" 0x40 "AC" 0x20 "F0" 0x18 "RS" 0x04 "OV" 0x02 "F1" 0x01 "PARITY"];
        ACC      0xE0 Some(Owner::Core), [0xFF "ACC"];
        B        0xF0 Some(Owner::Core), [0xFF "B"];
    }
    "CIP-51: Interrupt Handler" {
        IE       0xA8 Some(Owner::Interrupts), [0x80 "EA" 0x20 "ET2" 0x10 "ES0" 0x08 "ET1" 0x02 "ET0"];
        IP       0xB8 Some(Owner::Interrupts), [0x80 "(7)" 0x20 "PT2" 0x10 "PS0" 0x08 "PT1" 0x02 "PT0"];
        EIE1     0xE6 Some(Owner::Interrupts), [0x80 "ET3" 0x10 "EPCA0"];
        EIE2     0xE7 Some(Owner::Interrupts), [];
        EIP1     0xF6 Some(Owner::Interrupts), [0x80 "PT3" 0x10 "PPCA0"];
        EIP2     0xF7 Some(Owner::Interrupts), [];
    }
    "CIP-51: Power Management Modes" {
        PCON     0x87 Some(Owner::Power), [0xFC "GF" 0x01 "IDLE"];
    }
    "Prefetch Engine" {
        PFE0CN   0xAF Some(Owner::Clock), [0x20 "PFEN"];
    }
    "Reset Sources" {
        VDM0CN   0xFF Some(Owner::Resets), [0x80 "VDMEN" 0x40 "VDDSTAT"];
        RSTSRC   0xEF Some(Owner::Resets), [0x40 "FERROR" 0x10 "SWRSF" 0x08 "WDTRSF" 0x02 "PORSF" 0x01 "PINRSF"];
    }
    "Flash Memory" {
        PSCTL    0x8F Some(Owner::Flash), [0x02 "PSEE" 0x01 "PSWE"];
        FLKEY    0xB7 Some(Owner::Flash), [0xFF "FLKEY"];
        FLSCL    0xB6 Some(Owner::Clock), [0x80 "FOSE" 0x10 "FLRT"];
    }
    "External Data Memory Interface and On-Chip XRAM" {
        EMI0CN   0xAA Some(Owner::MovxPage), [0xFF "PGSEL"];
        EMI0CF   0x85 None, [];
        EMI0TC   0x84 None, [];
    }
    "Oscillators" {
        OSCICN   0xB2 Some(Owner::Clock), [0x80 "IOSCEN" 0x40 "IFRDY" 0x03 "IFCN"];
        CLKMUL   0xB9 Some(Owner::Clock), [0x80 "MULEN" 0x40 "MULINIT" 0x20 "MULRDY"];
        CLKSEL   0xA9 Some(Owner::Clock), [0x03 "CLKSL = 0, 2, 3"];
        OSCICL   0xB3 None, [];
        OSCLCN   0x86 None, [];
        OSCXCN   0xB1 None, [];
    }
    "Port Input/Output" {
        XBR0     0xE1 Some(Owner::Ports), [0x01 "URT0E"];
        XBR1     0xE2 Some(Owner::Ports), [0x80 "WEAKPUD" 0x40 "XBARE" 0x07 "PCA0ME"];
        XBR2     0xE3 Some(Owner::Ports), [];
        P0       0x80 Some(Owner::Ports), [0xFF "P0"];
        P1       0x90 Some(Owner::Ports), [0xFF "P1"];
        P2       0xA0 Some(Owner::Ports), [0xFF "P2"];
        P3       0xB0 Some(Owner::Ports), [0xFF "P3"];
        P4       0xC7 Some(Owner::Ports), [0xFF "P4"];
        P0MDOUT  0xA4 Some(Owner::Ports), [0xFF "P0MDOUT"];
        P1MDOUT  0xA5 Some(Owner::Ports), [0xFF "P1MDOUT"];
        P2MDOUT  0xA6 Some(Owner::Ports), [0xFF "P2MDOUT"];
        P3MDOUT  0xA7 Some(Owner::Ports), [0xFF "P3MDOUT"];
        P4MDOUT  0xAE Some(Owner::Ports), [0xFF "P4MDOUT"];
        P0MDIN   0xF1 Some(Owner::Ports), [0xFF "P0MDIN"];
        P1MDIN   0xF2 Some(Owner::Ports), [0xFF "P1MDIN"];
        P2MDIN   0xF3 Some(Owner::Ports), [0xFF "P2MDIN"];
        P3MDIN   0xF4 Some(Owner::Ports), [0xFF "P3MDIN"];
        P4MDIN   0xF5 Some(Owner::Ports), [0xFF "P4MDIN"];
        P0SKIP   0xD4 Some(Owner::Ports), [0xFF "P0SKIP"];
        P1SKIP   0xD5 Some(Owner::Ports), [0xFF "P1SKIP"];
        P2SKIP   0xD6 Some(Owner::Ports), [0xFF "P2SKIP"];
        P3SKIP   0xDF Some(Owner::Ports), [0xFF "P3SKIP"];
    }
    "UART0" {
        SCON0    0x98 Some(Owner::Uart), [0x40 "(6)" 0x10 "REN0" 0x02 "TI0" 0x01 "RI0"];
        SBUF0    0x99 Some(Owner::Uart), [0xFF "SBUF0"];
    }
    "Timers: Timer 0 and Timer 1" {
        TCON     0x88 Some(Owner::Timers), [0x80 "TF1" 0x40 "TR1" 0x20 "TF0" 0x10 "TR0" 0x0F "IE1 IT1 IE0 IT0 (kept)"];
        TMOD     0x89 Some(Owner::Timers), [0x30 "T1M = 0, 1, 2" 0x03 "T0M = 0, 1, 2"];
        CKCON    0x8E Some(Owner::TimerClocks), [0x40 "T3ML" 0x10 "T2ML" 0x08 "T1M" 0x04 "T0M" 0x03 "SCA = 0, 1, 2"];
        TL0      0x8A Some(Owner::Timers), [0xFF "TL0"];
        TL1      0x8B Some(Owner::Timers), [0xFF "TL1"];
        TH0      0x8C Some(Owner::Timers), [0xFF "TH0"];
        TH1      0x8D Some(Owner::Timers), [0xFF "TH1"];
    }
    "Timers: Timer 2" {
        TMR2CN   0xC8 Some(Owner::Timer2Control), [0x80 "TF2H" 0x40 "TF2L" 0x20 "TF2LEN" 0x04 "TR2"];
        TMR2RLL  0xCA Some(Owner::Timer2(Of::ReloadLow)), [0xFF "TMR2RLL"];
        TMR2RLH  0xCB Some(Owner::Timer2(Of::ReloadHigh)), [0xFF "TMR2RLH"];
        TMR2L    0xCC Some(Owner::Timer2(Of::Low)), [0xFF "TMR2L"];
        TMR2H    0xCD Some(Owner::Timer2(Of::High)), [0xFF "TMR2H"];
    }
    "Timers: Timer 3" {
        TMR3CN   0x91 Some(Owner::Timer3Control), [0x80 "TF3H" 0x40 "TF3L" 0x20 "TF3LEN" 0x04 "TR3"];
        TMR3RLL  0x92 Some(Owner::Timer3(Of::ReloadLow)), [0xFF "TMR3RLL"];
        TMR3RLH  0x93 Some(Owner::Timer3(Of::ReloadHigh)), [0xFF "TMR3RLH"];
        TMR3L    0x94 Some(Owner::Timer3(Of::Low)), [0xFF "TMR3L"];
        TMR3H    0x95 Some(Owner::Timer3(Of::High)), [0xFF "TMR3H"];
    }
    "Programmable Counter Array" {
        PCA0CN   0xD8 Some(Owner::Pca), [0x80 "CF" 0x40 "CR" 0x1F "CCF"];
        PCA0MD   0xD9 Some(Owner::Pca), [0x80 "CIDL" 0x40 "WDTE" 0x20 "WDLCK" 0x0E "CPS = 0, 1, 4" 0x01 "ECF"];
        PCA0CPM0 0xDA Some(Owner::Pca), [0x40 "ECOM0" 0x20 "CAPP0" 0x10 "CAPN0" 0x08 "MAT0" 0x01 "ECCF0"];
        PCA0CPM1 0xDB Some(Owner::Pca), [0x40 "ECOM1" 0x20 "CAPP1" 0x10 "CAPN1" 0x08 "MAT1" 0x01 "ECCF1"];
        PCA0CPM2 0xDC Some(Owner::Pca), [0x40 "ECOM2" 0x20 "CAPP2" 0x10 "CAPN2" 0x08 "MAT2" 0x01 "ECCF2"];
        PCA0CPM3 0xDD Some(Owner::Pca), [0x40 "ECOM3" 0x20 "CAPP3" 0x10 "CAPN3" 0x08 "MAT3" 0x01 "ECCF3"];
        PCA0CPM4 0xDE Some(Owner::Pca), [0x40 "ECOM4" 0x20 "CAPP4" 0x10 "CAPN4" 0x08 "MAT4" 0x01 "ECCF4"];
        PCA0L    0xF9 Some(Owner::Pca), [0xFF "PCA0L"];
        PCA0H    0xFA Some(Owner::Pca), [0xFF "PCA0H"];
        PCA0CPL0 0xFB Some(Owner::Pca), [0xFF "PCA0CPL0"];
        PCA0CPH0 0xFC Some(Owner::Pca), [0xFF "PCA0CPH0"];
        PCA0CPL1 0xE9 Some(Owner::Pca), [0xFF "PCA0CPL1"];
        PCA0CPH1 0xEA Some(Owner::Pca), [0xFF "PCA0CPH1"];
        PCA0CPL2 0xEB Some(Owner::Pca), [0xFF "PCA0CPL2"];
        PCA0CPH2 0xEC Some(Owner::Pca), [0xFF "PCA0CPH2"];
        PCA0CPL3 0xED Some(Owner::Pca), [0xFF "PCA0CPL3"];
        PCA0CPH3 0xEE Some(Owner::Pca), [0xFF "PCA0CPH3"];
        PCA0CPL4 0xFD Some(Owner::Pca), [0xFF "PCA0CPL4"];
        PCA0CPH4 0xFE Some(Owner::Pca), [0xFF "PCA0CPH4"];
    }
    "10-Bit ADC" {
        AMX0P    0xBB Some(Owner::Adc), [0x1F "AMX0P = 0x1E"];
        AMX0N    0xBA Some(Owner::Adc), [0x1F "AMX0N = 0x1F"];
        ADC0CF   0xBC Some(Owner::Adc), [0xF8 "AD0SC" 0x04 "AD0LJST"];
        ADC0CN   0xE8 Some(Owner::Adc), [0x80 "AD0EN" 0x40 "AD0TM" 0x20 "AD0INT" 0x10 "AD0BUSY"];
        ADC0L    0xBD Some(Owner::Adc), [0xFF "ADC0L"];
        ADC0H    0xBE Some(Owner::Adc), [0xFF "ADC0H"];
        ADC0GTL  0xC3 None, [];
        ADC0GTH  0xC4 None, [];
        ADC0LTL  0xC5 None, [];
        ADC0LTH  0xC6 None, [];
    }
    "Voltage Reference" {
        REF0CN   0xD1 Some(Owner::Adc), [0x04 "TEMPE" 0x02 "BIASE" 0x01 "REFBE"];
    }
    "Comparators" {
        CPT0CN   0x9B None, [];
        CPT0MD   0x9D None, [];
        CPT0MX   0x9F None, [];
        CPT1CN   0x9A None, [];
        CPT1MD   0x9C None, [];
        CPT1MX   0x9E None, [];
    }
    "Voltage Regulator" {
        REG0CN   0xC9 None, [];
    }
    "CIP-51: External Interrupts" {
        IT01CF   0xE4 None, [];
    }
    "Universal Serial Bus Controller" {
        USB0ADR  0x96 None, [];
        USB0DAT  0x97 None, [];
        USB0XCN  0xD7 None, [];
    }
    "SMBus" {
        SMB0CN   0xC0 None, [];
        SMB0CF   0xC1 None, [];
        SMB0DAT  0xC2 None, [];
    }
    "UART1" {
        SCON1    0xD2 None, [];
        SBUF1    0xD3 None, [];
        SMOD1    0xE5 None, [];
        SBCON1   0xAC None, [];
        SBRLL1   0xB4 None, [];
        SBRLH1   0xB5 None, [];
    }
    "Enhanced Serial Peripheral Interface" {
        SPI0CFG  0xA1 None, [];
        SPI0CKR  0xA2 None, [];
        SPI0DAT  0xA3 None, [];
        SPI0CN   0xF8 None, [];
    }
}

/// Who answers for each address.
pub static OWNERS: [Option<Owner>; 256] = {
    let (mut owners, mut index) = ([None; 256], 0);
    while index < TABLE.len() {
        owners[TABLE[index].address as usize] = TABLE[index].owner;
        index += 1;
    }
    owners
};

/// The modelled bits of each address.
pub static MODELLED: [u8; 256] = {
    let (mut bits, mut index) = ([0; 256], 0);
    while index < TABLE.len() {
        bits[TABLE[index].address as usize] = TABLE[index].modelled();
        index += 1;
    }
    bits
};

/// The datasheet's name of a register.
pub fn name(address: u8) -> &'static str {
    TABLE.iter().find(|register| register.address == address).map_or("no register", |register| register.name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_address_and_no_bit_is_there_twice() {
        for (index, register) in TABLE.iter().enumerate() {
            assert!(register.address >= FIRST);
            assert!(
                TABLE[index + 1..].iter().all(|other| other.address != register.address),
                "{}",
                register.name
            );
            let bits: u32 = register.fields.iter().map(|field| field.mask.count_ones()).sum();
            assert_eq!(bits, register.modelled().count_ones(), "{}", register.name);
        }
    }
}
