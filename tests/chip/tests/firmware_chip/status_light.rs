//! The status LED of the flashed ELF.

use std::sync::Arc;

use massline::device::{Client, ClientMemory};
use massline_chip::SECOND;
use massline_chip::bus::Chip;
use massline_chip::flash::Cells;
use massline_chip::gpio::pin;
use massline_chip::machine::Machine;
use massline_firmware::wire::Stream;

use crate::sampling::{stream, volts, wire};
use crate::{GOOD, boot, lossless, pass};

/// Changes of the LED in the next two seconds, and the share of them that it is lit.
fn seen(client: &mut Client<'_, &mut Machine>) -> (u32, f64) {
    let (mut changes, mut lit, mut looks, mut last) = (0, 0, 0, None);
    let end = client.port().time() + 2 * SECOND;
    while client.port().time() < end {
        pass(client, SECOND / 50);
        let is_lit = !client.port().chip().level(pin("PC12"));
        changes += u32::from(last.is_some_and(|last| last != is_lit));
        lit += u32::from(is_lit);
        looks += 1;
        last = Some(is_lit);
    }
    (changes, f64::from(lit) / f64::from(looks))
}

#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn the_led_says_that_the_box_is_ready_samples_and_has_faults() {
    let mut machine = boot(GOOD, Cells::default(), Box::new(volts), 8);
    let chip: Arc<std::sync::Mutex<Chip>> = Arc::clone(&machine.shared());
    let mut memory = ClientMemory::new();
    let mut client = Client::new(&mut machine, &mut memory);
    client.hello().unwrap();
    wire(&mut client, 8);
    pass(&mut client, SECOND / 5);
    assert_eq!(seen(&mut client), (0, 1.0), "ready");
    client.tell(&stream(Stream::Counts)).unwrap();
    // Its filters settle; two seconds later no fault is shown.
    pass(&mut client, 3 * SECOND);
    let (changes, lit) = seen(&mut client);
    assert!(
        (3..=5).contains(&changes),
        "{changes} changes in two seconds"
    );
    assert!((lit - 0.5).abs() < 0.1, "{lit}");
    let garble = |every| chip.lock().unwrap().bench.garbles_every = every;
    garble(Some(100));
    pass(&mut client, SECOND);
    let (changes, _) = seen(&mut client);
    assert!((18..=22).contains(&changes), "{changes} changes of faults");
    garble(None);
    pass(&mut client, 3 * SECOND);
    let (changes, _) = seen(&mut client);
    assert!(
        (3..=5).contains(&changes),
        "{changes} changes behind the faults"
    );
    client.tell(&stream(Stream::Off)).unwrap();
    pass(&mut client, SECOND / 2);
    assert_eq!(seen(&mut client), (0, 1.0), "ready again");
    drop(client);
    lossless(&mut machine);
}
