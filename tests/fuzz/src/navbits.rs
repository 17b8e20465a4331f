//! Pieces of navigation messages. Random bytes seldom get check bits right, so many pieces come without, from a receiver that
//! vouches for them.

use cofix_common::formats::navbits::{
    BeidouAssembler, FnavAssembler, GlonassAssembler, GlonassClock, GlonassLabel, GlonassName, InavAssembler,
    LnavAssembler, ReceiverCheck, Refused,
};
use cofix_common::gnss::{Constellation, SatelliteId};
use cofix_common::orbit::KeplerEphemeris;
use cofix_common::time::GpsTime;

use crate::checks;

const SUBFRAME_BYTES: usize = 40;
const INAV_BYTES: usize = 29;
const FNAV_BYTES: usize = 30;
const STRING_BYTES: usize = 11;

/// All assemblers.
#[derive(Default)]
struct Assemblers {
    lnav: LnavAssembler,
    inav: InavAssembler,
    fnav: FnavAssembler,
    beidou: BeidouAssembler,
    glonass: GlonassAssembler,
}

/// What is said of a piece.
#[derive(Clone, Copy)]
struct Head {
    number: u8,
    kind: u8,
    hours: u8,
    now: GpsTime,
    check: ReceiverCheck,
}

/// The first two bytes are the GPS week. Each piece has three bytes before it: satellite; kind and check; hour of the week.
/// The kind's bits, from the lowest: I/NAV instead of LNAV; no word of the receiver; check bits left; QZSS; and in the high
/// half 1 for BeiDou, 2 for F/NAV, 3 for GLONASS, 4 for GLONASS by channel.
pub fn navbits(bytes: &[u8]) {
    let mut assemblers = Assemblers::default();
    let Some((week, mut rest)) = bytes.split_first_chunk::<2>() else { return };
    let week = i64::from(u16::from_be_bytes(*week) % 4096);
    while let Some(([number, kind, hours], after)) = rest.split_first_chunk::<3>() {
        let now = GpsTime::from_week_tow(week, 3_600.0 * f64::from(*hours));
        let check = if kind & 2 == 0 { ReceiverCheck::Passed } else { ReceiverCheck::Unknown };
        let head = Head { number: *number, kind: *kind, hours: *hours, now, check };
        let (piece, after) = after.split_at(head.length().min(after.len()));
        rest = after;
        let mut piece = piece.to_vec();
        if kind & 4 == 0 {
            head.blank(&mut piece);
        }
        assemblers.take(head, &piece);
    }
    let terms = [assemblers.lnav.system().klobuchar, assemblers.beidou.klobuchar()];
    for terms in terms.into_iter().flatten() {
        assert!(terms.alpha.iter().chain(&terms.beta).all(|term| term.is_finite()), "{terms:?}");
    }
}

impl Head {
    const fn length(self) -> usize {
        match (self.kind >> 4, self.kind & 1) {
            (1, _) | (0 | 5.., 0) => SUBFRAME_BYTES,
            (2, _) => FNAV_BYTES,
            (3 | 4, _) => STRING_BYTES,
            _ => INAV_BYTES,
        }
    }

    /// Takes the check bits out.
    fn blank(self, piece: &mut [u8]) {
        match (self.kind >> 4, self.kind & 1) {
            (1, _) => {
                piece.iter_mut().skip(7).step_by(4).for_each(|byte| *byte = 0);
                piece.iter_mut().skip(3).take(1).for_each(|byte| *byte &= 0xf0);
            }
            (2, _) => (214..238).for_each(|bit| clear(piece, bit)),
            (3 | 4, _) => (77..88).for_each(|bit| clear(piece, bit)),
            (_, 0) => piece.iter_mut().skip(3).step_by(4).for_each(|byte| *byte &= 0xc0),
            _ => (196..220).for_each(|bit| clear(piece, bit)),
        }
    }

    fn satellite(self, constellation: Constellation, last: u8) -> SatelliteId {
        SatelliteId::new(constellation, self.number % last + 1)
    }
}

impl Assemblers {
    fn take(&mut self, head: Head, piece: &[u8]) {
        let Head { kind, check, now, .. } = head;
        given(match (kind >> 4, kind & 1) {
            (1, _) => self.beidou.subframe(head.satellite(Constellation::Beidou, 63), piece, check, now),
            (2, _) => self.fnav.page(head.satellite(Constellation::Galileo, 36), piece, check, now),
            (3 | 4, _) => return self.glonass_string(head, piece),
            (_, 0) => {
                let system = if kind & 8 == 0 { Constellation::Gps } else { Constellation::Qzss };
                self.lnav.subframe(head.satellite(system, 36), piece, check, now)
            }
            _ => self.inav.page(head.satellite(Constellation::Galileo, 36), piece, check, now),
        });
    }

    fn glonass_string(&mut self, head: Head, piece: &[u8]) {
        let name = match head.kind >> 4 {
            3 => GlonassName::Slot(head.number % 24 + 1),
            _ => GlonassName::Channel((head.number % 14).cast_signed() - 7),
        };
        let string = piece.first().map(|byte| byte >> 3 & 15);
        let label = GlonassLabel { name, frame: i64::from(head.hours), string, receiver: head.check };
        match self.glonass.string(label, piece, GlonassClock { now: head.now, leap_seconds: 18 }) {
            Ok(Some(message)) => {
                let ephemeris = message.on_channel(message.channel().unwrap_or(0));
                assert_eq!(message.slot(), ephemeris.satellite.number);
                checks::glonass(&ephemeris);
            }
            Ok(None) => {}
            Err(refused) => named(&refused),
        }
    }
}

fn clear(bytes: &mut [u8], bit: usize) {
    if let Some(byte) = bytes.get_mut(bit / 8) {
        *byte &= !(0x80 >> (bit % 8));
    }
}

fn given(result: Result<Option<KeplerEphemeris>, Refused>) {
    match result {
        Ok(Some(ephemeris)) => checks::kepler(&ephemeris),
        Ok(None) => {}
        Err(refused) => named(&refused),
    }
}

fn named(refused: &Refused) {
    assert!(!refused.detail.is_empty());
}
