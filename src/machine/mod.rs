//! The way to a machine: protocols without a port inside, the port, and the job that runs over them.
//!
//! [`protocol`] says what protocols have in common; [`grbl`] (its safe abort in `abort`, its replies in [`reply`]),
//! [`marlin`] and [`hpgl`] are they. [`board`] is what it tells of itself. [`program`] reads a whole file, [`timing`] says how
//! long it takes, [`feed`] hands it out, [`track`] follows the machine along it. [`link`] is the wire, [`session`] moves
//! bytes between wire and protocol, [`job`] knows
//! the steps of a job on a GRBL-type board, [`plain`] those on a machine that tells little of itself, [`journal`] what of it is done.

mod abort;
pub mod board;
pub mod codes;
pub mod feed;
pub mod grbl;
pub mod hpgl;
pub mod job;
pub mod journal;
pub mod link;
pub mod marlin;
pub mod plain;
pub mod plot;
pub mod program;
pub mod protocol;
pub mod reply;
pub mod session;
pub mod timing;
pub mod track;

/// A serial port of this computer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Port {
    /// What to hand to `--port`.
    pub name: String,
    /// What hangs on it, as far as the system knows.
    pub about: String,
}

/// The ports cannot be listed.
#[derive(Debug, thiserror::Error)]
#[error("the serial ports cannot be listed: {0}")]
pub struct PortsError(#[from] serialport::Error);

/// Serial ports, sorted by name.
pub fn ports() -> Result<Vec<Port>, PortsError> {
    let mut ports: Vec<Port> = serialport::available_ports()?
        .into_iter()
        .map(|it| {
            let about = match it.port_type {
                serialport::SerialPortType::UsbPort(usb) => {
                    let text = |it: Option<String>| it.unwrap_or_default();
                    format!("USB {:04x}:{:04x} {} {}", usb.vid, usb.pid, text(usb.manufacturer), text(usb.product))
                }
                serialport::SerialPortType::PciPort => "built in".into(),
                serialport::SerialPortType::BluetoothPort => "Bluetooth".into(),
                serialport::SerialPortType::Unknown => String::new(),
            };
            Port { name: it.port_name, about: about.trim_end().to_owned() }
        })
        .collect();
    ports.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(ports)
}
