//! How a GRBL-type board is reached over a serial port.
use serde::{Deserialize, Serialize};

use super::check::{Fault, within};

/// What to do with a modem line when the port is opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ModemLine {
    /// As the system does it: on, which resets most boards.
    Keep,
    /// On.
    On,
    /// Off: some boards are held in reset otherwise.
    Off,
}

/// How lines are paced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Streaming {
    /// Fill the board's receive buffer, counting characters.
    Counting,
    /// The next line when the last one was answered.
    SendResponse,
}

/// How a cutter stops the flow of bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Flow {
    /// Not at all, or by the answers of a G-code board.
    None,
    /// The bytes XOFF and XON.
    XonXoff,
    /// The lines RTS and CTS.
    RtsCts,
    /// It is asked for its free room: `ESC . B` of HP's plotters.
    EscB,
}

/// The connection.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Link {
    /// Bits per second.
    pub baud: u32,
    /// The DTR line.
    pub dtr: ModemLine,
    /// The RTS line.
    pub rts: ModemLine,
    /// Pacing of lines.
    pub streaming: Streaming,
    /// Flow control; only HPGL cutters need any.
    pub flow: Flow,
    /// Largest motion to have on the board, s: with the cable out the tool goes on that long.
    pub buffered: f64,
    /// How long the board may take to start after the port was opened, s.
    pub boot: f64,
}

impl Default for Link {
    fn default() -> Self {
        Self {
            baud: 115_200,
            dtr: ModemLine::Keep,
            rts: ModemLine::Keep,
            streaming: Streaming::Counting,
            flow: Flow::None,
            buffered: 2.0,
            boot: 8.0,
        }
    }
}

impl Link {
    pub(super) fn check(&self) -> Result<(), Fault> {
        within("link.baud", self.baud.into(), 300.0, 4_000_000.0)?;
        within("link.buffered", self.buffered, 0.2, 3600.0)?;
        within("link.boot", self.boot, 0.5, 120.0)
    }
}
