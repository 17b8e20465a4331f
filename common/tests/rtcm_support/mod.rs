//! What the tests of RTCM streams share.

#![allow(dead_code)] // not every test uses everything

pub mod dates;
pub mod legacy;

use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::rtcm::{RtcmDecoder, RtcmOptions};
use cofix_common::skips::Skips;
use rtcm_rs::msg::Msg1019T;
use rtcm_rs::{Message, MessageBuilder};

/// A Thursday, second 397193 of week 2118.
pub const NOW: &str = "2020-08-13T14:19:53";
pub const TOW_MS: u32 = 397_193_000;

/// A message as a frame.
pub fn frame(message: &Message) -> Vec<u8> {
    MessageBuilder::new().build_message(message).unwrap().to_vec()
}

/// The beginning of a message: its number.
pub fn number(number: u16) -> [u8; 2] {
    (number << 4).to_be_bytes()
}

/// A frame of any content.
pub fn frame_of(content: &[u8]) -> Vec<u8> {
    let length = u16::try_from(content.len()).unwrap().to_be_bytes();
    let mut frame = [&[0xd3][..], &length, content].concat();
    let mut crc = 0_u32;
    for byte in &frame {
        crc ^= u32::from(*byte) << 16;
        for _ in 0..8 {
            crc = if crc & 0x80_0000 == 0 { crc << 1 } else { crc << 1 ^ 0x186_4cfb };
        }
    }
    frame.extend_from_slice(&crc.to_be_bytes()[1..]);
    frame
}

/// Writes bit fields, first bit first.
#[derive(Clone, Default)]
pub struct Writer(Vec<bool>);

impl Writer {
    /// The lowest bits of a number.
    pub fn unsigned(mut self, width: u32, value: u64) -> Self {
        self.0.extend((0..width).rev().map(|bit| value >> bit & 1 == 1));
        self
    }

    /// A number in two's complement.
    pub fn twos_complement(self, width: u32, value: i64) -> Self {
        self.unsigned(width, value.cast_unsigned())
    }

    /// A sign and a magnitude.
    pub fn signed(self, width: u32, value: i64) -> Self {
        self.unsigned(1, u64::from(value < 0)).unsigned(width - 1, value.unsigned_abs())
    }

    /// The bits as a frame, filled up with zeros.
    pub fn frame(self) -> Vec<u8> {
        let bytes: Vec<u8> = self
            .0
            .chunks(8)
            .map(|bits| {
                bits.iter().enumerate().fold(0, |sum, (place, bit)| sum | u8::from(*bit) << (7 - place))
            })
            .collect();
        frame_of(&bytes)
    }
}

/// Everything that comes out of portions of a stream.
pub fn decode(portions: &[&[u8]]) -> (Vec<Record>, Skips) {
    let mut decoder = RtcmDecoder::new(RtcmOptions::near(NOW.parse().unwrap()));
    let mut records = Vec::new();
    for portion in portions {
        let outcome = decoder.feed(portion);
        records.extend(std::iter::from_fn(|| decoder.next_record()));
        if outcome.is_err() {
            return (records, decoder.skips().clone());
        }
    }
    let _ = decoder.finish();
    records.extend(std::iter::from_fn(|| decoder.next_record()));
    (records, decoder.skips().clone())
}

/// A GPS ephemeris.
pub fn lnav() -> Msg1019T {
    Msg1019T {
        gps_satellite_id: 7,
        gps_week_number: 2118 % 1024,
        ura_index: 2,
        idot_sc_s: -1.5e-10,
        iode: 58,
        toc_s: 396_000.0,
        af2_s_s2: 0.0,
        af1_s_s: 7.048_584e-12,
        af0_s: -1.604_342_833_161e-5,
        iodc: 0x23a,
        crs_m: -39.6875,
        delta_n_sc_s: 1.37e-9,
        m0_sc: -0.2,
        cuc_rad: -2.177_432e-6,
        eccentricity: 0.010_003_942_297,
        cus_rad: 1.937_151e-6,
        sqrt_a_sqrt_m: 5_153.707_128_525,
        toe_s: 396_000.0,
        cic_rad: -1.508_743e-7,
        omega0_sc: 0.8189,
        cis_rad: 1.359_731e-7,
        i0_sc: 0.312,
        crc_m: 353.968_75,
        omega_sc: -0.2527,
        omegadot_sc_s: -2.669e-9,
        tgd_s: 5.122_274e-9,
        sv_health_ind: 0,
        ..Msg1019T::default()
    }
}
