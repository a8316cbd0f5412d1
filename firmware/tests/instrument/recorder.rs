//! The converters' samples on their way to a host: each arrives with its own number, counts
//! and faults, or not at all.

use crate::bench::{Bench, Heard, Recorded};
use massline_firmware::calibration::Preset;
use massline_firmware::models::random::Random;
use massline_firmware::wire::*;

fn subscription(samples: Stream) -> Request<'static> {
    Request::Subscribe(Subscription {
        samples,
        ..Subscription::default()
    })
}

/// A sample as it went in, or came out.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    number: u64,
    values: Vec<f64>,
    health: Vec<u16>,
}

/// Samples that came, in their order.
fn rows(events: Vec<Heard>) -> Vec<Row> {
    let mut rows = Vec::new();
    for event in events {
        let Heard::Recorded(Recorded {
            first,
            channels,
            health,
            values,
        }) = event
        else {
            continue;
        };
        for (number, values) in (first..).zip(values.chunks(channels)) {
            rows.push(Row {
                number,
                values: values.to_vec(),
                health: if health.is_empty() {
                    vec![0; channels]
                } else {
                    health.clone()
                },
            });
        }
    }
    rows
}

#[test]
fn every_sample_arrives_with_its_number_its_counts_and_its_faults() {
    for channels in [1, 13, 35, 48] {
        let mut bench = Bench::switch_on();
        bench.done(&subscription(Stream::Counts));
        let (mut random, mut number) = (Random::new(channels as u64), 5);
        let mut health = vec![Health::GOOD; channels];
        let mut sent = Vec::new();
        for _ in 0..3000 {
            // A gap now and then, and faults that come and go, all of them at times.
            number += if random.below(50) == 0 { 7 } else { 1 };
            if random.below(20) == 0 {
                let at = random.below(channels as u64) as usize;
                health[at] = Health(1 << random.below(16));
            }
            if random.below(40) == 0 {
                health.fill(Health::GOOD);
            }
            let counts = (0..channels).map(|_| random.bits() as i32 >> 8);
            let counts: Vec<i32> = counts.collect();
            bench.convert(number, &counts, &health);
            sent.push(Row {
                number,
                values: counts.iter().map(|&x| f64::from(x)).collect(),
                health: health.iter().map(|h| h.0).collect(),
            });
        }
        // The last ones come with the end of the subscription.
        bench.done(&subscription(Stream::Off));
        let events = bench.events();
        let good = |event: &&Heard| matches!(event, Heard::Recorded(r) if r.health.is_empty());
        let good = events.iter().filter(good).count();
        assert!(
            good > 10 && good < events.len(),
            "{good} of {}",
            events.len()
        );
        assert_eq!(rows(events), sent);
        bench.convert(number + 1, &[1; 3], &[]);
        bench.done(&subscription(Stream::Counts));
        bench.done(&subscription(Stream::Off));
        assert_eq!(bench.events(), [], "nobody listened");
    }
}

#[test]
fn readings_are_in_si_and_good_where_nobody_says_otherwise() {
    let mut bench = Bench::switch_on();
    let preset = Preset::iepe(0.01, 0.1, 500.0);
    let input = preset.input(1, "", "", None, 0.0);
    bench.done(&Request::WriteSetting(Setting::Input(input)));
    bench.done(&subscription(Stream::Readings));
    // As many as fit two messages of twelve values each, and one more.
    let fit = 840 / (4 * 12);
    for k in 0..=2 * fit {
        bench.convert(k as u64, &[1000; 12], &[]);
    }
    let events = bench.events();
    let si = f64::from(preset.per_count as f32 * 1000.0);
    let [Heard::Started, Heard::Recorded(a), Heard::Recorded(b)] = &events[..] else {
        panic!("{events:?}");
    };
    assert_eq!(
        (a.first, b.first, b.values.len()),
        (0, fit as u64, 12 * fit)
    );
    assert_eq!((&a.health, &b.health), (&vec![], &vec![]));
    let expected: Vec<f64> = (0..12).map(|c| if c == 1 { si } else { 1000.0 }).collect();
    assert!(a.values.chunks(12).all(|row| row == expected));
}

#[test]
fn counts_beyond_24_bits_stay_at_their_end() {
    let mut bench = Bench::switch_on();
    bench.done(&subscription(Stream::Counts));
    bench.convert(0, &[i32::MAX, i32::MIN, -1], &[]);
    bench.done(&subscription(Stream::Off));
    let rows = rows(bench.events());
    assert_eq!(rows[0].values, [8_388_607.0, -8_388_608.0, -1.0]);
}
