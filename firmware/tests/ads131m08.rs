//! The driver of the ADS131M08 and the model of the chip, against each other and against the
//! data sheet.

use core::cell::RefCell;
use embedded_hal::spi::{Operation, SpiDevice};
use massline_firmware::calibration::BRIDGE_SUPPLY_MAX;
use massline_firmware::drivers::ads131m08::registers::{CHANNELS, Register, clock, command};
use massline_firmware::drivers::ads131m08::{
    Ads131m08, CLOCK_HZ, Channel, Configuration, Gain, Oversampling, SPI_HZ_MAX,
};
use massline_firmware::drivers::{Converter, Fault, Reading, Signal};
use massline_firmware::models::random::{Random, mix};
use massline_firmware::models::rig::{self, Port, Rig};

fn configuration() -> Configuration {
    let mut configuration = Configuration {
        oversampling: Oversampling::X4096,
        channels: [Channel::pins(Gain::ONE); CHANNELS],
    };
    for (k, channel) in configuration.channels.iter_mut().enumerate() {
        channel.gain = Gain::new(1 << k).unwrap();
        channel.offset = [1, -1, 1000, -1000, 8_388_607, -8_388_608, 0, 77][k];
        channel.correction = 0x80_0000 + 1111 * k as u32;
    }
    configuration
}

/// A pseudo-random voltage of an input at a cycle, in the range of a gain of 128.
fn volts(input: usize, cycle: u64) -> f64 {
    let bits = mix(cycle * 64 + input as u64) >> 40;
    (bits as f64 / (1 << 23) as f64 - 1.0) * 9e-3
}

fn rig() -> RefCell<Rig<impl rig::Signal, 1>> {
    RefCell::new(Rig::new(volts, 5))
}

#[test]
fn every_register_holds_its_value() {
    let rig = rig();
    let mut chip = Ads131m08::new(Port::new(&rig, 0), configuration());
    chip.reset().unwrap();
    let mut random = Random::new(11);
    for round in 0..50 {
        for address in Register::MODE.0..=Register::LAST.0 {
            let register = Register(address);
            let mut value = random.bits() as u16 & register.mask();
            if register == Register::MODE {
                // Words of 24 bits and CCITT's checksum: the driver supports no others.
                value = value & !0x0F00 | 0x0100;
            }
            chip.write_register(register, value).unwrap();
            let held = rig.borrow_mut().chip(0).unwrap().register(register);
            assert_eq!(held, value, "{register:?} in round {round}");
        }
    }
}

#[test]
fn registers_after_reset_are_the_data_sheets() {
    let rig = rig();
    let mut chip = Ads131m08::new(Port::new(&rig, 0), configuration());
    chip.prepare().unwrap();
    chip.unlock().unwrap();
    chip.reset().unwrap();
    for (address, value) in [
        (0x00, 0x2800),
        (0x02, 0x0510),
        (0x03, 0xFF0E),
        (0x04, 0),
        (0x06, 0x0600),
        (0x09, 0),
        (0x0C, 0x8000),
        (0x0D, 0),
        (0x2F, 0x8000),
    ] {
        let found = chip.read_register(Register(address)).unwrap();
        assert_eq!(found, value, "register {address:#04x}");
    }
    // Reset, words of 24 bits; the DRDY bits depend on the time.
    let status = chip.read_register(Register::STATUS).unwrap();
    assert_eq!(status & 0xFF00, 0x0500);
}

#[test]
fn read_only_registers_stay() {
    let rig = rig();
    let mut chip = Ads131m08::new(Port::new(&rig, 0), configuration());
    chip.reset().unwrap();
    for register in [Register::ID, Register::REGMAP_CRC] {
        let before = chip.read_register(register).unwrap();
        let refused = chip.write_register(register, !before);
        let fault = Fault::Register {
            address: register.0,
            found: before,
            expected: !before,
        };
        assert_eq!(refused, Err(fault));
    }
}

#[test]
fn samples_follow_from_voltages_and_settings() {
    let rig = rig();
    let settings = configuration();
    let mut chip = Ads131m08::new(Port::new(&rig, 0), settings);
    chip.prepare().unwrap();
    // Samples from before are read and ignored.
    while chip.read(&mut [0; CHANNELS]) != Err(Fault::Stale) {}
    for _ in 0..1000 {
        let edge = rig.borrow_mut().wait();
        assert_eq!(edge.ready, 1);
        let mut counts = [0; CHANNELS];
        assert_eq!(chip.read(&mut counts), Ok(Reading::default()));
        for (k, (count, channel)) in counts.into_iter().zip(settings.channels).enumerate() {
            let full_scale = 1.2 / f64::from(channel.gain.factor());
            let raw = (volts(k, edge.cycle) / full_scale * 8_388_608.0).round();
            let factor = f64::from(channel.correction) / 8_388_608.0;
            let exact = (raw - f64::from(channel.offset)) * factor;
            let clipped = exact.round().clamp(-8_388_608.0, 8_388_607.0);
            assert_eq!(f64::from(count), clipped, "channel {k}");
        }
        assert_eq!(chip.read(&mut counts), Err(Fault::Stale));
    }
}

#[test]
fn test_signals_come_through_the_amplifiers() {
    let rig = rig();
    let mut settings = configuration();
    for (signal, expected) in [
        (Signal::Shorted, 0.0),
        (Signal::TestPositive, 0.16),
        (Signal::TestNegative, -0.16),
    ] {
        for (k, channel) in settings.channels.iter_mut().enumerate() {
            *channel = Channel::pins(Gain::new(1 << k).unwrap());
            channel.signal = signal;
        }
        let mut chip = Ads131m08::new(Port::new(&rig, 0), settings);
        chip.prepare().unwrap();
        while chip.read(&mut [0; CHANNELS]) != Err(Fault::Stale) {}
        rig.borrow_mut().wait();
        let mut counts = [0; CHANNELS];
        chip.read(&mut counts).unwrap();
        // The same at every gain, by which the test voltage is divided.
        let exact = (expected / 1.2 * 8_388_608.0_f64).round() as i32;
        // The model's noise is two errors of at most 21 counts each.
        assert!(
            counts.iter().all(|count| (count - exact).abs() <= 42),
            "{counts:?}"
        );
        assert!(counts.iter().any(|count| *count != counts[0]), "no noise");
    }
}

#[test]
fn a_locked_chip_keeps_its_registers() {
    let rig = rig();
    let mut chip = Ads131m08::new(Port::new(&rig, 0), configuration());
    chip.prepare().unwrap();
    let refused = chip.write_register(Register::GAIN1, 0x1111);
    assert!(matches!(refused, Err(Fault::Command { .. })), "{refused:?}");
    assert!(matches!(chip.reset(), Err(Fault::Command { .. })));
    let gains = configuration().registers()[usize::from(Register::GAIN1.0 - Register::MODE.0)];
    assert_eq!(chip.read_register(Register::GAIN1), Ok(gains));
    chip.unlock().unwrap();
    chip.write_register(Register::GAIN1, 0x1111).unwrap();
}

#[test]
fn standby_stops_the_samples() {
    let rig = rig();
    let mut chip = Ads131m08::new(Port::new(&rig, 0), configuration());
    chip.prepare().unwrap();
    chip.unlock().unwrap();
    chip.standby().unwrap();
    let mut drain = || (0..3).map(|_| chip.read(&mut [0; CHANNELS])).last();
    drain();
    let later = rig.borrow().cycle() + 100 * 16_384;
    rig.borrow_mut().pass_until(later);
    assert!(!rig.borrow_mut().chip(0).unwrap().is_ready());
    chip.wake_up().unwrap();
    let later = later + 100 * 16_384;
    rig.borrow_mut().pass_until(later);
    assert!(rig.borrow_mut().chip(0).unwrap().is_ready());
}

#[test]
fn a_register_that_changes_by_itself_is_noticed() {
    let rig = rig();
    for address in Register::CLOCK.0..=Register::LAST.0 {
        let mut chip = Ads131m08::new(Port::new(&rig, 0), configuration());
        chip.prepare().unwrap();
        let register = Register(address);
        let changed = configuration().registers()[usize::from(address - 2)] ^ 0x0100;
        if register.mask() & 0x0100 == 0 {
            continue;
        }
        let mut model = rig.borrow_mut();
        model.chip(0).unwrap().set_register(register, changed);
        // Two passes of the check.
        let later = model.cycle() + u64::from(CLOCK_HZ) / 5000;
        model.pass_until(later);
        drop(model);
        assert_eq!(
            chip.read(&mut [0; CHANNELS]),
            Err(Fault::Reset),
            "{register:?}"
        );
    }
}

/// The check of the register map (8.3.13) reports the writes of the configuration only after 180 µs, which
/// is longer than a fast bus takes for what follows them.
#[test]
fn the_check_of_the_registers_does_not_take_the_configuration_for_a_fault() {
    let rig = rig();
    rig.borrow_mut().set_bus(SPI_HZ_MAX);
    let mut chip = Ads131m08::new(Port::new(&rig, 0), configuration());
    chip.prepare().unwrap();
    let clock = rig.borrow_mut().chip(0).unwrap().register(Register::CLOCK);
    assert_eq!(clock & clock::XTAL_DIS, clock::XTAL_DIS, "no crystal");
    let later = rig.borrow().cycle() + u64::from(CLOCK_HZ) / 100;
    rig.borrow_mut().pass_until(later);
    for _ in 0..2 {
        assert_eq!(chip.read(&mut [0; CHANNELS]), Ok(Reading::default()));
    }
}

/// At a gain of 8 and more the inputs must stay 1.8 V below the supply of 3.3 V (6.3): the middle of a
/// bridge on that supply is above that.
#[test]
fn a_bridge_lies_within_the_range_of_the_inputs() {
    let rig = rig();
    let mut chip = Ads131m08::new(Port::new(&rig, 0), configuration());
    chip.prepare().unwrap();
    let count = |supply: f64, channel: u8| {
        let mut rig = rig.borrow_mut();
        let chip = rig.chip(0).unwrap();
        chip.set_common_mode(channel.into(), 0.5 * supply);
        chip.set_register(Register::offset_msb(channel), 0);
        chip.set_register(Register(Register::offset_msb(channel).0 + 1), 0);
        chip.set_register(Register::gain_msb(channel), 0x8000);
        chip.set_register(Register(Register::gain_msb(channel).0 + 1), 0);
        chip.count(channel, 5e-3)
    };
    for channel in 0..CHANNELS as u8 {
        let gain = 1 << channel;
        let exact = (5e-3 * f64::from(gain) / 1.2 * 8_388_608.0_f64).round() as i32;
        // The middle of 3.3 V is 1.65 V: fine for small gains only.
        assert_eq!(count(3.3, channel) == exact, gain < 8, "gain {gain}");
        assert_eq!(count(BRIDGE_SUPPLY_MAX, channel), exact, "gain {gain}");
    }
}

/// The bytes on the bus against the frames of the data sheet.
#[test]
fn frames_are_the_data_sheets() {
    struct Wire(Vec<Vec<u8>>);
    impl embedded_hal::spi::ErrorType for Wire {
        type Error = core::convert::Infallible;
    }
    impl SpiDevice for Wire {
        fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Self::Error> {
            for operation in operations {
                if let Operation::TransferInPlace(bytes) = operation {
                    self.0.push(bytes.to_vec());
                    bytes.fill(0);
                }
            }
            Ok(())
        }
    }
    let mut chip = Ads131m08::new(Wire(Vec::new()), configuration());
    // Nothing answers; the sent bytes are compared. RREG of GAIN1 is 101 0 0010 0 000 0000.
    assert_eq!(chip.read_register(Register::GAIN1), Err(Fault::Stuck));
    // WREG of CH0_CFG is 011 0 0100 1 000 0000, then the value.
    assert_eq!(chip.write_register(Register(9), 0x1234), Err(Fault::Stuck));
    let sent = chip.release().0;
    assert!(sent.iter().all(|frame| frame.len() == 30));
    assert_eq!(sent[0][..3], [0xA2, 0x00, 0]);
    assert_eq!(sent[2][..6], [0x64, 0x80, 0, 0x12, 0x34, 0]);
    assert_eq!(command::read(Register(2), 47), 0xA12E);
    assert_eq!(command::write_done(Register(2), 47), 0x412E);
}

#[test]
fn faults_of_the_bus_are_named() {
    let rig = rig();
    let mut chip = Ads131m08::new(Port::new(&rig, 0), configuration());
    rig.borrow_mut().stick(0, Some(false));
    assert_eq!(chip.prepare(), Err(Fault::Stuck));
    rig.borrow_mut().stick(0, None);
    rig.borrow_mut().fail_bus(0);
    assert_eq!(chip.prepare(), Err(Fault::Bus));
    chip.prepare().unwrap();
}
