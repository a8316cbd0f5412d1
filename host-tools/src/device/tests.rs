//! The client against the box in this program, over good and bad lines.

use super::*;
use massline_firmware::wire::{Event, Request, Setting, SettingKey, Storage};
use std::time::Duration;

/// Three frames in ten suffer, each way.
const BAD: Noise = Noise {
    corrupted: 0.1,
    truncated: 0.1,
    duplicated: 0.1,
};

#[test]
fn says_who_it_is() {
    let (mut memory, mut own) = (ClientMemory::new(), HostBoxMemory::new());
    let mut client = Client::new(HostBox::new(&mut own, 1), &mut memory);
    let info = client.hello().unwrap();
    assert_eq!(
        (&*info.firmware, &*info.chip),
        ("massline", "this computer")
    );
    assert_eq!(info.storage, Storage::Volatile);
    assert_eq!(client.link().resent, 0);
}

#[test]
fn settings_hold_and_are_checked() {
    let (mut memory, mut own) = (ClientMemory::new(), HostBoxMemory::new());
    let mut client = Client::new(HostBox::new(&mut own, 1), &mut memory);
    let write = |name| Request::WriteSetting(Setting::Name(name));
    client.tell(&write("table 7")).unwrap();
    let read = client.ask(
        &Request::ReadSetting(SettingKey::Name),
        |reply| match reply {
            massline_firmware::wire::Reply::Setting(Setting::Name(name)) => {
                Some((*name).to_owned())
            }
            _ => None,
        },
    );
    assert_eq!(read.unwrap(), "table 7");
    let error = client.tell(&write(&"x".repeat(33))).unwrap_err();
    assert!(matches!(error, ClientError::Refused(_)), "{error}");
}

#[test]
fn ten_thousand_frames_over_a_bad_line_are_answered_right_and_counted_to_the_frame() {
    let (mut memory, mut own) = (ClientMemory::new(), HostBoxMemory::new());
    let line = NoisyLine::new(HostBox::new(&mut own, 1), BAD, 20261121);
    let mut client = Client::new(line, &mut memory);
    for stamp in 0..10_000 {
        assert_eq!(client.ping(stamp).unwrap().stamp, stamp);
    }
    // What was lost last shows with the next frame that arrives.
    client.port().set_noise(Noise::default());
    client.ping(0).unwrap();
    let link = client.link();
    let (from_box, to_box) = (*client.port().from_box(), *client.port().to_box());
    assert!(to_box.frames > 10_000 && to_box.lost() > 1000, "{to_box:?}");
    assert_eq!(link.received.lost, from_box.lost());
    assert_eq!(u64::from(link.received.duplicates), from_box.duplicated);
    assert_eq!(u64::from(link.sent), to_box.frames);
    let heard = *client.port().port().link();
    assert_eq!(heard.lost, to_box.lost());
    assert_eq!(u64::from(heard.duplicates), to_box.duplicated);
    assert_eq!(u64::from(client.port().port().produced()), from_box.frames);
}

#[test]
fn a_box_that_says_nothing_is_called_silent() {
    let (mut memory, mut own) = (ClientMemory::new(), HostBoxMemory::new());
    let deaf = Noise {
        corrupted: 1.0,
        ..Noise::default()
    };
    let line = NoisyLine::new(HostBox::new(&mut own, 1), deaf, 1);
    let mut client = Client::new(line, &mut memory);
    let error = client.hello().unwrap_err();
    assert!(matches!(error, ClientError::Silent { heard: false, .. }));
    assert!(error.to_string().contains("--baud"), "{error}");
}

/// A line that is plugged over to another box at some time.
struct Plugged<A, B> {
    before: A,
    after: B,
    sends: u32,
}

impl<A: Port, B: Port> Port for Plugged<A, B> {
    fn name(&self) -> String {
        self.before.name()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.sends += 1;
        if self.sends > 1 {
            self.after.send(bytes)
        } else {
            self.before.send(bytes)
        }
    }

    fn receive(&mut self, into: &mut Vec<u8>, timeout: Duration) -> Result<usize, PortError> {
        if self.sends > 1 {
            self.after.receive(into, timeout)
        } else {
            self.before.receive(into, timeout)
        }
    }

    fn patience(&self) -> Duration {
        self.before.patience()
    }
}

#[test]
fn a_box_that_has_started_anew_is_told_from_a_silent_one() {
    let (mut first, mut second) = (HostBoxMemory::new(), HostBoxMemory::new());
    let mut memory = ClientMemory::new();
    let port = Plugged {
        before: HostBox::new(&mut first, 1),
        after: HostBox::new(&mut second, 2),
        sends: 0,
    };
    let mut client = Client::new(port, &mut memory);
    client.on_event(|event, _| assert!(matches!(event, Event::Started(_)), "{event:?}"));
    client.hello().unwrap();
    // Either a frame of the new session comes before the reply, or the reply is the first.
    match client.status() {
        Ok(status) => assert_eq!(status.fingerprint, None),
        Err(error) => assert!(matches!(error, ClientError::Restarted { .. }), "{error}"),
    }
    assert_eq!(client.link().received.restarts, 1);
}
