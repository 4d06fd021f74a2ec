//! A host inside the simulator, for measuring: it starts continuous sweeps and acknowledges each.

use crate::fleet::frame::{decode, encode};

const ASK_STATUS: u8 = 0x02;
const START: u8 = 0x05;
const HOME: u8 = 0x08;
const ACK_2: u8 = 0x10;
const ACK: u8 = 0x12;
const HELLO: u8 = 0x81;
const STATUS: u8 = 0x82;
const SWEEP_2: u8 = 0x90;
const SWEEP: u8 = 0x91;
/// What names a sweep, and its acknowledgement: boot, sequence, serial number and life; of protocol 2 the first two.
const NAME_BYTES: usize = 14;
const NAME_2_BYTES: usize = 6;
const IDLE: u8 = 0;
const HOMED: u8 = 0x01;
const STARTED: u8 = 0x02;

#[derive(Default)]
pub struct Host {
    line: Vec<u8>,
    request: u8,
    last: Option<(u16, u32)>,
    pub sweeps: u64,
    pub resent: u64,
    pub missed: u64,
    pub bad_frames: u64,
}

impl Host {
    /// Takes bytes of the unit and gives the answer.
    pub fn answer(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut answer = Vec::new();
        for &byte in bytes {
            if byte != 0 {
                self.line.push(byte);
                continue;
            }
            let line = std::mem::take(&mut self.line);
            match decode(&line) {
                Some(frame) => answer.extend(self.answer_frame(frame[0], &frame[1..])),
                None if line.is_empty() => {}
                None => self.bad_frames += 1,
            }
        }
        answer
    }

    fn answer_frame(&mut self, kind: u8, payload: &[u8]) -> Vec<u8> {
        match kind {
            HELLO => self.ask(ASK_STATUS, &[]),
            STATUS if payload[1] == IDLE && payload[2] & STARTED == 0 => {
                if payload[2] & HOMED != 0 {
                    self.ask(START, &[0, 0])
                } else {
                    self.ask(HOME, &[])
                }
            }
            SWEEP => self.acknowledge(ACK, payload, NAME_BYTES),
            SWEEP_2 => self.acknowledge(ACK_2, payload, NAME_2_BYTES),
            _ => Vec::new(),
        }
    }

    fn acknowledge(&mut self, kind: u8, payload: &[u8], name_bytes: usize) -> Vec<u8> {
        let boot = u16::from_le_bytes([payload[0], payload[1]]);
        let sequence = u32::from_le_bytes([payload[2], payload[3], payload[4], payload[5]]);
        match self.last {
            Some(last) if last == (boot, sequence) => self.resent += 1,
            last => {
                if let Some((last_boot, last_sequence)) = last {
                    self.missed += u64::from(last_boot != boot || last_sequence + 1 != sequence);
                }
                self.sweeps += 1;
            }
        }
        self.last = Some((boot, sequence));
        encode(kind, &payload[..name_bytes])
    }

    fn ask(&mut self, kind: u8, payload: &[u8]) -> Vec<u8> {
        self.request = self.request % 255 + 1;
        let mut body = vec![self.request];
        body.extend(payload);
        encode(kind, &body)
    }
}
