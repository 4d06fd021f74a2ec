//! Which serial lines have something to read, asked of the operating system once for all of them.

use crate::fleet::line::Line;
use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use std::io;

/// For each line whether it has something to read, or someone to welcome or to take leave of; where there is no line, no.
///
/// # Errors
/// Those of the operating system.
pub fn ready<'a>(lines: impl Iterator<Item = Option<&'a Line>>) -> io::Result<Vec<bool>> {
    let mut ends = Vec::new();
    let mut counts = Vec::new();
    for line in lines {
        let before = ends.len();
        let descriptors = line.into_iter().flat_map(Line::descriptors);
        ends.extend(descriptors.map(|descriptor| PollFd::new(descriptor, PollFlags::POLLIN)));
        counts.push(ends.len() - before);
    }
    match poll(&mut ends, PollTimeout::ZERO) {
        // A signal in mid-call, as one that ends the simulator: the next look finds what this one has not.
        Ok(0) | Err(Errno::EINTR) => return Ok(vec![false; counts.len()]),
        Ok(_) => {}
        Err(error) => return Err(error.into()),
    }
    let mut ends = ends.iter().map(|end| end.any() != Some(false));
    Ok(counts.into_iter().map(|count| ends.by_ref().take(count).fold(false, |any, end| any | end)).collect())
}
