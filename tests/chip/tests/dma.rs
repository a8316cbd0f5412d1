//! The modelled streams of DMA: what they move, and what they refuse (RM0090, 10).

use std::sync::Arc;

use massline_chip::Moment;
use massline_chip::dma::Dma;
use massline_chip::rcc::Clocks;
use rsemu::core::space::RamStore;

const CLOCKS: Clocks = Clocks {
    core: 168_000_000,
    apb1: 42_000_000,
    apb2: 84_000_000,
    timers1: 84_000_000,
    timers2: 168_000_000,
    divided_crystal: None,
};

/// Offsets of the flags of streams 0 to 3 and of their clearing, and of the registers of stream 3.
const LISR: u32 = 0x00;
const LIFCR: u32 = 0x08;
const CR: u32 = 0x58;
const NDTR: u32 = 0x5C;
const PAR: u32 = 0x60;
const M0AR: u32 = 0x64;
const FCR: u32 = 0x6C;
/// Flags of stream 3.
const COMPLETE: u32 = 1 << 27;
const HALF: u32 = 1 << 26;
const ERROR: u32 = 1 << 25;

const ON: u32 = 1;
/// Bytes from the peripheral, with the memory's address going on and an interrupt at the end.
const RECEIVE: u32 = 1 << 10 | 1 << 4;
const SPI2: u32 = 0x4000_380C;
const MEMORY: u32 = 0x2000_6000;

struct Bench {
    dma: Dma,
    memory: Arc<RamStore>,
    forbidden: Vec<String>,
}

impl Bench {
    fn new() -> Self {
        let memory = Arc::new(RamStore::new(128 << 10));
        Self {
            dma: Dma::new(1, Arc::clone(&memory)),
            memory,
            forbidden: Vec::new(),
        }
    }

    fn write(&mut self, register: u32, value: u32) {
        let mut at = Moment {
            now: 0,
            clocks: CLOCKS,
            forbidden: &mut self.forbidden,
        };
        self.dma.write(register, value, &mut at);
    }

    /// Begins to receive so many items on stream 3.
    fn begin(&mut self, cr: u32, peripheral: u32, memory: u32, items: u32) {
        for (register, value) in [
            (PAR, peripheral),
            (M0AR, memory),
            (NDTR, items),
            (CR, cr | ON),
        ] {
            self.write(register, value);
        }
    }

    /// SPI2 has received a byte: `false` if no stream takes it.
    fn receive(&mut self, byte: u8) -> bool {
        let mut at = Moment {
            now: 0,
            clocks: CLOCKS,
            forbidden: &mut self.forbidden,
        };
        self.dma.take(2, 8, || byte.into(), &mut at)
    }

    fn asks(&self) -> bool {
        self.dma
            .interrupts()
            .any(|(number, asks)| number == 14 && asks)
    }

    fn bytes(&self) -> [u8; 5] {
        let mut bytes = [0; 5];
        self.memory
            .read_at(u64::from(MEMORY) - 0x2000_0000, &mut bytes)
            .unwrap();
        bytes
    }
}

#[test]
fn a_stream_moves_its_items_and_asks_for_its_interrupt() {
    let mut bench = Bench::new();
    bench.begin(RECEIVE, SPI2, MEMORY, 4);
    for byte in 1..=4 {
        assert!(!bench.asks());
        assert!(bench.receive(byte));
        let half = if byte >= 2 { HALF } else { 0 };
        assert_eq!(bench.dma.read(LISR) & HALF, half);
        assert_eq!(bench.dma.read(NDTR), 4 - u32::from(byte));
    }
    assert!(bench.asks());
    assert!(!bench.receive(5), "it has ended");
    assert_eq!(bench.bytes(), [1, 2, 3, 4, 0]);
    assert_eq!((bench.dma.read(CR) & ON, bench.dma.moved()[3]), (0, 4));
    bench.write(LIFCR, COMPLETE);
    assert!(!bench.asks());
    assert_eq!(bench.dma.read(LISR), HALF);
    assert_eq!(bench.forbidden, Vec::<String>::new());
}

#[test]
fn a_stream_that_is_switched_off_says_that_it_is_complete() {
    let mut bench = Bench::new();
    bench.begin(RECEIVE, SPI2, MEMORY, 4);
    bench.receive(1);
    bench.write(CR, RECEIVE);
    assert_eq!(bench.dma.read(LISR) & COMPLETE, COMPLETE);
    assert!(!bench.receive(2));
    assert_eq!(bench.forbidden, Vec::<String>::new());
}

#[test]
fn what_the_manual_forbids_is_refused() {
    /// Channel 1, the other direction, 16 bits of memory, the peripheral's address going on.
    const CHANNEL_1: u32 = 1 << 25;
    const SEND: u32 = 1 << 6;
    const WIDE_MEMORY: u32 = 1 << 13;
    const GOES_ON: u32 = 1 << 9;
    for (cr, peripheral, memory, items, words) in [
        (RECEIVE, SPI2, 0x1000_0000, 4, "does not reach"),
        (RECEIVE, SPI2, 0x2001_FFFE, 4, "does not reach"),
        (RECEIVE, SPI2, 0x0800_0000, 4, "does not reach"),
        (
            RECEIVE | CHANNEL_1,
            SPI2,
            MEMORY,
            4,
            "a channel without a request",
        ),
        (RECEIVE, 0x4000_3C0C, MEMORY, 4, "another data register"),
        (RECEIVE | SEND, SPI2, MEMORY, 4, "the other direction"),
        (RECEIVE | WIDE_MEMORY, SPI2, MEMORY, 4, "two sizes"),
        (
            RECEIVE | GOES_ON,
            SPI2,
            MEMORY,
            4,
            "leaves the data register",
        ),
        (RECEIVE, SPI2, MEMORY, 0, "without items"),
    ] {
        let mut bench = Bench::new();
        bench.begin(cr, peripheral, memory, items);
        let found = &bench.forbidden;
        assert!(
            found.len() == 1 && found[0].contains(words),
            "{words}: {found:?}"
        );
        let is_error = words == "does not reach";
        assert_eq!(bench.dma.read(LISR) & ERROR != 0, is_error, "{words}");
        assert!(!bench.receive(1), "{words}");
    }
}

#[test]
fn registers_and_flags_have_their_time() {
    let mut bench = Bench::new();
    bench.begin(RECEIVE, SPI2, MEMORY, 1);
    for register in [NDTR, PAR, M0AR, FCR] {
        bench.write(register, 1);
        assert!(bench.forbidden.pop().unwrap().contains("while it is on"));
    }
    bench.write(CR, RECEIVE | ON | 1 << 9);
    assert!(
        bench
            .forbidden
            .pop()
            .unwrap()
            .contains("set up while it is on")
    );
    assert!(bench.receive(1));
    // Complete, and not cleared.
    bench.begin(RECEIVE, SPI2, MEMORY, 1);
    assert!(bench.forbidden.pop().unwrap().contains("flags set"));
    assert!(!bench.receive(2));
    bench.write(LIFCR, u32::MAX);
    bench.begin(RECEIVE, SPI2, MEMORY, 1);
    assert!(bench.receive(2));
    assert_eq!(bench.forbidden, Vec::<String>::new());
}
