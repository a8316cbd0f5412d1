//! Settings of a box as they are changed: checked as a whole first, then sent one by one.

use crate::commands::Failure;
use crate::device::{BoxInfo, Client, ClientError, Port};
use crate::inputs::InputEntry;
use massline_firmware::sampling::INPUTS;
use massline_firmware::settings::Settings;
use massline_firmware::wire::{NAME_MAX, Reply, Request, Saved, Setting, Storage};
use std::io::{IsTerminal, Write};

/// A setting with its new value.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Change {
    /// Name of the box.
    Name(String),
    /// Rate of the link, bit/s.
    Baud(u32),
    /// Rate of the converters, samples/s.
    Rate(f64),
}

/// Reads `KEY=VALUE`.
pub(super) fn parse(text: &str) -> Result<Change, String> {
    let (key, value) = text
        .split_once('=')
        .ok_or("write KEY=VALUE, for example name=\"table 2\"")?;
    match key {
        "name" if value.len() > NAME_MAX => Err(format!(
            "the name has {} bytes, {NAME_MAX} fit",
            value.len()
        )),
        "name" => Ok(Change::Name(value.to_owned())),
        "baud" => value
            .parse()
            .map(Change::Baud)
            .map_err(|e| format!("{value}: {e}; write a number such as 921600")),
        "rate" => value
            .parse()
            .map(Change::Rate)
            .map_err(|e| format!("{value}: {e}; write a number such as 512")),
        other => Err(format!(
            "there is no setting {other}; there are name, baud, rate"
        )),
    }
}

impl Change {
    fn setting(&self) -> Setting<'_> {
        match self {
            Self::Name(name) => Setting::Name(name),
            Self::Baud(baud) => Setting::LinkBaud(*baud),
            Self::Rate(rate) => Setting::SampleRate(*rate),
        }
    }
}

/// Changes to a box's settings.
#[derive(Clone, Copy, Debug)]
pub(super) struct Order<'a> {
    /// `true` if they go back to those of the delivery first.
    pub(super) reset: bool,
    /// Settings that are changed.
    pub(super) set: &'a [Change],
    /// Inputs that are wired otherwise.
    pub(super) wired: &'a [InputEntry],
    /// `true` if they are kept.
    pub(super) save: bool,
    /// `true` if a reset is kept without a question.
    pub(super) yes: bool,
}

impl Order<'_> {
    fn settings(&self) -> impl Iterator<Item = Setting<'_>> {
        let wired = self.wired.iter().map(|e| Setting::Input(e.setting()));
        self.set.iter().map(Change::setting).chain(wired)
    }

    /// Refuses what needs a question where nobody can be asked.
    ///
    /// # Errors
    /// [`Failure`] with the option that answers it.
    pub(super) fn check(&self) -> Result<(), Failure> {
        if self.reset && self.save && !self.yes && !is_asked() {
            return Err(Failure::input(
                "--reset with --save throws the calibrations of all inputs away for good; keep them by --export FILE in a call before, and add --yes if that is meant",
            ));
        }
        Ok(())
    }

    /// Has the box change and keep its settings. Where they are kept, if they are.
    ///
    /// Nothing is sent before all of it was checked as the box checks it, so that a value which
    /// it refuses does not find the others changed.
    ///
    /// # Errors
    /// [`Failure`].
    pub(super) fn apply<P: Port>(
        &self,
        client: &mut Client<'_, P>,
        info: &BoxInfo,
    ) -> Result<Option<Storage>, Failure> {
        fits(self.wired, info.capacity.inputs)?;
        let mut rehearsal: Box<Settings<INPUTS>> = Box::new(Settings::DELIVERED);
        for setting in self.settings() {
            let beyond = matches!(setting, Setting::Input(i) if usize::from(i.input) >= INPUTS);
            // A newer box may have more inputs than this program knows.
            if !beyond && let Err(problem) = rehearsal.set(&setting) {
                return Err(Failure::input(format!("{problem}; nothing was changed")));
            }
        }
        if self.reset && self.save && !self.yes && !agreed(client, info)? {
            return Err(Failure::input("nothing was changed"));
        }
        if self.reset {
            client.tell(&Request::ResetSettings)?;
        }
        for setting in self.settings() {
            client.tell(&Request::WriteSetting(setting))?;
        }
        Ok(self.save.then(|| save(client)).transpose()?)
    }
}

/// `true` if a user can be asked: input and messages are a terminal.
fn is_asked() -> bool {
    std::io::stdin().is_terminal() && std::io::stderr().is_terminal()
}

/// Asks whether what the box keeps may be thrown away.
fn agreed<P: Port>(client: &mut Client<'_, P>, info: &BoxInfo) -> Result<bool, Failure> {
    let wired = client.wired_inputs(info.capacity.inputs)?.len();
    // A terminal that takes no prompt gives no answer either.
    let mut err = anstream::stderr();
    let _ = write!(
        err,
        "This throws away for good what the box keeps: its name, its rates, and the calibrations\nof {wired} inputs (`--export FILE`, in a call before, keeps those). Type yes to go on: "
    );
    let _ = err.flush();
    let mut answer = String::new();
    let read = std::io::stdin().read_line(&mut answer);
    read.map_err(|e| Failure::input(format!("stdin: {e}; add --yes if it is meant")))?;
    Ok(answer.trim() == "yes")
}

fn save<P: Port>(client: &mut Client<'_, P>) -> Result<Storage, ClientError> {
    client.ask(&Request::SaveSettings, |reply| match reply {
        Reply::Saved(Saved { storage }) => Some(*storage),
        _ => None,
    })
}

/// Checks that the box has all these inputs.
fn fits(wired: &[InputEntry], inputs: u8) -> Result<(), Failure> {
    match wired.iter().find(|entry| entry.input >= inputs) {
        None => Ok(()),
        Some(entry) if inputs == 0 => Err(Failure::input(format!(
            "input {}: this box has no inputs of its own",
            entry.number()
        ))),
        Some(entry) => Err(Failure::input(format!(
            "input {}: this box has inputs 1 to {inputs}; correct `input` in the file",
            entry.number()
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{ClientMemory, HostBox, HostBoxMemory};
    use crate::rig::{Inputs, Troubles};
    use massline_firmware::wire::SettingKey;

    #[test]
    fn changes_are_read_and_wrong_ones_say_what_there_is() {
        assert_eq!(parse("name=a=b"), Ok(Change::Name("a=b".to_owned())));
        assert_eq!(parse("baud=115200"), Ok(Change::Baud(115_200)));
        assert_eq!(parse("rate=512.5"), Ok(Change::Rate(512.5)));
        for (text, word) in [
            ("name", "KEY=VALUE"),
            ("colour=red", "name, baud, rate"),
            ("baud=fast", "921600"),
            ("name=0123456789012345678901234567890123", "34 bytes"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(word), "{error}");
        }
    }

    #[test]
    fn one_value_that_is_refused_leaves_all_as_they_were() {
        let (mut memory, mut own) = (ClientMemory::new(), HostBoxMemory::new());
        let inputs = Inputs::fork(Troubles::default()).unwrap();
        let host = HostBox::with_inputs(&mut own, 1, inputs);
        let mut client = Client::new(host, &mut memory);
        let info = client.hello().unwrap();
        let before = client.wired_inputs(info.capacity.inputs).unwrap();
        let set = [Change::Name("new".to_owned()), Change::Rate(0.0)];
        let order = Order {
            reset: true,
            set: &set,
            wired: &[],
            save: true,
            yes: true,
        };
        let error = order.apply(&mut client, &info).unwrap_err();
        assert!(error.message.contains("nothing was changed"), "{error:?}");
        assert_eq!(client.wired_inputs(info.capacity.inputs).unwrap(), before);
        assert!(before.len() > 10);
        let name = client.ask(&Request::ReadSetting(SettingKey::Name), |r| match r {
            Reply::Setting(Setting::Name(name)) => Some((*name).to_owned()),
            _ => None,
        });
        assert_eq!(name.unwrap(), "massline");
    }
}
