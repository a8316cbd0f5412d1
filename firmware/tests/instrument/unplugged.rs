//! The host is unplugged in the middle of a run: it goes on, and the results are there
//! when the host comes back.

use crate::bench::Said;
use crate::plan::ready;
use massline_firmware::models::setup::question;
use massline_firmware::wire::*;

#[test]
fn the_run_goes_on_and_its_results_wait() {
    let mut all = Vec::new();
    for unplug in [false, true] {
        let mut bench = ready();
        for run in 0..3 {
            bench.start(run, Source::Synthetic, Gaps::Count, Some(5000));
            for _ in 0..100 {
                assert!(bench.poll());
            }
            bench.host.unplugged = unplug;
            bench.work();
            bench.host.unplugged = false;
            // All that a host needs to take up the thread.
            let status = bench.status();
            assert_eq!((status.state, status.fingerprint), (State::Ready, Some(99)));
            assert_eq!(status.stored, (1 << (run + 1)) - 1);
            let summary = bench.summary(&Request::ReadSummary(run));
            assert_eq!((summary.outcome, summary.samples), (Outcome::Limit, 5000));
            all.push((summary, bench.lines(run)));
        }
        // Unplugged again while it works on the answer, which waits, too.
        let id = bench.send(&Request::Identify(question(
            Method::ApparentMass,
            Procedure::ITERATIVE,
            1,
        )));
        bench.host.unplugged = true;
        bench.work();
        bench.host.unplugged = false;
        assert!(bench.host.replies.is_empty(), "{id}");
        assert!(bench.status().answer);
        let Said::Identified(found) = bench.ask(&Request::ReadAnswer) else {
            panic!("no answer");
        };
        // The body that the box computes weighs 12 kg; Hann's window leaks what the
        // self-test's periodic blocks do not.
        let mass = found.answer.identification.mass.unwrap().value;
        assert!((mass - 12.0).abs() < 0.012, "{mass}");
    }
    let (plugged, unplugged) = all.split_at(3);
    assert_eq!(plugged, unplugged);
}
