//! Settings in the flash: saved, found again, and never lost to a cut of the supply.

use std::time::Duration;

use massline::device::{Client, ClientMemory, Port, PortError};
use massline_chip::SECOND;
use massline_chip::flash::Cells;
use massline_chip::machine::Machine;
use massline_firmware::models::random::Random;
use massline_firmware::wire::{Reply, Request, Setting, SettingKey, Storage};

use crate::{GOOD, boot, clean, silence};

/// Longest time from the request of a save to the end of the reply, where no sector is erased, ps.
const LONGEST: u64 = SECOND / 16;

/// Longest name, so that an item of settings has more than a byte that could be cut.
fn name(number: u64) -> String {
    format!("box of the modelled chip {number:07}")
}

fn found(machine: &mut Machine) -> (String, Storage) {
    let mut memory = ClientMemory::new();
    let mut client = Client::new(machine, &mut memory);
    let storage = client.hello().unwrap().storage;
    let key = Request::ReadSetting(SettingKey::Name);
    let name = client.ask(&key, |reply| match reply {
        Reply::Setting(Setting::Name(name)) => Some((*name).to_owned()),
        _ => None,
    });
    (name.unwrap(), storage)
}

fn write(machine: &mut Machine, name: &str) {
    let mut memory = ClientMemory::new();
    let mut client = Client::new(machine, &mut memory);
    client.hello().unwrap();
    let setting = Request::WriteSetting(Setting::Name(name));
    client.tell(&setting).unwrap();
}

/// `true` if the box has said that the settings are saved.
fn save(port: impl Port) -> bool {
    let mut memory = ClientMemory::new();
    let mut client = Client::new(port, &mut memory);
    let saved = client.ask(&Request::SaveSettings, |reply| {
        matches!(reply, Reply::Saved(_)).then_some(())
    });
    saved.is_ok()
}

/// A box whose supply is about to be cut.
struct Cut<'m> {
    machine: &'m mut Machine,
    /// Time of the cut, ps.
    end: u64,
}

impl Port for Cut<'_> {
    fn name(&self) -> String {
        self.machine.name()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.machine.send(bytes)
    }

    fn receive(&mut self, into: &mut Vec<u8>, _: Duration) -> Result<usize, PortError> {
        let left = self.end.saturating_sub(self.machine.time()) / 1000;
        match self.machine.receive(into, Duration::from_nanos(left))? {
            0 => Err(PortError::Gone {
                name: self.name(),
                reason: "the supply is cut".to_owned(),
            }),
            count => Ok(count),
        }
    }

    fn patience(&self) -> Duration {
        self.machine.patience()
    }
}

#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn settings_survive_the_supply() {
    let mut machine = boot(GOOD, Cells::default(), silence(), 1);
    write(&mut machine, &name(1));
    assert!(save(&mut machine));
    clean(&machine);
    let [programmed, _] = machine.chip().flash.counts;
    assert!(programmed > 32, "{programmed}");
    let cells = machine.cut();
    // The level of the supply's watch was set at the first start, for good: 2.8 V is 0.
    assert_eq!(cells.options >> 2 & 0b11, 0);
    let mut machine = boot(GOOD, cells.clone(), silence(), 2);
    assert_eq!(found(&mut machine), (name(1), Storage::Flash));
    clean(&machine);
    assert_eq!(machine.cut(), cells, "a start writes nothing");
}

/// Sectors that are full of zeros, as after years or by another program, are erased: first the one, and
/// the other only when the first holds settings.
#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn a_full_flash_is_erased_in_time_for_the_watchdog() {
    let full = Cells {
        settings: vec![0; 256 << 10],
        ..Cells::default()
    };
    let mut machine = boot(GOOD, full, silence(), 1);
    write(&mut machine, &name(2));
    assert!(save(&mut machine));
    clean(&machine);
    let [_, erased] = machine.chip().flash.counts;
    assert!(erased > 0);
    assert_eq!(machine.resets.len(), 1, "{:?}", machine.resets);
    let mut machine = boot(GOOD, machine.cut(), silence(), 2);
    assert_eq!(found(&mut machine).0, name(2));
    clean(&machine);
}

/// The supply is cut at random instants of a save: the settings are the old ones or the new ones.
///
/// `MASSLINE_CUTS=500` makes so many cuts.
#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn a_cut_of_the_supply_loses_no_settings() {
    let cuts = std::env::var("MASSLINE_CUTS").map_or(12, |text| text.parse().unwrap());
    let mut random = Random::new(7);
    let mut machine = boot(GOOD, Cells::default(), silence(), 1);
    write(&mut machine, &name(0));
    assert!(save(&mut machine));
    let mut cells = machine.cut();
    let (mut kept, mut current) = ([0; 2], name(0));
    for cut in 1..=cuts {
        let mut machine = boot(GOOD, cells, silence(), cut);
        let new = name(cut);
        write(&mut machine, &new);
        let end = machine.time() + random.below(LONGEST);
        let cut_off = Cut {
            machine: &mut machine,
            end,
        };
        let is_told = save(cut_off);
        clean(&machine);
        cells = machine.cut();
        let mut machine = boot(GOOD, cells, silence(), cuts + cut);
        let (found, _) = found(&mut machine);
        assert!(found == new || found == current, "cut {cut}: {found}");
        assert!(found == new || !is_told, "cut {cut}: told, and lost");
        kept[usize::from(found == new)] += 1;
        current = found;
        clean(&machine);
        cells = machine.cut();
    }
    println!(
        "{} times the old ones, {} times the new ones",
        kept[0], kept[1]
    );
    assert!(kept.iter().all(|n| *n > 0), "{kept:?}");
}
