//! Frames on the serial line: `COBS(type, payload, crc) 0x00` (firmware/README.md, "Frames").

/// A frame's type and payload as bytes on the line.
pub fn encode(kind: u8, payload: &[u8]) -> Vec<u8> {
    let mut body = vec![kind];
    body.extend(payload);
    body.extend(crc32fast::hash(&body).to_le_bytes());
    let mut line = vec![0];
    let mut code_at = 0;
    for byte in body {
        if line.len() - code_at == 0xFF {
            line[code_at] = 0xFF;
            code_at = line.len();
            line.push(0);
        }
        if byte == 0 {
            line[code_at] = (line.len() - code_at) as u8;
            code_at = line.len();
            line.push(0);
        } else {
            line.push(byte);
        }
    }
    line[code_at] = (line.len() - code_at) as u8;
    line.push(0);
    line
}

/// What is between two zeros on the line as a frame's type and payload; `None` if its COBS or CRC is wrong.
pub fn decode(line: &[u8]) -> Option<Vec<u8>> {
    let mut body = Vec::with_capacity(line.len());
    let mut rest = line;
    while let Some((&code, after)) = rest.split_first() {
        let run = after.get(..usize::from(code).checked_sub(1)?)?;
        body.extend(run);
        rest = &after[run.len()..];
        if code != 0xFF && !rest.is_empty() {
            body.push(0);
        }
    }
    let (crc, frame) = body.split_last_chunk::<4>().map(|(frame, crc)| (*crc, frame))?;
    (!frame.is_empty() && crc32fast::hash(frame) == u32::from_le_bytes(crc)).then(|| frame.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_come_back_as_they_went() {
        for length in [0, 1, 250, 251, 252, 253, 254, 255, 256, 540] {
            for byte in [0, 1, 0x55] {
                let payload = vec![byte; length];
                let line = encode(0x90, &payload);
                assert!(!line[..line.len() - 1].contains(&0));
                let frame = decode(&line[..line.len() - 1]).unwrap();
                assert_eq!((frame[0], &frame[1..]), (0x90, payload.as_slice()));
            }
        }
    }

    #[test]
    fn a_damaged_frame_is_dropped() {
        let mut line = encode(0x01, &[1, 1]);
        line.pop();
        line[2] ^= 0x40;
        assert_eq!(decode(&line), None);
        assert_eq!(decode(&[5, 1]), None);
    }
}
