//! The wire as the sender sees it, and the serial port behind it: a reader thread and a channel.
use std::{
    io::{ErrorKind, Read, Write},
    sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel},
    time::{Duration, Instant},
};

use serialport::{ClearBuffer, FlowControl, SerialPort};

use super::{ports, protocol::Seconds};
use crate::profile::{self, Flow, ModemLine};

/// Why a port could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// There is no such port.
    #[error("there is no port `{port}`; {}", .others)]
    Missing {
        /// What was asked for.
        port: String,
        /// The ports there are.
        others: String,
    },
    /// No permission.
    #[error(
        "no permission to use `{0}`; on Linux add yourself to the group that owns it: \
         `sudo usermod -aG dialout $USER` (uucp on Arch), then log out and in again"
    )]
    Permission(String),
    /// Another program has it.
    #[error("`{0}` is in use by another program; close that one first (`lsof {0}` or `fuser {0}` names it)")]
    Busy(String),
    /// Anything else.
    #[error("`{port}` cannot be opened as a serial port: {cause} (`fabricate ports` lists those of this computer)")]
    Other {
        /// The port.
        port: String,
        /// What the system says.
        cause: String,
    },
}

/// An open serial port.
pub struct Serial {
    port: Box<dyn SerialPort>,
    bytes: Receiver<Result<Vec<u8>, String>>,
    opened: Instant,
}

/// One write waits at most this long for room in the system's buffer.
const WRITE_TIMEOUT: Duration = Duration::from_millis(20);

impl Serial {
    /// Opens a port as a profile says.
    pub fn open(port: &str, link: &profile::Link) -> Result<Self, OpenError> {
        let mut builder = serialport::new(port, link.baud).timeout(WRITE_TIMEOUT);
        // XON and XOFF are looked after by the protocol: what the system holds back cannot be taken back.
        let hardware = link.flow == Flow::RtsCts;
        builder = builder.flow_control(if hardware { FlowControl::Hardware } else { FlowControl::None });
        builder = match link.dtr {
            ModemLine::Keep => builder,
            ModemLine::On => builder.dtr_on_open(true),
            ModemLine::Off => builder.dtr_on_open(false),
        };
        let mut opened = builder.open().map_err(|err| refused(port, &err))?;
        let other = |err: serialport::Error| OpenError::Other { port: port.into(), cause: err.to_string() };
        if link.rts != ModemLine::Keep {
            opened.write_request_to_send(link.rts == ModemLine::On).map_err(other)?;
        }
        let reader = opened.try_clone().map_err(other)?;
        // Bounded: a machine that talks without end must not fill the memory.
        let (sender, bytes) = sync_channel(1024);
        std::thread::Builder::new()
            .name("serial reader".into())
            .spawn(move || listen(reader, &sender))
            .map_err(|err| OpenError::Other { port: port.into(), cause: err.to_string() })?;
        Ok(Self { port: opened, bytes, opened: Instant::now() })
    }

    /// Waits until the system has sent everything that was written.
    pub fn drain(&mut self) {
        // Only a courtesy before closing; a wire that broke has been reported by the read side.
        let _ = self.port.flush();
    }
}

fn refused(port: &str, err: &serialport::Error) -> OpenError {
    use serialport::ErrorKind as Kind;
    let port = port.to_owned();
    match err.kind() {
        Kind::Io(ErrorKind::PermissionDenied) => OpenError::Permission(port),
        Kind::Io(ErrorKind::NotFound) => {
            let names: Vec<String> = ports().map(|it| it.into_iter().map(|it| it.name).collect()).unwrap_or_default();
            let others = if names.is_empty() {
                "no serial port was found at all: is the machine plugged in and switched on?".to_owned()
            } else {
                format!("there are: {}", names.join(", "))
            };
            OpenError::Missing { port, others }
        }
        Kind::NoDevice => OpenError::Busy(port),
        _ => OpenError::Other { port, cause: err.to_string() },
    }
}

fn listen(mut port: Box<dyn SerialPort>, sender: &SyncSender<Result<Vec<u8>, String>>) {
    let mut buffer = [0; 1024];
    loop {
        let message = match port.read(&mut buffer) {
            Ok(0) => Err("the port was closed".to_owned()),
            Ok(n) => Ok(buffer[..n].to_vec()),
            Err(err) if matches!(err.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted | ErrorKind::WouldBlock) => {
                // An empty message tells whether anybody still listens.
                Ok(Vec::new())
            }
            Err(err) => Err(err.to_string()),
        };
        let broken = message.is_err();
        if sender.send(message).is_err() || broken {
            return;
        }
    }
}

impl Wire for Serial {
    fn now(&self) -> Seconds {
        self.opened.elapsed().as_secs_f64()
    }

    fn read(&mut self, seconds: Seconds) -> Result<Vec<u8>, String> {
        let until = Instant::now() + Duration::from_secs_f64(seconds.clamp(0.0, 1.0));
        loop {
            let left = until.saturating_duration_since(Instant::now());
            match self.bytes.recv_timeout(left) {
                Ok(Ok(bytes)) if bytes.is_empty() => {}
                Ok(it) => return it,
                Err(RecvTimeoutError::Timeout) => return Ok(Vec::new()),
                Err(RecvTimeoutError::Disconnected) => return Err("the reader has stopped".into()),
            }
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, String> {
        match self.port.write(bytes) {
            Ok(n) => Ok(n),
            Err(err) if matches!(err.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted | ErrorKind::WouldBlock) => {
                Ok(0)
            }
            Err(err) => Err(err.to_string()),
        }
    }

    fn discard(&mut self) {
        // Without effect on a broken wire, which the read side reports.
        let _ = self.port.clear(ClearBuffer::Output);
    }

    fn waiting(&mut self) -> usize {
        self.port.bytes_to_write().unwrap_or(0) as usize
    }
}

/// A wire to a machine, with the clock that goes with it.
pub trait Wire {
    /// Seconds since it was opened.
    fn now(&self) -> Seconds;
    /// Waits at most `seconds` for bytes; none came when the result is empty. `Err` when the wire is broken.
    fn read(&mut self, seconds: Seconds) -> Result<Vec<u8>, String>;
    /// Takes as many bytes as it can without long delay.
    fn write(&mut self, bytes: &[u8]) -> Result<usize, String>;
    /// Throws away bytes that were taken but not sent yet.
    fn discard(&mut self);
    /// Bytes that were taken but not sent yet, as far as that is known.
    fn waiting(&mut self) -> usize;
}
