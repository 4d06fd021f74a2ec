//! The programmable counter array (datasheet chapter "Programmable Counter Array (PCA0)"): a 16-bit counter,
//! five modules that capture edges or act as software timers, and the watchdog of module 4.

use crate::chip::pca_counter::Counter;
use crate::chip::sfr;
use crate::chip::violation::Violation;
use crate::time::Tick;
use std::cell::Cell;

const CF: u8 = 0x80;
const CR: u8 = 0x40;
const CIDL: u8 = 0x80;
const WDTE: u8 = 0x40;
const WDLCK: u8 = 0x20;
const CPS: u8 = 0x0E;
const ECF: u8 = 0x01;
const ECOM: u8 = 0x40;
const CAPP: u8 = 0x20;
const CAPN: u8 = 0x10;
const MAT: u8 = 0x08;
const ECCF: u8 = 0x01;
const MODULES: usize = 5;
const WATCHDOG_MODULE: usize = 4;

#[derive(Clone, Copy, Default)]
struct Module {
    mode: u8,
    capture: u16,
    /// A match of a software timer needs ECOM; writing the low byte clears it, writing the high byte sets it.
    matches_at: Option<Tick>,
}

pub struct Pca {
    flags: u8,
    run: bool,
    mode: u8,
    counter: Counter,
    high_snapshot: Cell<u8>,
    modules: [Module; MODULES],
    /// The counter's total at which the watchdog bites.
    watchdog_due: Option<u64>,
    /// The counter's total when the watchdog was last fed, and what the CPU has slept since; and the most that it has
    /// worked between two feedings.
    fed_at: u64,
    asleep_since: u64,
    longest_work: u64,
    idle: bool,
    ticks_per_sysclk: Tick,
    /// Until then a flag that goes up while an instruction changes PCA0CN is lost; 0 for a sound chip.
    pub loses_flags_until: Tick,
    /// Until then an instruction changes PCA0CN: it has read it and is yet to write it.
    changing_until: Tick,
}

impl Pca {
    /// After any reset the watchdog runs, with the shortest time-out: 256 counts of SYSCLK/12.
    pub fn new(ticks_per_sysclk: Tick, now: Tick) -> Self {
        let mut pca = Self {
            flags: 0,
            run: false,
            mode: WDTE,
            counter: Counter::new(now),
            high_snapshot: Cell::new(0),
            modules: [Module::default(); MODULES],
            watchdog_due: None,
            fed_at: 0,
            asleep_since: 0,
            longest_work: 0,
            idle: false,
            ticks_per_sysclk,
            loses_flags_until: 0,
            changing_until: 0,
        };
        pca.change_rate();
        pca.feed_watchdog();
        pca
    }

    /// Brings counter and flags up to `now`.
    pub fn sync(&mut self, now: Tick) {
        let wraps_at = self.counter.wraps_at();
        if self.counter.sync(now) {
            self.raise(CF, wraps_at);
        }
        for index in 0..MODULES {
            if let Some(at) = self.modules[index].matches_at.filter(|at| *at <= now) {
                self.raise(1 << index, at);
                self.schedule_match(index);
            }
        }
    }

    /// An instruction that reads, changes and writes PCA0CN takes until then: call after `sync`.
    pub fn change_control_until(&mut self, end: Tick) {
        self.changing_until = end;
    }

    /// Puts up a flag; it is lost on a chip that loses flags, where an instruction is changing PCA0CN at that time.
    fn raise(&mut self, flag: u8, at: Tick) {
        if at > self.changing_until || at >= self.loses_flags_until {
            self.flags |= flag;
        }
    }

    /// The system clock has changed: call after `sync`.
    pub fn set_clock(&mut self, ticks_per_sysclk: Tick) {
        self.ticks_per_sysclk = ticks_per_sysclk;
        self.change_rate();
    }

    /// The CPU goes to sleep or wakes up: call after `sync`. The counter stops in idle mode if CIDL is set.
    pub fn set_idle(&mut self, idle: bool) {
        if idle {
            self.asleep_since = self.counter.total();
        } else if self.idle {
            self.fed_at += self.counter.total() - self.asleep_since;
        }
        self.idle = idle;
        if self.mode & CIDL != 0 {
            self.change_rate();
        }
    }

    /// Call after `sync`. Reading the low byte latches the high one.
    pub fn read(&self, address: u8) -> u8 {
        match address {
            sfr::PCA0CN => self.flags | if self.run { CR } else { 0 },
            sfr::PCA0MD => self.mode,
            sfr::PCA0CPM0..=sfr::PCA0CPM4 => self.modules[(address - sfr::PCA0CPM0) as usize].mode,
            sfr::PCA0L => {
                let [low, high] = self.counter.value().to_le_bytes();
                self.high_snapshot.set(high);
                low
            }
            sfr::PCA0H => self.high_snapshot.get(),
            _ => {
                let (module, high) = capture_register(address);
                self.modules[module].capture.to_le_bytes()[usize::from(high)]
            }
        }
    }

    /// Call after `sync`.
    ///
    /// # Errors
    /// A [`Violation`] for counter sources that are not modelled, and for writes to the counter under the watchdog.
    pub fn write(&mut self, address: u8, value: u8) -> Result<(), Violation> {
        match address {
            sfr::PCA0CN => self.write_control(value),
            sfr::PCA0MD => self.write_mode(value)?,
            sfr::PCA0CPM0..=sfr::PCA0CPM4 => {
                self.write_module_mode((address - sfr::PCA0CPM0) as usize, value);
            }
            sfr::PCA0L | sfr::PCA0H if self.watchdog_enabled() => {
                return Err(Violation::rule(
                    "PCA0L and PCA0H can't be written while the watchdog is enabled",
                ));
            }
            sfr::PCA0L | sfr::PCA0H => self.counter.write(address == sfr::PCA0H, value),
            _ => self.write_capture(address, value),
        }
        self.change_rate();
        Ok(())
    }

    /// An edge on the pin of a module, at its exact time.
    pub fn edge(&mut self, module: usize, rising: bool, at: Tick) {
        let wanted = if rising { CAPP } else { CAPN };
        if self.modules[module].mode & wanted != 0 {
            self.modules[module].capture = self.counter.value_at(at);
            self.raise(1 << module, at);
        }
    }

    /// Whether the array asks for its interrupt.
    pub fn pending(&self) -> bool {
        self.flags & CF != 0 && self.mode & ECF != 0
            || (0..MODULES).any(|index| self.flags & 1 << index != 0 && self.modules[index].mode & ECCF != 0)
    }

    /// When a flag will next go up or the watchdog will bite.
    pub fn next_event(&self) -> Tick {
        let watchdog =
            self.watchdog_due.map(|due| self.counter.after(due.saturating_sub(self.counter.total())));
        let matches = self.modules.iter().filter_map(|module| module.matches_at);
        matches.chain(watchdog).fold(self.counter.wraps_at(), Tick::min)
    }

    /// Call after `sync`.
    pub fn watchdog_bites(&self) -> bool {
        self.watchdog_due.is_some_and(|due| self.counter.total() >= due)
    }

    fn watchdog_enabled(&self) -> bool {
        self.mode & WDTE != 0
    }

    /// While the watchdog is enabled the counter runs whatever CR says.
    fn counting(&self) -> bool {
        (self.run || self.watchdog_enabled()) && !(self.idle && self.mode & CIDL != 0)
    }

    fn period(&self) -> Tick {
        self.ticks_per_sysclk
            * match self.mode & CPS {
                0x00 => 12,
                0x02 => 4,
                _ => 1,
            }
    }

    fn write_control(&mut self, value: u8) {
        self.flags = value & !CR;
        self.run = value & CR != 0;
    }

    /// Clock source and idle control are frozen while the watchdog is enabled, and WDTE itself once it is locked.
    fn write_mode(&mut self, value: u8) -> Result<(), Violation> {
        let was_enabled = self.watchdog_enabled();
        let frozen = if was_enabled { CIDL | CPS } else { 0 };
        let locked = if self.mode & WDLCK != 0 { WDTE | WDLCK } else { 0 };
        let kept = frozen | locked;
        self.mode = self.mode & kept | value & !kept;
        if !matches!(self.mode & CPS, 0x00 | 0x02 | 0x08) {
            return Err(Violation::rule(format!("PCA0MD.CPS = {} is not modelled", (self.mode & CPS) >> 1)));
        }
        match (was_enabled, self.watchdog_enabled()) {
            (false, true) => self.feed_watchdog(),
            (true, false) => {
                self.note_work();
                self.watchdog_due = None;
            }
            _ => {}
        }
        Ok(())
    }

    fn write_module_mode(&mut self, module: usize, value: u8) {
        if module != WATCHDOG_MODULE || !self.watchdog_enabled() {
            self.modules[module].mode = value;
        }
    }

    fn write_capture(&mut self, address: u8, value: u8) {
        let (module, high) = capture_register(address);
        let mut bytes = self.modules[module].capture.to_le_bytes();
        bytes[usize::from(high)] = value;
        self.modules[module].capture = u16::from_le_bytes(bytes);
        if module == WATCHDOG_MODULE && self.watchdog_enabled() {
            if high {
                self.feed_watchdog();
            }
        } else if high {
            self.modules[module].mode |= ECOM;
        } else {
            self.modules[module].mode &= !ECOM;
        }
    }

    /// Time-out in counts, by the datasheet's watchdog equation: 256 * PCA0CPL4 + (256 - PCA0L).
    fn feed_watchdog(&mut self) {
        let offset = u64::from(self.modules[WATCHDOG_MODULE].capture as u8);
        let counts = 256 * offset + 256 - u64::from(self.counter.value() as u8);
        self.note_work();
        self.fed_at = self.counter.total();
        self.watchdog_due = Some(self.fed_at + counts);
    }

    fn note_work(&mut self) {
        if self.watchdog_due.is_some() {
            self.longest_work = self.longest_work.max(self.counter.total() - self.fed_at);
        }
    }

    /// The longest that the CPU has worked between two feedings of the watchdog, by the counter's present rate.
    pub fn longest_work(&self) -> Tick {
        self.longest_work * self.period()
    }

    /// The counter may run at another rate from now on: what is due after some counts is due at another time.
    fn change_rate(&mut self) {
        self.counter.set_rate(self.counting().then(|| self.period()));
        (0..MODULES).for_each(|index| self.schedule_match(index));
    }

    fn schedule_match(&mut self, index: usize) {
        let module = self.modules[index];
        let is_timer = module.mode & (ECOM | MAT) == ECOM | MAT;
        self.modules[index].matches_at = is_timer.then(|| self.counter.reaches(module.capture));
    }
}

/// Module and byte (high?) of a PCA0CPLn or PCA0CPHn.
fn capture_register(address: u8) -> (usize, bool) {
    match address {
        sfr::PCA0CPL0 | sfr::PCA0CPH0 => (0, address == sfr::PCA0CPH0),
        sfr::PCA0CPL4 | sfr::PCA0CPH4 => (WATCHDOG_MODULE, address == sfr::PCA0CPH4),
        _ => {
            let offset = address - sfr::PCA0CPL1;
            (1 + offset as usize / 2, offset % 2 == 1)
        }
    }
}
