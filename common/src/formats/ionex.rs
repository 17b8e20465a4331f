//! IONEX 1.0 files of ionosphere maps (Schaer, Gurtner, Feltens 1998: IONEX, The IONosphere Map EXchange Format Version 1).
//!
//! Maps of total electron content in a single layer are read. Maps of its standard deviation and of heights, and auxiliary data
//! (differential code biases), are passed over.

use crate::atmosphere::{Axis, Ionex, IonosphereMap, Shell};
use crate::formats::decimal::{integer, real};
use crate::formats::packing::{DecompressError, decompress};
use crate::formats::text::{columns, lines_of_content, shorten, text};
use crate::skips::{Reason, Skips};
use crate::time::leap_seconds_at;
use crate::time::{Calendar, GpsTime};

/// Value that means "missing".
const MISSING: i64 = 9_999;
/// Contents beyond this are not believed, TECU, of either sign: strong storms reach three hundred, and maps come a little below zero.
const MAX_TEC_TECU: f64 = 1_000.0;
/// Values in a line.
const VALUES_PER_LINE: usize = 16;
/// Most nodes of a map that are believed: a grid of half a degree.
const MAX_NODES: usize = 300_000;

/// Why an IONEX file cannot be read at all.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum IonexError {
    /// The first line is not that of an IONEX file of version 1.0.
    #[error("not an IONEX file of version 1.0 or 1.1: the first line reads '{found}'")]
    NotIonex {
        /// Its text, shortened.
        found: String,
    },
    /// A header line that is needed is missing or cannot be read.
    #[error("IONEX header: {label} is missing or cannot be read")]
    Header {
        /// Its label.
        label: &'static str,
    },
    /// More than one layer.
    #[error(
        "IONEX file with three-dimensional maps (HGT1 / HGT2 / DHGT: {heights}); only single layers are read"
    )]
    Layers {
        /// The heights as the header has them, km.
        heights: String,
    },
    /// No map.
    #[error("IONEX file without any TEC map in {lines} lines")]
    Empty {
        /// Lines read.
        lines: u64,
    },
    /// The gzip container is damaged or too large.
    #[error(transparent)]
    Decompress(#[from] DecompressError),
}

impl Ionex {
    /// Reads a whole file, plain or gzip-compressed.
    ///
    /// # Errors
    /// When the compression is damaged, the header cannot be used, maps have several layers, or there is no map; other damage is
    /// counted in [`Ionex::skips`].
    pub fn parse(bytes: &[u8]) -> Result<Self, IonexError> {
        let bytes = decompress(bytes)?;
        let mut lines = lines_of_content(&bytes);
        let (mut last, first) = lines.next().unwrap_or_default();
        let version = real(columns(first, 0, 8)).unwrap_or(0.0);
        let is_ionex = label(first) == b"IONEX VERSION / TYPE" && columns(first, 20, 21) == b"I";
        if !is_ionex || !(1.0..=1.1).contains(&version) {
            return Err(IonexError::NotIonex { found: shorten(first) });
        }
        let mut header = Header::default();
        let mut reader = None;
        for (number, line) in lines {
            last = number;
            match &mut reader {
                None if label(line) == b"END OF HEADER" => reader = Some(Reader::new(header.finish()?)),
                None => header.line(number, line),
                Some(reader) => reader.line(number, line),
            }
        }
        let Some(mut reader) = reader else { return Err(IonexError::Header { label: "END OF HEADER" }) };
        reader.finish(last);
        if reader.maps.is_empty() {
            return Err(IonexError::Empty { lines: last });
        }
        reader.maps.sort_by_key(IonosphereMap::time);
        header.skips.merge(&reader.skips);
        Ok(Self { maps: reader.maps, skips: header.skips })
    }
}

fn label(line: &[u8]) -> &[u8] {
    columns(line, 60, 80).trim_ascii()
}

/// Three numbers "first, last, step" in fields of six from column 3.
fn triple(line: &[u8]) -> Option<[f64; 3]> {
    let at = |k: usize| real(columns(line, 2 + 6 * k, 8 + 6 * k));
    Some([at(0)?, at(1)?, at(2)?])
}

/// Grid, shell and exponent of all maps of a file.
#[derive(Clone, Copy, Debug)]
struct Frame {
    shell: Shell,
    latitudes: Axis,
    longitudes: Axis,
    exponent: i32,
}

#[derive(Default)]
struct Header {
    base_radius_km: Option<f64>,
    heights_km: Option<[f64; 3]>,
    latitudes: Option<Axis>,
    longitudes: Option<Axis>,
    exponent: Option<i32>,
    skips: Skips,
}

impl Header {
    fn line(&mut self, number: u64, line: &[u8]) {
        match label(line) {
            b"BASE RADIUS" => self.base_radius_km = real(columns(line, 0, 8)),
            b"HGT1 / HGT2 / DHGT" => self.heights_km = triple(line),
            b"LAT1 / LAT2 / DLAT" => self.latitudes = triple(line).and_then(Axis::from_degrees),
            b"LON1 / LON2 / DLON" => self.longitudes = triple(line).and_then(Axis::from_degrees),
            b"EXPONENT" => self.exponent = exponent(line),
            b"MAPPING FUNCTION" => {
                let name = columns(line, 2, 6).trim_ascii();
                if !matches!(name, b"NONE" | b"COSZ" | b"QFAC" | b"") {
                    self.skips.add(Reason::IonexMappingFunctionUnknown, || {
                        format!("line {number}: '{}'", text(name))
                    });
                }
            }
            _ => {}
        }
    }

    fn finish(&self) -> Result<Frame, IonexError> {
        let missing = |label| IonexError::Header { label };
        let [height_km, top_km, step_km] = self.heights_km.ok_or(missing("HGT1 / HGT2 / DHGT"))?;
        if step_km != 0.0 || height_km != top_km {
            let heights = format!("{height_km} / {top_km} / {step_km} km");
            return Err(IonexError::Layers { heights });
        }
        let shell = self.base_radius_km.and_then(|radius_km| Shell::from_kilometres(radius_km, height_km));
        let latitudes = self.latitudes.filter(|axis| axis.stays_within(90.0));
        let longitudes = self.longitudes.filter(|axis| axis.stays_within(720.0));
        let frame = Frame {
            shell: shell.ok_or(missing("BASE RADIUS"))?,
            latitudes: latitudes.ok_or(missing("LAT1 / LAT2 / DLAT"))?,
            longitudes: longitudes.ok_or(missing("LON1 / LON2 / DLON"))?,
            exponent: self.exponent.unwrap_or(-1),
        };
        if frame.nodes() > MAX_NODES {
            return Err(missing("LON1 / LON2 / DLON"));
        }
        Ok(frame)
    }
}

/// The power of ten of the values; `None` when absurd.
fn exponent(line: &[u8]) -> Option<i32> {
    integer(columns(line, 0, 6)).and_then(|e| i32::try_from(e).ok()).filter(|e| (-10..=10).contains(e))
}

impl Frame {
    const fn nodes(&self) -> usize {
        self.latitudes.count().saturating_mul(self.longitudes.count())
    }
}

/// The part of the file that is being read.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    Between,
    /// A map of another quantity, or auxiliary data.
    Other,
    Map,
    /// Values of the parallel of this index; `None` for one that is not of the grid.
    Row(Option<usize>),
}

struct Reader {
    frame: Frame,
    place: Place,
    /// The exponent in force.
    exponent: i32,
    started: u64,
    time: Option<GpsTime>,
    tec_tecu: Vec<f64>,
    /// Longitudes read of the present parallel.
    in_row: usize,
    /// Values read of the present map, missing ones too.
    in_map: usize,
    maps: Vec<IonosphereMap>,
    skips: Skips,
}

impl Reader {
    fn new(frame: Frame) -> Self {
        let exponent = frame.exponent;
        Self {
            frame,
            place: Place::Between,
            exponent,
            started: 0,
            time: None,
            tec_tecu: Vec::new(),
            in_row: 0,
            in_map: 0,
            maps: Vec::new(),
            skips: Skips::default(),
        }
    }

    fn line(&mut self, number: u64, line: &[u8]) {
        // Values reach to column 80; labels are words.
        match label(line) {
            b"START OF TEC MAP" => self.start(number),
            b"START OF RMS MAP" | b"START OF HEIGHT MAP" | b"START OF AUX DATA" => {
                self.finish(number);
                self.place = Place::Other;
            }
            b"END OF TEC MAP" => self.end(number),
            b"END OF RMS MAP" | b"END OF HEIGHT MAP" | b"END OF AUX DATA" | b"END OF FILE" => {
                self.finish(number);
                self.place = Place::Between;
            }
            _ if self.place == Place::Other => {}
            b"EPOCH OF CURRENT MAP" => self.time = epoch(line),
            b"EXPONENT" => self.exponent = exponent(line).unwrap_or(self.frame.exponent),
            b"LAT/LON1/LON2/DLON/H" => self.row(number, line),
            b"COMMENT" => {}
            _ => {
                if let Place::Row(row) = self.place {
                    self.values(number, line, row);
                }
            }
        }
    }

    fn start(&mut self, number: u64) {
        self.finish(number);
        self.place = Place::Map;
        self.started = number;
        self.time = None;
        self.exponent = self.frame.exponent;
        self.in_map = 0;
        self.tec_tecu.clear();
        self.tec_tecu.resize(self.frame.nodes(), f64::NAN);
    }

    fn row(&mut self, number: u64, line: &[u8]) {
        if self.place == Place::Between {
            return;
        }
        let at = |k: usize| real(columns(line, 2 + 6 * k, 8 + 6 * k));
        let longitudes = at(1).zip(at(2)).zip(at(3)).and_then(|((a, b), c)| Axis::from_degrees([a, b, c]));
        let row = at(0).and_then(|latitude_deg| self.frame.latitudes.index_of_degrees(latitude_deg));
        let row = row.filter(|_| longitudes == Some(self.frame.longitudes));
        if row.is_none() {
            self.skips.add(Reason::IonexRowOffGrid, || format!("line {number}: '{}'", shorten(line)));
        }
        self.in_row = 0;
        self.place = Place::Row(row);
    }

    fn values(&mut self, number: u64, line: &[u8], row: Option<usize>) {
        let Some(row) = row else { return };
        let width = self.frame.longitudes.count();
        let scale = 10_f64.powi(self.exponent);
        for k in 0..VALUES_PER_LINE.min(width - self.in_row.min(width)) {
            let field = columns(line, 5 * k, 5 * k + 5);
            let value = integer(field);
            if value.is_none() {
                self.skips.add(Reason::IonexValueUnreadable, || {
                    format!("line {number}, value {}: '{}'", k + 1, text(field))
                });
            }
            let node = self.tec_tecu.get_mut(row * width + self.in_row);
            if let (Some(node), Some(value)) = (node, value.filter(|value| *value != MISSING)) {
                let tec_tecu = value as f64 * scale;
                if tec_tecu.abs() <= MAX_TEC_TECU {
                    *node = tec_tecu;
                } else {
                    self.skips.add(Reason::IonexValueImpossiblyLarge, || {
                        format!(
                            "line {number}, value {}: {tec_tecu} TECU; the limit is {MAX_TEC_TECU} TECU",
                            k + 1
                        )
                    });
                }
            }
            self.in_row += 1;
            self.in_map += usize::from(value.is_some());
        }
    }

    /// A map that comes to its end.
    fn end(&mut self, number: u64) {
        if matches!(self.place, Place::Between | Place::Other) {
            return;
        }
        self.place = Place::Between;
        if 2 * self.in_map < self.frame.nodes() {
            let (found, nodes) = (self.in_map, self.frame.nodes());
            self.skips.add(Reason::IonexMapHalfEmpty, || format!("line {number}: {found} of {nodes}"));
            return;
        }
        let Some(time) = self.time.take() else {
            self.skips.add(Reason::IonexMapWithoutEpoch, || format!("line {number}"));
            return;
        };
        let tec_tecu = std::mem::take(&mut self.tec_tecu);
        let Frame { shell, latitudes, longitudes, .. } = self.frame;
        self.maps.push(IonosphereMap::new(time, shell, (latitudes, longitudes), tec_tecu));
    }

    /// Notes a map whose end is missing.
    fn finish(&mut self, number: u64) {
        if !matches!(self.place, Place::Between | Place::Other) {
            let started = self.started;
            self.skips.add(Reason::IonexMapWithoutEnd, || {
                format!("begun in line {started}, not ended before line {number}")
            });
            self.place = Place::Between;
        }
    }
}

/// Epochs are in UT; a leap second moves the sun by less than a map's digit.
fn epoch(line: &[u8]) -> Option<GpsTime> {
    let at = |k: usize| integer(columns(line, 6 * k, 6 * k + 6));
    let small = |k: usize| at(k).and_then(|v| u32::try_from(v).ok());
    let year = i32::try_from(at(0)?).ok()?;
    // Hour 24 of a day is hour 0 of the next.
    let (hour, next_s) = match small(3)? {
        24 => (0, 86_400.0),
        hour => (hour, 0.0),
    };
    let second = f64::from(small(5)?);
    let calendar = Calendar { year, month: small(1)?, day: small(2)?, hour, minute: small(4)?, second };
    let utc = GpsTime::from_calendar(calendar)? + next_s;
    Some(utc + leap_seconds_at(utc) as f64)
}

#[cfg(test)]
mod tests;
