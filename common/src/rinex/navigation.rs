//! RINEX 3.0x navigation files.

use super::header::{leap_seconds, version};
use super::navigation_record::{Record, ephemeris};
use super::{RinexError, columns, decompress, lines, real, shorten};
use crate::atmosphere::KlobucharCoefficients;
use crate::gnss::Constellation;
use crate::orbit::KeplerEphemeris;
use crate::skips::Skips;
use crate::time::GpsTime;

/// Ionosphere terms of a navigation header, per system.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct IonosphereTerms {
    /// GPSA and GPSB: Klobuchar (IS-GPS-200, 20.3.3.5.2.5).
    pub gps: Option<KlobucharCoefficients>,
    /// BDSA and BDSB: BeiDou's Klobuchar variant, in geographic coordinates (BDS-SIS-ICD-B1I, 5.2.4.7).
    pub beidou: Option<KlobucharCoefficients>,
    /// GAL: NeQuick-G effective ionisation a0 (sfu), a1 (sfu/deg), a2 (sfu/deg²).
    pub galileo: Option<[f64; 3]>,
}

/// A whole navigation file.
#[derive(Clone, Debug, PartialEq)]
pub struct NavigationFile {
    /// GPS, QZSS, Galileo and BeiDou ephemerides in order of transmission. A group delay that the file does
    /// not give is NaN.
    pub ephemerides: Vec<KeplerEphemeris>,
    /// Ionosphere terms.
    pub ionosphere: IonosphereTerms,
    /// Seconds that GPS time is ahead of UTC.
    pub leap_seconds: Option<i64>,
    /// What was skipped.
    pub skips: Skips,
}

impl NavigationFile {
    /// Reads a whole file, plain or gzip-compressed.
    ///
    /// # Errors
    /// When the compression is damaged or the header is not that of a RINEX 3.0x navigation file; damaged
    /// records are counted in [`NavigationFile::skips`].
    pub fn parse(bytes: &[u8]) -> Result<Self, RinexError> {
        let bytes = decompress(bytes)?;
        let mut lines = lines(&bytes);
        let header = Header::read(&mut lines)?;
        let mut reader = Reader::default();
        for (number, line) in lines {
            reader.line(number, line);
        }
        reader.record_done();
        // Of messages that differ in health alone the unhealthy one comes last, and so will be in force.
        reader.found.sort_by(|(a, x), (b, y)| a.cmp(b).then(x.health.total_cmp(&y.health)));
        Ok(Self {
            ephemerides: reader.found.into_iter().map(|(_, ephemeris)| ephemeris).collect(),
            ionosphere: header.terms(),
            leap_seconds: header.leap_seconds,
            skips: reader.skips,
        })
    }
}

/// What the header gives.
#[derive(Default)]
struct Header {
    leap_seconds: Option<i64>,
    gpsa: Option<[f64; 4]>,
    gpsb: Option<[f64; 4]>,
    bdsa: Option<[f64; 4]>,
    bdsb: Option<[f64; 4]>,
    galileo: Option<[f64; 3]>,
}

impl Header {
    fn read<'a>(lines: &mut impl Iterator<Item = (u64, &'a [u8])>) -> Result<Self, RinexError> {
        let mut header = Self::default();
        let mut count = 0;
        for (number, line) in lines {
            let label = columns(line, 60, 80).trim_ascii();
            count = number;
            if number == 1 {
                version(number, line, label, b'N', "navigation")?;
                continue;
            }
            match label {
                b"END OF HEADER" => return Ok(header),
                b"LEAP SECONDS" => header.leap_seconds = leap_seconds(line),
                b"IONOSPHERIC CORR" => header.ionosphere(line),
                _ => {}
            }
        }
        Err(RinexError::HeaderIncomplete { lines: count })
    }

    /// Takes an ionosphere line; of several for one system the first counts.
    fn ionosphere(&mut self, line: &[u8]) {
        let at = |k: usize| real(columns(line, 5 + 12 * k, 17 + 12 * k));
        let three = || Some([at(0)?, at(1)?, at(2)?]);
        let four = || Some([at(0)?, at(1)?, at(2)?, at(3)?]);
        let slot = match columns(line, 0, 4) {
            b"GPSA" => &mut self.gpsa,
            b"GPSB" => &mut self.gpsb,
            b"BDSA" => &mut self.bdsa,
            b"BDSB" => &mut self.bdsb,
            b"GAL " => {
                self.galileo = self.galileo.or_else(three);
                return;
            }
            _ => return,
        };
        *slot = slot.or_else(four);
    }

    fn terms(&self) -> IonosphereTerms {
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

/// Collects records: a line that begins with a letter begins a record, one that begins with a blank continues
/// it. Records of any length stay in step that way.
#[derive(Default)]
struct Reader {
    record: Option<Record>,
    found: Vec<(GpsTime, KeplerEphemeris)>,
    skips: Skips,
}

impl Reader {
    fn line(&mut self, number: u64, line: &[u8]) {
        match line.first() {
            None => {}
            Some(b' ') => match &mut self.record {
                Some(record) => record.continuation(line),
                None if line.iter().all(|b| *b == b' ') => {}
                None => self
                    .skips
                    .add("line outside any record", || format!("line {number}: '{}'", shorten(line))),
            },
            Some(_) => {
                self.record_done();
                self.record = self.begin(number, line);
            }
        }
    }

    fn begin(&mut self, number: u64, line: &[u8]) -> Option<Record> {
        let record = Record::begin(number, line);
        if record.is_none() {
            self.skips
                .add("record without satellite or epoch", || format!("line {number}: '{}'", shorten(line)));
        }
        record
    }

    fn record_done(&mut self) {
        let Some(record) = self.record.take() else { return };
        let (line, satellite) = (record.line, record.satellite);
        let reason = match satellite.constellation {
            Constellation::Glonass => "GLONASS record (not supported)",
            Constellation::Sbas => "SBAS record (not supported)",
            Constellation::Navic => "NavIC record (not supported)",
            _ => match ephemeris(&record) {
                Ok(found) => return self.found.push(found),
                Err(fault) => {
                    return self
                        .skips
                        .add(fault.reason, || format!("line {line}: {satellite}: {}", fault.detail));
                }
            },
        };
        self.skips.add(reason, || format!("line {line}: {satellite}"));
    }
}
