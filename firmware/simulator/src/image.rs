//! What is in a unit's flash before its first power-up: the firmware's Intel hex file and the settings page.

use crate::chip::flash::FLASH_SIZE;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// firmware/README.md, "Flash".
const SETTINGS_PAGE: usize = 0xF600;
const SETTINGS_MAGIC: u16 = 0x4E43;
const SETTINGS_VERSION: u8 = 2;
const GENERATION: u16 = 0;

#[derive(Debug, Error)]
pub enum ImageError {
    #[error("firmware {path}: {source}; build it with `make -C firmware` or name it with --firmware")]
    Unreadable { path: PathBuf, source: std::io::Error },
    #[error("firmware {path}, line {line}: {problem}")]
    Malformed { path: PathBuf, line: usize, problem: &'static str },
}

/// Bytes of flash with their address.
pub type Record = (u16, Vec<u8>);

/// Reads an Intel hex file.
///
/// # Errors
/// An [`ImageError`] naming file and line.
pub fn read_hex(path: &Path) -> Result<Vec<Record>, ImageError> {
    let text = std::fs::read_to_string(path)
        .map_err(|source| ImageError::Unreadable { path: path.into(), source })?;
    let fail = |line, problem| ImageError::Malformed { path: path.into(), line, problem };
    let mut records = Vec::new();
    for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let line_number = index + 1;
        match parse_record(line.trim()).map_err(|problem| fail(line_number, problem))? {
            (0, address, data) => records.push((address, data)),
            (1, ..) => return Ok(records),
            _ => return Err(fail(line_number, "only data and end records fit a 64 KB chip")),
        }
    }
    Err(fail(text.lines().count(), "the end record is missing: the file is cut off"))
}

/// Type, address and data of a line.
fn parse_record(line: &str) -> Result<(u8, u16, Vec<u8>), &'static str> {
    let digits = line.strip_prefix(':').ok_or("does not begin with a colon")?;
    if !digits.is_ascii() || digits.len() % 2 != 0 {
        return Err("is not made of pairs of hex digits");
    }
    let bytes: Vec<u8> = (0..digits.len() / 2)
        .map(|index| u8::from_str_radix(&digits[2 * index..2 * index + 2], 16))
        .collect::<Result<_, _>>()
        .map_err(|_| "is not made of pairs of hex digits")?;
    let [count, high, low, kind, data @ .., _] = bytes.as_slice() else {
        return Err("is too short");
    };
    if data.len() != usize::from(*count) {
        return Err("has another length than it says");
    }
    if bytes.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte)) != 0 {
        return Err("has a wrong checksum");
    }
    Ok((*kind, u16::from_be_bytes([*high, *low]), data.to_vec()))
}

/// An erased flash memory with the firmware in it.
pub fn erased() -> Box<[u8; FLASH_SIZE]> {
    Box::new([0xFF; FLASH_SIZE])
}

/// Flashes the firmware: it replaces what was at its addresses.
pub fn flash_firmware(flash: &mut [u8; FLASH_SIZE], records: &[Record]) {
    for (address, data) in records {
        for (offset, byte) in data.iter().enumerate() {
            flash[usize::from(address.wrapping_add(offset as u16))] = *byte;
        }
    }
}

/// How many bytes of firmware there are, and their CRC-32 in the order of the file.
pub fn sum(records: &[Record]) -> (usize, u32) {
    let mut hasher = crc32fast::Hasher::new();
    records.iter().for_each(|(_, data)| hasher.update(data));
    (records.iter().map(|(_, data)| data.len()).sum(), hasher.finalize())
}

/// Flashes the settings page that gives the unit its serial number.
pub fn flash_settings(flash: &mut [u8; FLASH_SIZE], serial: u32) {
    let mut page = SETTINGS_MAGIC.to_le_bytes().to_vec();
    page.extend([SETTINGS_VERSION, (size_of_val(&GENERATION) + size_of_val(&serial)) as u8]);
    page.extend(GENERATION.to_le_bytes());
    page.extend(serial.to_le_bytes());
    page.extend(crc32fast::hash(&page).to_le_bytes());
    flash[SETTINGS_PAGE..SETTINGS_PAGE + page.len()].copy_from_slice(&page);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_data_record_is_read_and_a_damaged_one_refused() {
        // The example record of Intel's specification (1988), with its checksum.
        assert_eq!(parse_record(":0300300002337A1E"), Ok((0, 0x0030, vec![0x02, 0x33, 0x7A])));
        assert_eq!(parse_record(":0300300002337A1F"), Err("has a wrong checksum"));
        assert_eq!(parse_record(":0200300002337A1E"), Err("has another length than it says"));
    }

    #[test]
    fn the_settings_page_is_laid_out_as_the_firmware_reads_it() {
        let mut flash = erased();
        flash_settings(&mut flash, 7);
        let page = &flash[SETTINGS_PAGE..SETTINGS_PAGE + 14];
        assert_eq!(page[..10], [0x43, 0x4E, 2, 6, 0, 0, 7, 0, 0, 0]);
        assert_eq!(page[10..], crc32fast::hash(&page[..10]).to_le_bytes());
    }
}
