//! A unit's serial line as clients see it: a TCP port or a pseudo-terminal, one client at a time.
//!
//! What is sent while nobody is connected is lost, as on an unplugged cable.

use nix::fcntl::{FcntlArg, OFlag, fcntl, open};
use nix::pty::{PtyMaster, grantpt, posix_openpt, ptsname_r, unlockpt};
use nix::sys::stat::Mode;
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};
use std::path::{Path, PathBuf};

/// What a client may leave unread; further bytes are lost, as in a serial adapter's driver.
const UNREAD_LIMIT: usize = 64 * 1024;

enum End {
    Tcp { listener: TcpListener, client: Option<TcpStream> },
    Pty { master: PtyMaster, link: PathBuf },
}

pub struct Line {
    end: End,
    unread: VecDeque<u8>,
}

impl Line {
    /// Listens on a TCP address.
    ///
    /// # Errors
    /// Those of the operating system.
    pub fn tcp(address: SocketAddr) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        Ok(Self::new(End::Tcp { listener, client: None }))
    }

    /// Opens a pseudo-terminal and makes `link` a symbolic link to it, in place of an old link.
    ///
    /// # Errors
    /// Those of the operating system.
    pub fn pty(link: &Path) -> io::Result<Self> {
        let master = posix_openpt(OFlag::O_RDWR | OFlag::O_NOCTTY | OFlag::O_NONBLOCK)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        let device = ptsname_r(&master)?;
        let slave = open(device.as_str(), OFlag::O_RDWR | OFlag::O_NOCTTY, Mode::empty())?;
        let mut settings = tcgetattr(&slave)?;
        cfmakeraw(&mut settings);
        tcsetattr(&slave, SetArg::TCSANOW, &settings)?;
        if link.is_symlink() {
            std::fs::remove_file(link)?;
        }
        std::os::unix::fs::symlink(&device, link)?;
        fcntl(&master, FcntlArg::F_SETFL(OFlag::O_NONBLOCK))?;
        Ok(Self::new(End::Pty { master, link: link.into() }))
    }

    fn new(end: End) -> Self {
        Self { end, unread: VecDeque::new() }
    }

    /// What a client connects to, as pyserial takes it.
    pub fn address(&self) -> String {
        match &self.end {
            End::Tcp { listener, .. } => listener
                .local_addr()
                .map_or_else(|error| error.to_string(), |address| format!("socket://{address}")),
            End::Pty { link, .. } => link.display().to_string(),
        }
    }

    /// What becomes readable when a client comes, sends or leaves.
    pub fn descriptors(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        let (first, second) = match &self.end {
            End::Tcp { listener, client } => (listener.as_fd(), client.as_ref().map(AsFd::as_fd)),
            End::Pty { master, .. } => (master.as_fd(), None),
        };
        std::iter::once(first).chain(second)
    }

    /// Whether the client has yet to take something.
    pub fn is_behind(&self) -> bool {
        !self.unread.is_empty()
    }

    /// Hands `sent` to the client and, if one of the descriptors is `ready`, reads at most `buffer` from it; gives how
    /// much.
    pub fn exchange(&mut self, sent: &[u8], ready: bool, buffer: &mut [u8]) -> usize {
        let room = UNREAD_LIMIT - self.unread.len();
        self.unread.extend(&sent[..sent.len().min(room)]);
        let outcome = match &mut self.end {
            End::Tcp { listener, client } => {
                let outcome = match client {
                    Some(stream) => talk(stream, &mut self.unread, ready, buffer),
                    None => Err(ErrorKind::NotConnected.into()),
                };
                if outcome.is_err() {
                    *client = None;
                }
                // Last: a client that has hung up makes room for the next.
                if ready {
                    welcome(listener, client);
                }
                outcome
            }
            // Reading fails while no program has the terminal open.
            End::Pty { master, .. } => talk(master, &mut self.unread, ready, buffer),
        };
        outcome.unwrap_or_else(|_| {
            self.unread.clear();
            0
        })
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        if let End::Pty { link, .. } = &self.end {
            // It may be gone already; there is nobody left to tell.
            let _ = std::fs::remove_file(link);
        }
    }
}

fn welcome(listener: &TcpListener, client: &mut Option<TcpStream>) {
    let Ok((stream, _)) = listener.accept() else {
        return;
    };
    if client.is_none() && stream.set_nonblocking(true).is_ok() && stream.set_nodelay(true).is_ok() {
        *client = Some(stream);
    }
}

/// Reads first: that tells whether anybody is there.
fn talk(
    stream: &mut (impl Read + Write),
    unread: &mut VecDeque<u8>,
    ready: bool,
    buffer: &mut [u8],
) -> io::Result<usize> {
    let received = if ready { read(stream, buffer)? } else { 0 };
    while !unread.is_empty() {
        match stream.write(unread.as_slices().0) {
            Ok(count) => drop(unread.drain(..count)),
            Err(error) if error.kind() == ErrorKind::WouldBlock => break,
            Err(error) => return Err(error),
        }
    }
    Ok(received)
}

fn read(stream: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    match stream.read(buffer) {
        Ok(0) if !buffer.is_empty() => Err(ErrorKind::UnexpectedEof.into()),
        Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(0),
        outcome => outcome,
    }
}
