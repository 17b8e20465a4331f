//! Header of a navigation file, and the ionosphere terms that RINEX 4 keeps among the records.

use super::navigation_record::Record;
use super::version::Version;
use super::{RinexError, label, leap_seconds};
use crate::atmosphere::KlobucharCoefficients;
use crate::formats::decimal::real;
use crate::formats::text::columns;
use crate::orbit::IonosphereTerms;

/// Name of the kind of files, for messages.
const NAVIGATION: &str = "navigation";

/// Entries of the header, and of the ionosphere records of RINEX 4.
#[derive(Clone, Debug, Default)]
pub(super) struct NavigationHeader {
    /// Version and type.
    pub(super) version: Version,
    /// Seconds that GPS time is ahead of UTC.
    pub(super) leap_seconds: Option<i64>,
    /// Lines taken.
    pub(super) lines: u64,
    gpsa: Option<[f64; 4]>,
    gpsb: Option<[f64; 4]>,
    bdsa: Option<[f64; 4]>,
    bdsb: Option<[f64; 4]>,
    galileo: Option<[f64; 3]>,
}

impl NavigationHeader {
    /// Takes a line; true when it was END OF HEADER.
    pub(super) fn line(&mut self, number: u64, line: &[u8]) -> Result<bool, RinexError> {
        self.lines += 1;
        if self.lines == 1 {
            self.version = Version::read(number, line, b"NGHE", NAVIGATION)?;
            return Ok(false);
        }
        match label(line).as_slice() {
            b"END OF HEADER" => return Ok(true),
            b"LEAP SECONDS" => self.leap_seconds = leap_seconds::header_line(line),
            b"IONOSPHERIC CORR" => self.ionosphere(line),
            b"ION ALPHA" => self.gpsa = self.gpsa.or(four(line, 2)),
            b"ION BETA" => self.gpsb = self.gpsb.or(four(line, 2)),
            _ => {}
        }
        Ok(false)
    }

    /// Takes the first line of another header. Ionosphere terms stay: of several the first count.
    pub(super) fn begin_again(&mut self, number: u64, line: &[u8]) -> Result<(), RinexError> {
        self.version = Version::read(number, line, b"NGHE", NAVIGATION)?;
        Ok(())
    }

    /// Takes an ionosphere line of RINEX 3; of several for one system the first counts.
    fn ionosphere(&mut self, line: &[u8]) {
        let slot = match columns(line, 0, 4) {
            b"GPSA" => &mut self.gpsa,
            b"GPSB" => &mut self.gpsb,
            b"BDSA" => &mut self.bdsa,
            b"BDSB" => &mut self.bdsb,
            b"GAL " => {
                let [a, b, c] = [0, 1, 2].map(|k| real(columns(line, 5 + 12 * k, 17 + 12 * k)));
                self.galileo = self.galileo.or_else(|| Some([a?, b?, c?]));
                return;
            }
            _ => return,
        };
        *slot = slot.or(four(line, 5));
    }

    /// Takes an ionosphere record of RINEX 4 (tables A30, A32); of several for one system the first counts. False when
    /// the model is another or a number is missing.
    pub(super) fn ionosphere_record(&mut self, system: u8, message: &[u8], record: &Record) -> bool {
        let at = |index: usize| record.value(index);
        let four = |from: usize| Some([at(from)?, at(from + 1)?, at(from + 2)?, at(from + 3)?]);
        let (alpha, beta) = (four(0), four(4));
        match (system, message) {
            (b'G', b"LNAV") => {
                self.gpsa = self.gpsa.or(alpha);
                self.gpsb = self.gpsb.or(beta);
                alpha.is_some() && beta.is_some()
            }
            (b'C', b"D1D2" | b"D1" | b"D2") => {
                self.bdsa = self.bdsa.or(alpha);
                self.bdsb = self.bdsb.or(beta);
                alpha.is_some() && beta.is_some()
            }
            (b'E', b"IFNV") => {
                let terms = alpha.map(|[a, b, c, _]| [a, b, c]);
                self.galileo = self.galileo.or(terms);
                terms.is_some()
            }
            _ => false,
        }
    }

    /// The ionosphere terms so far.
    pub(super) fn terms(&self) -> IonosphereTerms {
        let pair = |alpha: Option<[f64; 4]>, beta: Option<[f64; 4]>| {
            Some(KlobucharCoefficients { alpha: alpha?, beta: beta? })
        };
        IonosphereTerms {
            gps: pair(self.gpsa, self.gpsb),
            beidou: pair(self.bdsa, self.bdsb),
            galileo: self.galileo,
        }
    }
}

/// Four numbers of twelve columns.
fn four(line: &[u8], from: usize) -> Option<[f64; 4]> {
    let at = |k: usize| real(columns(line, from + 12 * k, from + 12 * k + 12));
    Some([at(0)?, at(1)?, at(2)?, at(3)?])
}
