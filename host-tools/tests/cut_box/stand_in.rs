//! A box in this process, at the other end of a pair of pseudo-terminals.

use massline::device::{Port, PortError};
use serialport::{SerialPort, TTYPort};
use std::fmt::Debug;
use std::io::{ErrorKind, Read, Write};
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// By how much faster than the clock the box may take samples.
const SPEED: f64 = 8.0;
/// Longest wait for bytes of the program while the box has something to say.
const LOOK: Duration = Duration::from_millis(2);
/// The same while it has nothing to say: some hundred boxes that look every two milliseconds keep two processors
/// busy, and leave none for those that are asked.
const IDLE: Duration = Duration::from_millis(20);

/// Held while a pair of terminals is made and while a program is begun: a program that began in
/// between would hold the box's end open, too, and nothing would be unplugged.
pub static SPAWNING: Mutex<()> = Mutex::new(());

/// Serves a program at a pair of terminals until `is_over`: `begin` is told the path, and what it
/// gives is asked and given back. The box is at the other end of `line`.
pub fn serve<T>(
    line: &mut impl Port,
    begin: impl FnOnce(&str) -> T,
    mut is_over: impl FnMut(&mut T) -> bool,
) -> T {
    let spawning = SPAWNING.lock().unwrap();
    let (inherited, theirs) = TTYPort::pair().unwrap();
    // A copy that programs do not inherit.
    let mut ours = inherited.try_clone_native().unwrap();
    drop(inherited);
    ours.set_timeout(LOOK).unwrap();
    let mut program = begin(&theirs.name().unwrap());
    drop(spawning);
    let mut ours = Some(ours);
    let mut link = Link::new(line);
    while !is_over(&mut program) {
        let Some(port) = &mut ours else {
            std::thread::sleep(LOOK);
            continue;
        };
        match link.pass(line, port) {
            Ok(said) => {
                let wait = if said { LOOK } else { IDLE };
                port.set_timeout(wait).unwrap();
            }
            // Unplugged: the program's end reads as at its end.
            Err(_) => ours = None,
        }
    }
    program
}

/// All of a stream, beside what else goes on.
fn reader(mut from: impl Read + Send + 'static) -> JoinHandle<String> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        from.read_to_end(&mut bytes).unwrap();
        String::from_utf8(bytes).unwrap()
    })
}

/// A program that runs.
pub struct Program {
    pub child: Child,
    /// Its standard output and its standard error.
    streams: [JoinHandle<String>; 2],
    begun: Instant,
}

/// A program that has ended.
#[derive(Debug)]
pub struct Ended {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
    pub took: Duration,
}

impl Program {
    /// `true` once it has ended, which it must within `bound` from its begin.
    pub fn is_over(&mut self, bound: Duration, about: &dyn Debug) -> bool {
        let is_over = self.child.try_wait().unwrap().is_some();
        if !is_over && self.begun.elapsed() > bound {
            self.child.kill().unwrap();
            self.child.wait().unwrap();
            panic!("{about:?}: it goes on after {bound:?}");
        }
        is_over
    }

    /// Its end, which is waited for.
    pub fn ended(mut self) -> Ended {
        let code = self.child.wait().unwrap().code();
        let [stdout, stderr] = self.streams.map(|stream| stream.join().unwrap());
        Ended {
            code,
            stdout,
            stderr,
            took: self.begun.elapsed(),
        }
    }
}

/// Runs a program to its end, with a box at the other end of `line`.
pub fn run(line: &mut impl Port, command: Command, bound: Duration, about: &dyn Debug) -> Ended {
    let begin = |path: &str| begin(command, path);
    serve(line, begin, |program| program.is_over(bound, about)).ended()
}

/// Does work for every case, some beside each other: in most of them somebody waits.
pub fn beside<C: Send, T: Send>(
    workers: usize,
    mut cases: Vec<C>,
    work: impl Fn(C) -> T + Sync,
) -> Vec<T> {
    cases.reverse();
    let (cases, done) = (Mutex::new(cases), Mutex::new(Vec::new()));
    let next = || cases.lock().unwrap().pop();
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                while let Some(case) = next() {
                    let one = work(case);
                    done.lock().unwrap().push(one);
                }
            });
        }
    });
    done.into_inner().unwrap()
}

/// Begins the program, which asks the box at a path.
pub fn begin(mut command: Command, path: &str) -> Program {
    command.args(["--port", path]);
    command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let streams = [
        reader(child.stdout.take().unwrap()),
        reader(child.stderr.take().unwrap()),
    ];
    Program {
        child,
        streams,
        begun: Instant::now(),
    }
}

/// Bytes on their way between a line and a terminal.
struct Link {
    /// Of the program, up to the end of a frame.
    frame: Vec<u8>,
    begun: Instant,
    /// The box's time then, s.
    since: f64,
}

impl Link {
    fn new(line: &impl Port) -> Self {
        Self {
            frame: Vec::new(),
            begun: Instant::now(),
            since: line.seconds(),
        }
    }

    /// Passes on what has come from either side. `true` if the box has said something, or would have.
    fn pass(&mut self, line: &mut impl Port, port: &mut TTYPort) -> Result<bool, PortError> {
        let mut chunk = [0; 1024];
        match port.read(&mut chunk) {
            Ok(count) => {
                for &byte in &chunk[..count] {
                    self.frame.push(byte);
                    // One at a time, as the line counts them; frames begin with a zero, too.
                    if byte == 0 && self.frame.iter().any(|&byte| byte != 0) {
                        line.send(&self.frame)?;
                        self.frame.clear();
                    }
                }
            }
            // Nothing, or the program has not opened it yet or no longer.
            Err(error) if error.kind() == ErrorKind::TimedOut => {}
            Err(_) => std::thread::sleep(LOOK),
        }
        let ahead = line.seconds() - self.since - SPEED * self.begun.elapsed().as_secs_f64();
        if ahead > 0.0 {
            return Ok(true);
        }
        let mut said = Vec::new();
        line.receive(&mut said, Duration::ZERO)?;
        // What a program that has ended does not read is lost.
        let mut left = &said[..];
        while let Ok(count @ 1..) = port.write(left) {
            left = &left[count..];
        }
        Ok(!said.is_empty())
    }
}
