//! Most memory that a program has resident.
//!
//! The system keeps it until the process is gone.

use std::io::Read;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Most memory that a command has resident, bytes; whether it succeeds, and what it says.
pub fn watched(mut command: Command) -> (u64, bool, String) {
    // On a busy machine a command may be gone before it is looked at.
    for _ in 0..20 {
        let seen = watched_once(&mut command);
        if seen.0 > 0 {
            return seen;
        }
    }
    panic!("the process was gone before it was looked at, twenty times");
}

fn watched_once(command: &mut Command) -> (u64, bool, String) {
    command.stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut stderr = child.stderr.take().unwrap();
    let said = std::thread::spawn(move || {
        let mut text = String::new();
        stderr.read_to_string(&mut text).unwrap();
        text
    });
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0;
    loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kilobytes = line
            .and_then(|l| l.trim().strip_suffix(" kB"))
            .map(str::parse::<u64>);
        if let Some(Ok(kilobytes)) = kilobytes {
            peak = peak.max(1024 * kilobytes);
        }
        if let Some(status) = child.try_wait().unwrap() {
            return (peak, status.success(), said.join().unwrap());
        }
        std::thread::sleep(Duration::from_micros(200));
    }
}
