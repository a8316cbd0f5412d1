//! The steps of a test run in their order, each with the remedy for its failure.
//!
//! Everything but this very program is built with the release profile: numerical tests are heavy,
//! and the steps then share what they build.

use std::env;
use std::ffi::OsString;
use std::fmt::Display;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use crate::emulator;

use super::api;
use super::fuzz;
use super::image;
use super::licences::{self, Allowed};
use super::panics;
use super::process::{self, StepError};
use super::qemu;
use super::readers;
use super::report::Ending;
use super::toolchain::{self, CLIPPY, RUSTFMT, Tool, Toolchain};

const FIRMWARE: &str = "massline-firmware";

/// Something that has to pass.
#[derive(Debug)]
pub struct Step {
    /// Name on the command line.
    pub name: &'static str,
    /// Description, in a line.
    pub about: &'static str,
    /// The steps whose results it uses.
    pub needs: &'static [&'static str],
    /// Remedy for its failure; continues "Remedy:".
    pub remedy: &'static str,
    /// Does it.
    pub run: fn(&mut Context) -> Result<Ending, StepError>,
}

impl PartialEq for Step {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Step {
    /// `true` if the other is this step or one that this needs, directly or not.
    pub fn needs_also(&self, other: &Step) -> bool {
        self == other
            || self
                .needs
                .iter()
                .filter_map(|name| find(name))
                .any(|need| need.needs_also(other))
    }
}

/// The steps, each after those it needs.
pub const STEPS: &[Step] = &[
    Step {
        name: "toolchain",
        about: "a compiler for the chip, fetched if need be",
        needs: &[],
        remedy: "install what the message above names, by hand",
        run: toolchain,
    },
    Step {
        name: "qemu",
        about: "an emulator of the chip, fetched if need be",
        needs: &[],
        remedy: "install qemu-system-arm by hand, or name one in MASSLINE_QEMU",
        run: qemu,
    },
    Step {
        name: "format",
        about: "sources are formatted",
        needs: &[],
        remedy: "run `cargo fmt --all`",
        run: format,
    },
    Step {
        name: "licences",
        about: "every dependency is under a licence that the project allows",
        needs: &[],
        remedy: "do without the crate, or allow its licence in .cargo/deny.toml with a reason in \
                 CONTRIBUTING.md",
        run: licences,
    },
    Step {
        name: "advisories",
        about: "no security advisory is about a dependency, where cargo-deny can say",
        needs: &[],
        remedy: "move to the version that the advisory names, by `cargo update`",
        run: advisories,
    },
    Step {
        name: "lints",
        about: "no warning in the host's crates",
        needs: &[],
        remedy: "mend the code; an `allow` needs its reason beside it",
        run: lints,
    },
    Step {
        name: "tests",
        about: "tests on this machine, with the documentation's examples",
        needs: &[],
        remedy: "read the assertion above; `cargo test --release NAME` runs one test alone",
        run: host_tests,
    },
    Step {
        name: "readers",
        about: "programs of others agree with what is read and written, where Python's packages can be had",
        needs: &[],
        remedy: "read the line above: which program differs, and by how much; \
                 tests/fixtures/readers/check.py has the check",
        run: independent_readers,
    },
    Step {
        name: "checked",
        about: "core's tests with overflow checks, a hostile host and random walks among them",
        needs: &[],
        remedy: "read the assertion above; `cargo test --profile checked -p massline-core NAME` \
                 runs one test alone",
        run: checked,
    },
    Step {
        name: "fuzz",
        about: "inputs that nobody meant to send, for half a minute a target",
        needs: &[],
        remedy: "mend what the finding shows, and put its input into tests/fuzz/corpus",
        run: fuzz_targets,
    },
    Step {
        name: "docs",
        about: "documentation builds without a warning",
        needs: &["toolchain"],
        remedy: "mend the doc comment that the message names",
        run: docs,
    },
    Step {
        name: "api",
        about: "core's public items are those of core/api.txt, and each has a user outside of it",
        needs: &[],
        remedy: "make what core alone needs `pub(crate)`, or accept the change as the message says",
        run: interface,
    },
    Step {
        name: "package",
        about: "massline-core is fit to be published: its package is complete, and builds by itself",
        needs: &[],
        remedy: "mend core/Cargo.toml, or bring into core what its package lacks",
        run: package,
    },
    Step {
        name: "core-on-chip",
        about: "massline-core builds for the chip, without features and with all that a chip can have",
        needs: &["toolchain"],
        remedy: "keep `std`, and crates that need it, out of core",
        run: core_on_chip,
    },
    Step {
        name: "firmware",
        about: "the firmware builds, as it is flashed",
        needs: &["toolchain"],
        remedy: "mend the code, or memory.x when it is the linker that complains",
        run: firmware,
    },
    Step {
        name: "firmware-lints",
        about: "no warning in the firmware, nor in core as it is built for it",
        needs: &["toolchain"],
        remedy: "mend the code; an `allow` needs its reason beside it",
        run: firmware_lints,
    },
    Step {
        name: "emulator",
        about: "the firmware that is flashed, booted in the emulator",
        needs: &["qemu", "firmware"],
        remedy: "read the assertion above; what the board sent is in it",
        run: emulator,
    },
];

/// The step of a name.
pub fn find(name: &str) -> Option<&'static Step> {
    STEPS.iter().find(|step| step.name == name)
}

/// Tools and results that the steps share.
#[derive(Debug)]
pub struct Context {
    root: PathBuf,
    cargo: OsString,
    colour: bool,
    chip: Option<Toolchain>,
    qemu: Option<OsString>,
    elf: Option<PathBuf>,
}

impl Context {
    /// The context at the beginning.
    pub fn new(colour: bool) -> Self {
        let package = Path::new(env!("CARGO_MANIFEST_DIR"));
        Self {
            root: package.parent().unwrap_or(package).to_owned(),
            cargo: env::var_os("CARGO").unwrap_or_else(|| OsString::from("cargo")),
            colour,
            chip: None,
            qemu: None,
            elf: None,
        }
    }

    /// The folder of the workspace.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// A command of the cargo that has started this program.
    pub fn host_cargo(&self) -> Command {
        self.cargo(&self.host(), "")
    }

    /// A cargo command, its arguments between spaces.
    fn cargo(&self, toolchain: &Toolchain, arguments: &str) -> Command {
        self.set_up(toolchain.cargo(), arguments)
    }

    fn set_up(&self, mut command: Command, arguments: &str) -> Command {
        let colour = if self.colour { "always" } else { "never" };
        command
            .current_dir(&self.root)
            .env("CARGO_TERM_COLOR", colour)
            .env_remove(emulator::FIRMWARE_ELF)
            .args(arguments.split_whitespace());
        command
    }

    /// Runs a tool that a machine may lack, or says that it is not to be had here.
    fn run_tool(
        &self,
        toolchain: &Toolchain,
        tool: Tool,
        arguments: &str,
    ) -> Result<Ending, StepError> {
        let command = match toolchain::provide_tool(toolchain, tool) {
            Ok(command) => command,
            Err(reason) => return Ok(Ending::Skipped(reason)),
        };
        process::run(&mut self.set_up(command, arguments))?;
        Ok(Ending::Passed(String::new()))
    }

    /// The toolchain for the host's crates, which are the workspace's default.
    fn host(&self) -> Toolchain {
        Toolchain::Active {
            cargo: self.cargo.clone(),
        }
    }

    /// The toolchain for the chip.
    fn chip(&self) -> Result<&Toolchain, StepError> {
        self.chip.as_ref().ok_or(StepError::Missing {
            what: "the result of step toolchain",
            tried: String::new(),
            remedy: "put it before this step",
        })
    }
}

fn toolchain(context: &mut Context) -> Result<Ending, StepError> {
    let provided = toolchain::provide(&context.cargo)?;
    context.chip = Some(provided.toolchain);
    Ok(Ending::Passed(provided.note))
}

fn qemu(context: &mut Context) -> Result<Ending, StepError> {
    let qemu = qemu::provide()?;
    context.qemu = Some(qemu.program);
    Ok(Ending::Passed(qemu.note))
}

fn format(context: &mut Context) -> Result<Ending, StepError> {
    // Not a terminal, but a TERM, is what the formatter takes for a wish for colours.
    let colour = if context.colour { "always" } else { "never" };
    let arguments = format!("--all --check -- --color {colour}");
    context.run_tool(&context.host(), RUSTFMT, &arguments)
}

fn licences(context: &mut Context) -> Result<Ending, StepError> {
    let path = context.root.join(licences::CONFIGURATION);
    let unusable = |problem: &dyn Display| StepError::file(&path, problem);
    let text = fs::read_to_string(&path).map_err(|error| unusable(&error))?;
    let allowed =
        Allowed::read(&text).ok_or_else(|| unusable(&"names no licence under [licenses] allow"))?;
    let mut tree = context.cargo(&context.host(), "");
    let listing = process::answer(tree.args(licences::LISTING))?;
    match licences::check(&listing, &allowed) {
        Ok(count) => Ok(Ending::Passed(format!("{count} packages"))),
        Err(findings) => Err(unusable(&format!("does not allow this\n{findings}"))),
    }
}

fn advisories(context: &mut Context) -> Result<Ending, StepError> {
    let unchecked = |why: &str| Ok(Ending::Skipped(format!("NOT checked: {why}")));
    let deny = |arguments: &str| {
        let arguments = format!("deny --config {} {arguments}", licences::CONFIGURATION);
        process::run(&mut context.cargo(&context.host(), &arguments))
    };
    if deny("--version").is_err() {
        return unchecked("no cargo-deny; `cargo install --locked cargo-deny` takes minutes");
    }
    if deny("fetch db").is_err() {
        return unchecked("cargo-deny cannot fetch the advisories; `cargo deny fetch db` says why");
    }
    // What was fetched just now; a network that goes away is no finding.
    deny("--offline check advisories")?;
    Ok(Ending::Passed(String::new()))
}

fn lints(context: &mut Context) -> Result<Ending, StepError> {
    let arguments = "--release --all-targets -- -D warnings";
    context.run_tool(&context.host(), CLIPPY, arguments)
}

/// Programs of tests that run beside each other, and the documentation's examples: most of them use one processor,
/// or wait for boxes that do not answer.
const BESIDE: [&str; 3] = ["--lib --bins --test [a-i]*", "--test [!a-i]*", "--doc"];

fn host_tests(context: &mut Context) -> Result<Ending, StepError> {
    let host = context.host();
    process::run(&mut context.cargo(&host, "test --release --no-run"))?;
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let mut tests = BESIDE.map(|some| {
        let mut test = context.cargo(&host, "test --release --no-fail-fast");
        test.args(some.split_whitespace());
        test.env("RUST_TEST_THREADS", (4 * processors).to_string());
        test
    });
    Ok(Ending::Passed(counts(&process::run_together(&mut tests)?)))
}

fn independent_readers(context: &mut Context) -> Result<Ending, StepError> {
    // By its name alone the program shares the build of the tests: `-p` would choose features of dependencies anew.
    let arguments = "build --release --bin massline --message-format=json-render-diagnostics";
    let messages = process::answer(&mut context.cargo(&context.host(), arguments))?;
    let program = executable(&messages).ok_or(StepError::Missing {
        what: "the command massline",
        tried: messages,
        remedy: "report it: cargo's messages are not what they used to be",
    })?;
    readers::check(context.root(), &program)
}

fn checked(context: &mut Context) -> Result<Ending, StepError> {
    let arguments = "test --profile checked -p massline-core --lib --tests --no-fail-fast";
    let mut test = context.cargo(&context.host(), arguments);
    Ok(Ending::Passed(counts(&process::run(&mut test)?)))
}

fn fuzz_targets(context: &mut Context) -> Result<Ending, StepError> {
    if let Some(reason) = fuzz::impossible() {
        return Ok(Ending::Skipped(reason));
    }
    let begin = Instant::now();
    let programs = fuzz::build(context.root(), context.host_cargo())?;
    let seconds = fuzz::STEP_SECONDS;
    let outcomes = programs.run_all(&fuzz::TARGETS, seconds, fuzz::JOBS, &|_| ())?;
    match fuzz::findings(&outcomes).as_str() {
        "" => Ok(Ending::Passed(fuzz::sum(&outcomes, begin.elapsed()))),
        told => Err(StepError::Finding(told.to_owned())),
    }
}

fn docs(context: &mut Context) -> Result<Ending, StepError> {
    let chip = context.chip()?;
    let for_chip = format!("-p {FIRMWARE} {}", chip.arguments());
    for (toolchain, which) in [(&context.host(), ""), (chip, &for_chip)] {
        let mut doc = context.cargo(toolchain, &format!("doc --release --no-deps {which}"));
        process::run(doc.env("RUSTDOCFLAGS", "-D warnings"))?;
    }
    Ok(Ending::Passed(String::new()))
}

fn core_on_chip(context: &mut Context) -> Result<Ending, StepError> {
    let chip = context.chip()?;
    for what in [
        "--no-default-features",
        "--no-default-features --example on_chip",
        "--features defmt",
    ] {
        let chip_of = chip.arguments();
        let arguments = format!("build --release -p massline-core {what} {chip_of}");
        process::run(&mut context.cargo(chip, &arguments))?;
    }
    Ok(Ending::Passed(String::new()))
}

fn interface(context: &mut Context) -> Result<Ending, StepError> {
    let arguments = format!(
        "doc -p massline-core --no-deps --all-features --target-dir {}",
        api::TARGET
    );
    process::run(&mut context.cargo(&context.host(), &arguments))?;
    let found = api::read(context.root())?.judge(context.root())?;
    Ok(Ending::Passed(found))
}

fn package(context: &mut Context) -> Result<Ending, StepError> {
    // Without a registry nothing can be verified against it; the package is complete all the same.
    let dry_run = "publish --dry-run -p massline-core --allow-dirty --no-verify";
    let note = match process::run(&mut context.cargo(&context.host(), dry_run)) {
        Ok(_) => String::new(),
        Err(error) => format!("not held against a registry: {}", first_line(&error)),
    };
    let by_itself = "package -p massline-core --allow-dirty --offline";
    process::run(&mut context.cargo(&context.host(), by_itself))?;
    Ok(Ending::Passed(note))
}

/// The first line of what a program said that names an error.
fn first_line(error: &StepError) -> String {
    let text = error.to_string();
    let line = text.lines().find(|line| line.contains("error"));
    line.or(text.lines().next()).unwrap_or("").trim().to_owned()
}

fn firmware(context: &mut Context) -> Result<Ending, StepError> {
    let chip = context.chip()?;
    let arguments = format!(
        "build --profile chip -p {FIRMWARE} --message-format=json-render-diagnostics {}",
        chip.arguments()
    );
    let messages = process::answer(&mut context.cargo(chip, &arguments))?;
    let elf = executable(&messages).ok_or(StepError::Missing {
        what: "the firmware's ELF",
        tried: messages,
        remedy: "report it: cargo's messages are not what they used to be",
    })?;
    // What the emulator counts instructions of lies beside it, in its folder of examples.
    let arguments = format!(
        "build --profile chip -p {FIRMWARE} --examples {}",
        chip.arguments()
    );
    process::run(&mut context.cargo(chip, &arguments))?;
    let size = size_of(&elf, &context.root.join("memory.x"))?;
    let places = places_of(&elf)?;
    context.elf = Some(elf);
    Ok(Ending::Passed(format!("{size}; {places}")))
}

fn firmware_lints(context: &mut Context) -> Result<Ending, StepError> {
    let chip = context.chip()?;
    let arguments = format!(
        "--release -p {FIRMWARE} {} -- -D warnings",
        chip.arguments()
    );
    context.run_tool(chip, CLIPPY, &arguments)
}

/// Programs of tests beside each other, one emulator at a time each: the last tests of a program would have a
/// processor to themselves otherwise.
const EMULATORS: [&str; 2] = ["firmware_c*", "firmware_[!c]*"];

fn emulator(context: &mut Context) -> Result<Ending, StepError> {
    let elf = context.elf.as_ref().ok_or(StepError::Missing {
        what: "the result of step firmware",
        tried: String::new(),
        remedy: "put it before this step",
    })?;
    let host = context.host();
    // Chosen by name, so that a new file of tests needs no line here.
    let build = "test --release --no-run --test firmware_*";
    process::run(&mut context.cargo(&host, build))?;
    let mut tests = EMULATORS.map(|some| {
        let mut test = context.cargo(&host, "test --release --no-fail-fast");
        test.args(["--test", some, "--", "--include-ignored"]);
        test.env("RUST_TEST_THREADS", "1");
        test.env(emulator::FIRMWARE_ELF, elf);
        if let Some(qemu) = &context.qemu {
            test.env(emulator::QEMU, qemu);
        }
        test
    });
    Ok(Ending::Passed(counts(&process::run_together(&mut tests)?)))
}

/// Use of the memories of the map by a firmware, as text.
fn size_of(elf: &Path, map: &Path) -> Result<String, StepError> {
    let script = fs::read_to_string(map).map_err(|error| StepError::file(map, error))?;
    let bytes = fs::read(elf).map_err(|error| StepError::file(elf, error))?;
    let usages = image::usage(&bytes, &image::regions(&script));
    let usages = usages.map_err(|error| StepError::file(elf, error))?;
    Ok(image::summary(&usages))
}

/// Places where a firmware can panic, as text; an error if they are beyond the budget.
fn places_of(elf: &Path) -> Result<String, StepError> {
    let bytes = fs::read(elf).map_err(|error| StepError::file(elf, error))?;
    let places = panics::places(&bytes).map_err(|error| StepError::file(elf, error))?;
    panics::judge(&places, &panics::BUDGET).map_err(|beyond| StepError::file(elf, beyond))
}

/// The last program that cargo says it has made.
fn executable(messages: &str) -> Option<PathBuf> {
    const KEY: &str = "\"executable\":\"";
    let line = messages.lines().rfind(|line| line.contains(KEY))?;
    let (_, rest) = line.split_once(KEY)?;
    let mut path = String::new();
    let mut characters = rest.chars();
    loop {
        match characters.next()? {
            '"' => return Some(PathBuf::from(path)),
            // Backslashes and quotes are all that cargo has to escape in a sane path.
            '\\' => path.push(characters.next()?),
            other => path.push(other),
        }
    }
}

/// Number of tests that ran, summed over the programs that cargo ran.
fn counts(output: &str) -> String {
    let sum = |word: &str| -> usize {
        output
            .lines()
            .filter(|line| line.starts_with("test result:"))
            .flat_map(|line| line.split([';', '.']))
            .filter_map(|part| part.trim().strip_suffix(word)?.trim().parse::<usize>().ok())
            .sum()
    };
    let passed = match sum("passed") {
        1 => "1 test".to_owned(),
        many => format!("{many} tests"),
    };
    match sum("ignored") {
        0 => passed,
        ignored => format!("{passed}, {ignored} left to other steps"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_the_tests_of_several_programs() {
        let output = "test a ... ok\n\
            test result: ok. 3 passed; 0 failed; 1 ignored; 0 measured; 0 filtered out\n\
            noise: 7 passed\n\
            test result: ok. 12 passed; 0 failed; 0 ignored; 0 measured; 2 filtered out\n";
        assert_eq!(counts(output), "15 tests, 1 left to other steps");
        assert_eq!(
            counts("test result: ok. 1 passed; 0 failed; 0 ignored"),
            "1 test"
        );
    }

    #[test]
    fn finds_the_program_in_the_messages() {
        let messages = r#"{"reason":"compiler-artifact","executable":null}
{"reason":"compiler-artifact","executable":"/a b/massline-firmware","fresh":true}
{"reason":"build-finished","success":true}"#;
        assert_eq!(executable(messages), Some("/a b/massline-firmware".into()));
        assert_eq!(
            executable(r#"{"executable":"C:\\t\\m.elf"}"#),
            Some(r"C:\t\m.elf".into())
        );
        assert_eq!(executable("{}"), None);
    }
}
