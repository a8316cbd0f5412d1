//! Cost of a sample and of a block on the chip, in instructions: the numbers behind the table of
//! load in the firmware's README.
//!
//! To be run in the emulator with `-icount shift=0`, where TIM2 counts instructions; a test does
//! so. The converters' models answer until all samples are good, then recorded frames replace them,
//! so that only code that runs on the box is counted. The results are text on the link.

#![cfg_attr(target_os = "none", no_std, no_main)]

/// Prints the command that runs it.
#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this runs in the emulator: cargo xtask test --only emulator");
}

#[cfg(target_os = "none")]
#[path = "../src/board/bus.rs"]
#[expect(dead_code, reason = "the drivers' part is not measured")]
mod bus;

#[cfg(target_os = "none")]
#[path = "../src/board/dma.rs"]
mod dma;

#[cfg(target_os = "none")]
#[path = "../src/board/lanes.rs"]
mod lanes;

/// The DRDY lines, of which there are none.
#[cfg(target_os = "none")]
mod edges {
    pub const fn is_noted() -> bool {
        false
    }

    pub const fn forget() {}

    pub const fn watch(_: u32) {}
}

#[cfg(target_os = "none")]
mod on_chip {
    use core::cell::UnsafeCell;
    use core::fmt::Write;
    use core::hint::black_box;
    use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
    use heapless::spsc::Queue;
    use massline_core::geometry::{
        Accelerometer, LoadCell, Mount, Placement, Quantity, RunGeometry, RunSensor,
    };
    use massline_core::spectra::{
        Average, BlockSettings, Blocks, Complex32, CrossAverage, CrossSums, DriveAverage, Rings,
        SpectraError, Sum, Window,
    };
    use massline_firmware::acquisition::Acquisition;
    use massline_firmware::calibration::{Channel, Limits, Scale, Watch};
    use massline_firmware::drivers::Converter;
    use massline_firmware::drivers::ads131m08::frame::BYTES;
    use massline_firmware::drivers::ads131m08::registers::CHANNELS;
    use massline_firmware::drivers::ads131m08::{
        Ads131m08, Channel as Input, Configuration, Gain, Oversampling, SPI_MODE,
    };
    use massline_firmware::drivers::adxl355::{self, Adxl355};
    use massline_firmware::drivers::lanes::{Lanes, Progress, Step};
    use massline_firmware::models::BusError;
    use massline_firmware::models::ads131m08::Chip;
    use massline_firmware::models::adxl355 as adxl355_model;
    use massline_firmware::models::random::mix;
    use massline_firmware::sampling::sequencer::{Conversion, Edge, Event, Sequencer};
    use massline_firmware::sampling::{self, ORDER, RawFrame, WAITING, acquire};
    use massline_firmware::wire::Health;
    use nalgebra::Vector3;
    use stm32f4xx_hal::pac::{GPIOC, RCC, SPI1, SPI2, SPI3, TIM2, USART2};

    use super::bus::Registers;
    use super::lanes::DmaLanes;

    const CHIPS: usize = 4;
    const INPUTS: usize = CHIPS * CHANNELS;
    /// Those of the accelerometer, too.
    const ALL: usize = INPUTS + adxl355::CHANNELS;
    /// Bits of two converters on buses of their own.
    const TWO: u32 = 0b101;
    const RESULTANTS: usize = 12;
    const LINES: usize = 100;
    const PERIOD: u64 = 1000;
    /// Repetitions of each measurement, which reports their mean.
    const ROUNDS: u32 = 64;

    /// Static memory for objects that are too large for the stack.
    struct Storage<T>(UnsafeCell<T>);

    // SAFETY: one thread, no interrupt, and each storage is taken once.
    unsafe impl<T> Sync for Storage<T> {}

    impl<T> Storage<T> {
        #[expect(clippy::mut_from_ref, reason = "taken once each")]
        fn take(&self) -> &mut T {
            // SAFETY: each storage is taken at one place, which is reached once.
            unsafe { &mut *self.0.get() }
        }
    }

    static QUEUES: Storage<Queue<RawFrame, WAITING>> = Storage(UnsafeCell::new(Queue::new()));
    static SPECTRA: Storage<Spectra> = Storage(UnsafeCell::new(Spectra {
        exact: Room {
            history: [0.0; 13 * 1024],
            work: [NOTHING; 1024],
            sums: [Sum::ZERO; (1 + 3 * 11) * 64],
        },
    }));

    /// Memory of a measurement: the SRAM has no room for all of it at a time.
    union Spectra {
        /// Sums of thirteen channels, or fewer, referred to one of them.
        driven: Room<{ 13 * 400 }, 256, [Sum; (1 + 3 * 12) * LINES]>,
        /// Sums of all products of twelve channels.
        full: Room<{ 13 * 400 }, 256, [CrossSums; 64]>,
        /// Samples of twelve channels at the full rate, and those that wait.
        exact: Room<{ 13 * 1024 }, 1024, [Sum; (1 + 3 * 11) * 64]>,
    }

    #[derive(Clone, Copy)]
    struct Room<const HISTORY: usize, const WORK: usize, S> {
        history: [f32; HISTORY],
        work: [Complex32; WORK],
        sums: S,
    }

    const NOTHING: Complex32 = Complex32::new(0.0, 0.0);

    /// The bus to one chip: a model that answers, and its last frame.
    struct Wire {
        chip: Chip,
        last: [u8; BYTES],
    }

    impl ErrorType for Wire {
        type Error = BusError;
    }

    impl SpiDevice for Wire {
        fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), BusError> {
            for operation in operations {
                let Operation::TransferInPlace(bytes) = operation else {
                    continue;
                };
                self.chip.transfer(bytes);
                if bytes.len() == BYTES {
                    self.last.copy_from_slice(bytes);
                }
            }
            Ok(())
        }
    }

    /// The link, byte by byte.
    struct Link(USART2);

    impl Write for Link {
        fn write_str(&mut self, text: &str) -> core::fmt::Result {
            for byte in text.bytes() {
                while self.0.sr().read().txe().bit_is_clear() {}
                self.0.dr().write(|w| w.dr().set(byte.into()));
            }
            Ok(())
        }
    }

    /// Mean instructions of `work`.
    fn cost(timer: &TIM2, mut work: impl FnMut(u32)) -> u32 {
        let begin = timer.cnt().read().bits();
        for round in 0..ROUNDS {
            work(round);
        }
        timer.cnt().read().bits().wrapping_sub(begin) / ROUNDS
    }

    #[panic_handler]
    fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
        loop {
            cortex_m::asm::nop();
        }
    }

    #[cortex_m_rt::entry]
    fn main() -> ! {
        // SAFETY: no other code uses the peripherals.
        let device = unsafe { stm32f4xx_hal::pac::Peripherals::steal() };
        start(&device.RCC, &device.TIM2, &device.USART2);
        let mut link = Link(device.USART2);
        let timer = device.TIM2;
        let buses = (device.SPI1, device.SPI2, device.SPI3);
        let [frames, of_two] = frames(buses, device.GPIOC, &device.RCC, &timer);
        let (all, counts) = acquisition(&timer, 0b1_1111);
        let mut report = |name: &str, cost: u32| {
            let _ = writeln!(link, "{name} {cost}");
        };
        report("frames", frames);
        report("frames-16", of_two);
        report("acquisition", all);
        report("acquisition-16", acquisition(&timer, TWO).0);
        report("hand-over", hand_over(&timer));
        report("calibration", calibration(&timer, &counts));
        report("calibration-16", calibration(&timer, &counts[..16]));
        report("resultants", resultants::<{ INPUTS - 1 }>(&timer));
        report("resultants-16", resultants::<15>(&timer));
        let memory = SPECTRA.take();
        // SAFETY: all are numbers alone, for which any bits are good, and one is used at a time.
        let driven = unsafe { &mut memory.driven };
        let (decimation, block) = spectra(&timer, &mut driven.history, &mut driven.sums);
        report("decimation", decimation);
        report("block", block);
        let settings = BlockSettings::new(1024, 0.5, Window::Hann, 512.0, [0.5, 32.0]);
        if let Ok(settings) = settings {
            // SAFETY: as above.
            let Room {
                history,
                work,
                sums,
            } = unsafe { &mut memory.driven };
            let average = DriveAverage::new(&settings, COMPARED - 1, sums);
            report("hop-drive", hop(&timer, settings, (history, work), average));
            // SAFETY: as above.
            let Room {
                history,
                work,
                sums,
            } = unsafe { &mut memory.full };
            let average = CrossAverage::new(&settings, sums);
            report("hop-full", hop(&timer, settings, (history, work), average));
            // SAFETY: as above.
            let Room {
                history,
                work,
                sums,
            } = unsafe { &mut memory.exact };
            let all = settings.without_decimation();
            let average = DriveAverage::new(&all, COMPARED - 1, sums);
            report("hop-exact", hop(&timer, all, (history, work), average));
        }
        let _ = writeln!(link, "end");
        loop {
            cortex_m::asm::wfi();
        }
    }

    fn start(rcc: &RCC, timer: &TIM2, link: &USART2) {
        rcc.apb1enr()
            .modify(|_, w| w.tim2en().set_bit().usart2en().set_bit());
        timer.arr().write(|w| w.arr().set(u32::MAX));
        timer.egr().write(|w| w.ug().set_bit());
        timer.cr1().write(|w| w.cen().set_bit());
        link.cr1().write(|w| w.ue().set_bit().te().set_bit());
    }

    /// The registers of a controller of DMA, which the emulator does not have: variables, whose flags say
    /// that every stream is complete.
    static STREAMS: Storage<[u32; 52]> = Storage(UnsafeCell::new({
        let mut words = [0; 52];
        // Transfer complete of streams 0 to 3; those that are asked for are among them.
        words[0] = 0x0820_0820;
        words
    }));

    /// A conversion over all lanes: the edge begins a frame on each, and six ends of frames begin the next
    /// one or complete it. And that of two converters, with two ends of frames.
    fn frames(buses: (SPI1, SPI2, SPI3), port: GPIOC, rcc: &RCC, timer: &TIM2) -> [u32; 2] {
        rcc.ahb1enr().modify(|_, w| w.gpiocen().set_bit());
        port.moder().reset();
        rcc.apb1enr()
            .modify(|_, w| w.spi2en().set_bit().spi3en().set_bit());
        rcc.apb2enr().modify(|_, w| w.spi1en().set_bit());
        let (own, first, second) = buses;
        let buses = [&*first, &*second, &*own]
            .map(|spi| Registers::start(spi, SPI_MODE, 16_000_000, 8_000_000));
        let streams: *const u32 = STREAMS.take().as_ptr();
        let mut lanes = DmaLanes::start(buses, [streams.cast(); 2]);
        let mut sequencer = Sequencer::new(ORDER);
        let mut good = lanes.is_there();
        let mut conversion = |ready: u32, ends: &[usize]| {
            let cost = cost(timer, |round| {
                let edge = Edge {
                    ready: black_box(ready),
                    at: round.into(),
                    is_merged: false,
                };
                good &= !sequencer.handle(Event::Edge(edge), &mut lanes);
                let mut is_complete = false;
                for lane in ends {
                    good &= !is_complete;
                    is_complete = sequencer.handle(Event::Lane(*lane), &mut lanes);
                }
                good &= is_complete && black_box(sequencer.conversion()).read == ready;
                good &= !sequencer.resume(&mut lanes);
            });
            if good { cost } else { 0 }
        };
        [
            conversion(0b1_1111, &[0, 1, 2, 0, 1, 2]),
            conversion(TWO, &[0, 1]),
        ]
    }

    /// A sample into the queue and out of it.
    fn hand_over(timer: &TIM2) -> u32 {
        let queues = QUEUES.take();
        let (mut producer, mut frames) = queues.split();
        let mut frame = RawFrame {
            number: 0,
            ticks: 0,
            counts: [1; sampling::INPUTS],
            faults: [Health::GOOD; sampling::CHIPS],
        };
        let mut good = true;
        let cost = cost(timer, |round| {
            frame.number = round.into();
            good &= producer.enqueue(*black_box(&frame)).is_ok();
            good &= frames
                .peek()
                .is_some_and(|frame| black_box(frame).number == u64::from(round));
            let _ = frames.dequeue();
        });
        if good { cost } else { 0 }
    }

    /// Lanes that have received the last frames of all converters.
    struct Recorded<'b>([&'b [u8]; CHIPS + 1]);

    impl Lanes for Recorded<'_> {
        fn begin(&mut self, _: usize, _: Step) -> Progress {
            Progress::Failed
        }

        fn progress(&mut self, _: usize) -> Progress {
            Progress::Failed
        }

        fn abort(&mut self, _: usize) {}

        fn is_edge_noted(&self) -> bool {
            false
        }

        fn received(&self, converter: usize) -> &[u8] {
            self.0.get(converter).copied().unwrap_or_default()
        }
    }

    /// A conversion of these converters and the accelerometer, by bits, from the bytes of their frames,
    /// with all checksums.
    fn acquisition(timer: &TIM2, used: u32) -> (u32, [i32; INPUTS]) {
        let configuration = Configuration {
            oversampling: Oversampling::X4096,
            channels: [Input::pins(Gain::ONE); CHANNELS],
        };
        let mut chips: [Ads131m08<Wire>; CHIPS] = core::array::from_fn(|_| {
            let wire = Wire {
                chip: Chip::new(),
                last: [0; BYTES],
            };
            Ads131m08::new(wire, configuration)
        });
        let settings = adxl355::Configuration::following(512.0);
        let mut follower = Adxl355::new(adxl355_model::Chip::new(), settings);
        let mut acquisition = Acquisition::<{ CHIPS + 1 }, ALL>::new(PERIOD as f32);
        for chip in (0..=CHIPS).filter(|chip| used >> chip & 1 == 0) {
            acquisition.leave_out(chip);
        }
        let mut synchronise = || ();
        let mut ticks = 0;
        for round in 0..16 {
            for (k, chip) in chips.iter_mut().enumerate() {
                let volts = core::array::from_fn(|c| 0.1 + 0.01 * (k + c + round) as f64);
                chip.bus().chip.convert(&volts);
            }
            follower.bus().convert([0.1, 0.2, 0.3]);
            let [a, b, c, d] = &mut chips;
            let converters: &mut [&mut dyn Converter] = &mut [a, b, c, d, &mut follower];
            if round == 0 {
                assert!(acquisition.start(converters, &mut synchronise).is_ok());
                continue;
            }
            ticks += PERIOD;
            let _ = acquisition.edge(converters, &mut synchronise, used, ticks);
        }
        follower.bus().convert([0.1, 0.2, 0.3]);
        let mut own = adxl355::REQUEST;
        let (data, rest) = own.split_at_mut(adxl355::DATA_BYTES);
        for frame in [data, rest] {
            let exchange = &mut [Operation::TransferInPlace(frame)];
            assert!(follower.bus().transaction(exchange).is_ok());
        }
        let frames = chips.each_mut().map(|chip| chip.bus().last);
        let [a, b, c, d] = &frames;
        let lanes = Recorded([a, b, c, d, &own]);
        let [a, b, c, d] = &mut chips;
        let mut converters: [&mut dyn Converter; CHIPS + 1] = [a, b, c, d, &mut follower];
        let mut counts = [0; INPUTS];
        let mut good = true;
        let mut sample = |ticks: u64, counts: Option<&mut [i32; INPUTS]>| {
            let edge = Edge {
                ready: used,
                at: ticks,
                is_merged: false,
            };
            let conversion = black_box(Conversion {
                edge,
                read: used,
                failed: 0,
            });
            let sample = acquire(
                &mut acquisition,
                &mut converters,
                &mut synchronise,
                &conversion,
                &lanes,
                false,
            );
            let sample = black_box(sample);
            good &= sample.is_some_and(|s| s.health.first() == Some(&Health::GOOD));
            let first = sample.and_then(|s| s.counts.first_chunk());
            if let (Some(first), Some(counts)) = (first, counts) {
                *counts = *first;
            }
        };
        let cost = cost(timer, |_| {
            ticks += PERIOD;
            sample(ticks, None);
        });
        sample(ticks + PERIOD, Some(&mut counts));
        // A cost of zero shows that the samples were not good.
        (if good { cost } else { 0 }, counts)
    }

    /// Counts of all inputs to SI, with the watch over them.
    fn calibration(timer: &TIM2, counts: &[i32]) -> u32 {
        let watch = Watch::new(Limits::CONVERTER, 4096.0);
        let scale = Scale::new(1e-6, 12.0).unwrap_or(Scale::ONE);
        let mut channels = [Channel::watched(scale, watch); INPUTS];
        cost(timer, |round| {
            for (channel, count) in channels.iter_mut().zip(counts) {
                let _ = black_box(channel.count(count ^ round as i32, Health::GOOD));
            }
        })
    }

    /// Equations (4) and (5): so many sensors to twelve resultants.
    fn resultants<const SENSORS: usize>(timer: &TIM2) -> u32 {
        // A third load cells, at places and in directions that are no other's.
        let sensors = (0..SENSORS).filter_map(|k| {
            let (x, y, z) = (0.1 * (k % 4) as f64, 0.1 * (k / 4) as f64, 0.01 * k as f64);
            let (position, direction) = (Vector3::new(x, y, z), Vector3::new(y + 0.1, z, x - 0.2));
            match k % 3 {
                0 => LoadCell::new(position, direction, Quantity::Force)
                    .map(RunSensor::LoadCell)
                    .ok(),
                _ => Accelerometer::new(position, direction, Mount::Interface)
                    .map(|sensor| RunSensor::Accelerometer(sensor, 1.0))
                    .ok(),
            }
        });
        let geometry = RunGeometry::new(sensors, &Placement::default(), &Vector3::zeros());
        let Ok(RunGeometry { map, .. }) = geometry else {
            return 0;
        };
        let sample: [f32; SENSORS] = core::array::from_fn(|k| 0.1 * k as f32);
        cost(timer, |_| {
            black_box(map.apply(black_box(&sample)));
        })
    }

    /// A sample of drive and resultants into the history, on average; and a block: the transforms
    /// of thirteen channels, with powers, cross powers and coherences of 100 lines.
    fn spectra(timer: &TIM2, storage: &mut [f32], sums: &mut [Sum]) -> (u32, u32) {
        let settings = BlockSettings::new(1024, 0.5, Window::Hann, 512.0, [0.5, 50.0]);
        let mut work = [NOTHING; 256];
        let rings = settings.and_then(|s| Rings::new(s, 1 + RESULTANTS, storage));
        let (Ok(lines), Ok(mut rings)) = (settings, rings) else {
            return (0, 0);
        };
        // A block is transformed when it is complete.
        let mut complete = false;
        for number in 0..4096_u64 {
            let noise = |c: usize| (mix(number ^ (c as u64) << 40) >> 40) as f32;
            complete = rings.push(storage, &core::array::from_fn::<f32, 13, _>(noise));
            if complete && number > 3000 {
                break;
            }
        }
        let (mut drive, mut response) = ([NOTHING; LINES], [NOTHING; LINES]);
        let block = cost(timer, |_| {
            let Ok(mut average) = DriveAverage::resume(LINES, RESULTANTS, sums, 8) else {
                return;
            };
            rings.transform(0, storage, &mut work, &mut drive);
            average.add_drive(&drive);
            for c in 0..RESULTANTS {
                rings.transform(1 + c, storage, &mut work, &mut response);
                average.add_response(c, &drive, &response);
            }
            let Ok(band) = lines.grid().within([0.5, 14.5]) else {
                return;
            };
            for c in 0..RESULTANTS {
                black_box(average.mean_coherence(c, band));
            }
        });
        let sample: [f32; 1 + RESULTANTS] = core::array::from_fn(|c| c as f32);
        // Whole periods of the decimation.
        let decimation = cost(timer, |_| {
            rings.push(storage, black_box(&sample));
        });
        (decimation, if complete { block } else { 0 })
    }

    const COMPARED: usize = 12;

    /// A hop of 512 samples of twelve channels, from samples to the sums of 64 lines, in instructions:
    /// the job of the comparison with other libraries in the firmware's README. The average is referred
    /// to the first channel, or has the products of all with all.
    #[inline(never)] // Its lines are off the stack again.
    fn hop<A: Average>(
        timer: &TIM2,
        settings: BlockSettings,
        (history, work): (&mut [f32], &mut [Complex32]),
        average: Result<A, SpectraError>,
    ) -> u32 {
        let mut lines = [NOTHING; COMPARED * 64];
        let blocks = Blocks::new(settings, COMPARED, history, work, &mut lines);
        let (Ok(mut blocks), Ok(mut average)) = (blocks, average) else {
            return 0;
        };
        let mut noise = [[0.0; COMPARED]; 8];
        for (n, x) in noise.as_flattened_mut().iter_mut().enumerate() {
            *x = (mix(n as u64) >> 40) as f32;
        }
        let mut take = |times: usize| {
            for _ in 0..times {
                for sample in black_box(&noise) {
                    if let Some(block) = blocks.push(sample) {
                        average.add(&block);
                    }
                }
            }
        };
        take(4096 / noise.len());
        let cost = cost(timer, |_| take(512 / noise.len()));
        // Each of those hops had its block.
        if average.blocks() >= 64 + 6 { cost } else { 0 }
    }
}
