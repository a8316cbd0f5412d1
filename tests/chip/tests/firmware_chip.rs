//! The ELF that is flashed, on the modelled chip.

use massline::device::{Client, ClientMemory, firmware};
use massline_chip::SECOND;
use massline_chip::bench::Bench;
use massline_chip::flash::Cells;
use massline_chip::machine::{Machine, Parts};
use massline_chip::rcc::Oscillators;
use massline_firmware::settings::LINK_BAUD;

fn boot(oscillators: Oscillators, cells: Cells) -> Machine {
    let elf = firmware::find(None).unwrap_or_else(|error| panic!("{error}"));
    Machine::start(Parts {
        elf: &elf,
        cells,
        oscillators,
        bench: Bench::new(Box::new(|_, _| 0.0)),
        baud: LINK_BAUD,
        seed: 1,
    })
}

#[test]
#[ignore = "needs the firmware"]
fn first() {
    let mut machine = boot(
        Oscillators {
            crystal: Some(8_000_000),
            pll: true,
        },
        Cells::default(),
    );
    let begin = std::time::Instant::now();
    machine.run(SECOND / 10);
    println!("{:?} {:?} {}", machine.forbidden(), machine.resets.len(), machine.time());
    println!("{:?}", begin.elapsed());
    let mut memory = ClientMemory::new();
    let mut client = Client::new(&mut machine, &mut memory);
    let info = client.hello();
    println!("{info:?}");
    println!("{:?}", begin.elapsed());
    println!("{:?} {:?} {}", machine.forbidden(), machine.resets.len(), machine.time());
}
