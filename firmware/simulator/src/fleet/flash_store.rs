//! Flash memories kept in files from run to run, one a unit.

use crate::chip::flash::FLASH_SIZE;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

pub struct FlashStore {
    path: PathBuf,
}

impl FlashStore {
    /// The store of the unit with that serial number, in a directory that is made if need be.
    ///
    /// # Errors
    /// Those of the file system.
    pub fn open(directory: &Path, serial: u32) -> io::Result<Self> {
        std::fs::create_dir_all(directory)?;
        Ok(Self { path: directory.join(format!("unit-{serial}.flash")) })
    }

    /// The flash memory of the last run, or `None` before the first.
    ///
    /// # Errors
    /// Those of the file system, and `InvalidData` for a file of another size.
    pub fn load(&self) -> io::Result<Option<Box<[u8; FLASH_SIZE]>>> {
        let bytes = match std::fs::read(&self.path) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            bytes => bytes?,
        };
        let wrong_size =
            |_| io::Error::new(ErrorKind::InvalidData, format!("{} is not 64 KB", self.path.display()));
        bytes.into_boxed_slice().try_into().map(Some).map_err(wrong_size)
    }

    /// Replaces the file whole: a simulator killed in between leaves the old one.
    ///
    /// # Errors
    /// Those of the file system.
    pub fn save(&self, flash: &[u8; FLASH_SIZE]) -> io::Result<()> {
        let draft = self.path.with_extension("flash.new");
        std::fs::write(&draft, flash)?;
        std::fs::rename(draft, &self.path)
    }
}
