//! Messages 1007, 1008 and 1033: antenna and receiver of the reference station (RTCM 10403.3, tables 3.5-8, 3.5-9 and 3.5-33).

use crate::formats::bits::{Bits, TooShort};
use crate::formats::rinex::Equipment;

/// Decodes message 1007, 1008 or 1033.
pub(super) fn decode(bytes: &[u8], number: u32) -> Result<Equipment, TooShort> {
    let mut bits = Bits::new(bytes);
    bits.skip(12 + 12); // message number, station
    let mut equipment = Equipment { antenna_type: text(&mut bits)?, ..Equipment::default() };
    bits.skip(8); // set-up of the antenna
    if number != 1007 {
        equipment.antenna_number = text(&mut bits)?;
    }
    if number == 1033 {
        equipment.receiver_type = text(&mut bits)?;
        equipment.receiver_version = text(&mut bits)?;
        equipment.receiver_number = text(&mut bits)?;
    }
    Ok(equipment)
}

/// A text with the number of its characters before it. What is no printable character becomes a question mark.
fn text(bits: &mut Bits<'_>) -> Result<String, TooShort> {
    let count = bits.unsigned(8)?;
    let mut text = String::new();
    for _ in 0..count {
        let byte = u8::try_from(bits.unsigned(8)?).unwrap_or(b'?');
        let is_printable = byte == b' ' || byte.is_ascii_graphic();
        text.push(if is_printable { char::from(byte) } else { '?' });
    }
    Ok(text.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twelve bits of number and of station, then texts by `texts` with a byte of set-up after the first.
    fn message(number: u16, texts: &[&[u8]]) -> Vec<u8> {
        let [high, low] = (number << 4).to_be_bytes();
        let mut bytes = vec![high, low, 7];
        for (index, text) in texts.iter().enumerate() {
            bytes.push(u8::try_from(text.len()).unwrap());
            bytes.extend_from_slice(text);
            if index == 0 {
                bytes.push(0);
            }
        }
        bytes
    }

    #[test]
    fn antenna_and_receiver_are_read() {
        let all = message(1033, &[b"ANT TYPE  NONE", b"4711", b"RECEIVER 9", b"5.44\x01", b""]);
        let found = decode(&all, 1033).unwrap();
        assert_eq!((found.antenna_type.as_str(), found.antenna_number.as_str()), ("ANT TYPE  NONE", "4711"));
        assert_eq!((found.receiver_type.as_str(), found.receiver_version.as_str()), ("RECEIVER 9", "5.44?"));
        assert!(found.receiver_number.is_empty());
        let antenna = decode(&message(1007, &[b"A"]), 1007).unwrap();
        assert_eq!(antenna, Equipment { antenna_type: "A".to_owned(), ..Equipment::default() });
        assert_eq!(decode(&message(1008, &[b"A", b"12"]), 1008).unwrap().antenna_number, "12");
        for cut in 0..all.len() {
            assert_eq!(decode(&all[..cut], 1033), Err(TooShort), "{cut}");
        }
    }
}
