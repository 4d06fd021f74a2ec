//! CRC-16/XMODEM: polynomial 0x1021, initial value 0.

pub fn crc16_xmodem(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc, &byte| {
        (0..8).fold(
            crc ^ u16::from(byte) << 8,
            |crc, _| {
                if crc & 0x8000 != 0 { crc << 1 ^ 0x1021 } else { crc << 1 }
            },
        )
    })
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_check_value_is_that_of_the_crc_catalogue() {
        assert_eq!(super::crc16_xmodem(b"123456789"), 0x31C3);
    }
}
