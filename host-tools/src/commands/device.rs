//! The box that a command talks to, and the way to it.

use super::Failure;
use crate::device::{
    BAUD, Client, ClientError, ClientMemory, Emulator, HostBox, HostBoxMemory, Port, Serial,
    firmware,
};
use crate::rig::{Inputs, Shaker, Troubles};
use clap::ArgGroup;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Place of the box: exactly one of three.
#[derive(Clone, Debug, clap::Args)]
#[command(group = ArgGroup::new("box").required(true).args(["port", "emulator", "host"]))]
pub struct Device {
    /// The box on a serial port: /dev/ttyACM0, COM3
    #[arg(long, value_name = "DEV", help_heading = "The box")]
    port: Option<String>,
    /// The firmware in QEMU: no hardware needed
    #[arg(long, help_heading = "The box")]
    emulator: bool,
    /// The box's instrument in this program: neither hardware nor QEMU needed
    #[arg(long, help_heading = "The box")]
    host: bool,
    /// Bit rate of the serial port
    #[arg(long, value_name = "RATE", default_value_t = BAUD, conflicts_with_all = ["emulator", "host"], help_heading = "The box")]
    baud: u32,
    /// The firmware to emulate; the one that was built last if absent
    #[arg(long, value_name = "FILE", conflicts_with_all = ["port", "host"], help_heading = "The box")]
    elf: Option<PathBuf>,
}

/// Longest that the emulator may take to boot, which is half a second on an idle machine.
const BOOT: Duration = Duration::from_secs(20);
/// Time between two checks of that.
const LOOK: Duration = Duration::from_millis(100);

impl Device {
    /// `true` if ticks of the box's clock are true: an emulator's are not.
    pub const fn keeps_time(&self) -> bool {
        !self.emulator
    }

    /// The file that it is read from, where there is one.
    pub fn file(&self) -> Option<&Path> {
        self.elf.as_deref()
    }

    /// Reaches the box and has `work` talk to it. To the inputs of the one in this program
    /// nothing is wired.
    ///
    /// # Errors
    /// [`Failure`] if it cannot be reached, or that of `work`.
    pub fn talk<T>(
        &self,
        work: impl FnOnce(&mut Client<'_, Box<dyn Port + '_>>) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        self.reach(None, work)
    }

    /// The same, but the tuning fork's sensors are wired to the box in this program.
    ///
    /// # Errors
    /// [`Failure`] if it cannot be reached, or that of `work`.
    pub fn talk_of_inputs<T>(
        &self,
        troubles: Troubles,
        work: impl FnOnce(&mut Client<'_, Box<dyn Port + '_>>) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        if !self.host {
            return self.reach(None, work);
        }
        let inputs = Inputs::fork(troubles).map_err(Failure::input)?;
        self.reach(Some(inputs), work)
    }

    /// The same, and `work` is told who shakes the box in this program.
    ///
    /// # Errors
    /// [`Failure`] if it cannot be reached, or that of `work`.
    pub fn talk_of_runs<T>(
        &self,
        troubles: Troubles,
        work: impl FnOnce(&mut Client<'_, Box<dyn Port + '_>>, Option<&Shaker>) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        if !self.host {
            return self.reach(None, |client| work(client, None));
        }
        let inputs = Inputs::fork_runs(troubles, usize::MAX).map_err(Failure::input)?;
        let shaker = inputs.shaker();
        self.reach(Some(inputs), |client| work(client, Some(&shaker)))
    }

    fn reach<T>(
        &self,
        inputs: Option<Inputs>,
        work: impl FnOnce(&mut Client<'_, Box<dyn Port + '_>>) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        let mut own = None;
        let port: Box<dyn Port + '_> = if let Some(path) = &self.port {
            Box::new(Serial::open(path, self.baud).map_err(Failure::input)?)
        } else if self.emulator {
            let elf = firmware::find(self.elf.as_deref()).map_err(Failure::input)?;
            Box::new(Emulator::start(&elf).map_err(Failure::input)?)
        } else {
            let memory = own.insert(HostBoxMemory::new());
            Box::new(match inputs {
                Some(inputs) => HostBox::with_inputs(memory, 1, inputs),
                None => HostBox::new(memory, 1),
            })
        };
        let mut memory = ClientMemory::new();
        let mut client = Client::new(port, &mut memory);
        if self.emulator {
            booted(&mut client)?;
        }
        work(&mut client).map_err(|failure| self.explain(failure))
    }

    /// Says of an emulated box that it is no wonder that it does not sample. Its settings last
    /// as long as the command, so that nothing is ever wired to it either.
    fn explain(&self, failure: Failure) -> Failure {
        let of_inputs = ["does not come up", "nothing is wired"];
        let is_told = of_inputs
            .iter()
            .any(|words| failure.message.contains(words));
        if self.emulator && is_told {
            return failure
                .and("an emulated box has no converters; --host is one that has modelled ones");
        }
        failure
    }
}

/// Waits for the first that a box says: what is sent to it before is lost, and would only
/// be sent again after a reply's time.
fn booted<P: Port>(client: &mut Client<'_, P>) -> Result<(), ClientError> {
    let mut waited = Duration::ZERO;
    while client.link().received.frames == 0 && waited < BOOT {
        client.listen(LOOK)?;
        waited += LOOK;
    }
    Ok(())
}
