//! A board behind a pseudo-terminal: a thread that moves bytes and lets the board's time run with the clock.
use std::{
    io::{Read, Write},
    os::fd::AsRawFd,
    sync::{
        Arc, Mutex, MutexGuard,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use nix::fcntl::{FcntlArg, FdFlag, fcntl};
use serialport::{SerialPort, TTYPort};

use super::Device;

pub(crate) struct PtyBoard<D: Device + Send + 'static> {
    /// Until it is taken.
    board: Option<Arc<Mutex<D>>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    pub(crate) port: String,
}

impl<D: Device + Send + 'static> PtyBoard<D> {
    /// `scale` seconds of the board pass in one of the clock.
    pub(crate) fn start(board: D, scale: f64) -> Self {
        let (mut master, slave) = TTYPort::pair().unwrap();
        let port = slave.name().unwrap();
        drop(slave);
        // A child that inherited this side would keep the cable plugged in.
        fcntl(master.as_raw_fd(), FcntlArg::F_SETFD(FdFlag::FD_CLOEXEC)).unwrap();
        master.set_timeout(Duration::from_millis(1)).unwrap();
        let board = Arc::new(Mutex::new(board));
        let stop = Arc::new(AtomicBool::new(false));
        let (shared, ended) = (board.clone(), stop.clone());
        let thread = std::thread::spawn(move || serve(master, &shared, &ended, scale));
        Self { board: Some(board), stop, thread: Some(thread), port }
    }

    pub(crate) fn board(&self) -> MutexGuard<'_, D> {
        self.board.as_ref().unwrap().lock().unwrap()
    }

    /// The board without its port.
    pub(crate) fn take(mut self) -> D {
        self.end();
        Arc::into_inner(self.board.take().unwrap()).unwrap().into_inner().unwrap()
    }

    fn end(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }

    /// Waits, in the time of the clock, until something holds of the board.
    pub(crate) fn wait(&self, what: &str, holds: impl Fn(&D) -> bool) {
        let began = Instant::now();
        while !holds(&self.board()) {
            assert!(began.elapsed() < Duration::from_secs(120), "waited in vain: {what}");
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}

/// Seconds of the clock that pass for the board in one turn at most.
const LONGEST_TURN: f64 = 0.01;

fn serve<D: Device>(master: TTYPort, board: &Mutex<D>, stop: &AtomicBool, scale: f64) {
    let mut turn = Instant::now();
    let mut master = Some(master);
    let mut open = false;
    let mut buffer = [0; 256];
    while !stop.load(Ordering::Relaxed) {
        let mut came = 0;
        match master.as_mut().map(|it| it.read(&mut buffer)) {
            Some(Ok(n)) => came = n,
            // Nobody has the other side open.
            Some(Err(err)) if err.kind() == std::io::ErrorKind::BrokenPipe => {
                open = false;
                std::thread::sleep(Duration::from_millis(1));
            }
            Some(Err(_)) => {
                if !open {
                    open = true;
                    board.lock().unwrap().open();
                }
            }
            None => std::thread::sleep(Duration::from_millis(1)),
        }
        let mut board = board.lock().unwrap();
        if came > 0 && !open {
            open = true;
            board.open();
        }
        for &byte in &buffer[..came] {
            board.receive(byte);
        }
        // On a busy computer the board's time goes slower instead of jumping ahead of everybody else's.
        let passed = turn.elapsed().as_secs_f64().min(LONGEST_TURN);
        turn = Instant::now();
        let to = board.now() + passed * scale;
        board.advance(to);
        let out = board.output();
        if !board.plugged() {
            // Closing the master side is what a pulled plug looks like.
            master = None;
        } else if let Some(master) = master.as_mut().filter(|_| open && !out.is_empty()) {
            let _ = master.write_all(&out);
        }
    }
}

impl<D: Device + Send + 'static> Drop for PtyBoard<D> {
    fn drop(&mut self) {
        self.end();
    }
}
