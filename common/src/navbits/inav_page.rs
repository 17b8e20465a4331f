//! Pages of Galileo I/NAV: two halves of 114 bits, and the data word of 128 bits in them (Galileo OS SIS ICD 2.1, 4.3.2).

use super::bits::{copy, crc24q, unsigned};
use super::{ReceiverCheck, Refused, refused};

/// Bytes of a page as Android gives it: 228 bits, even half first.
pub(super) const PAGE_BYTES: usize = 29;
/// Bits of a half.
const HALF: usize = 114;
/// Bits under the CRC: the even half, and the odd one up to the CRC.
const CHECKED: usize = 196;

/// The data word of a page.
pub(super) type Word = [u8; 16];

/// The data word of a page; `None` of an alert page, which has none.
pub(super) fn word(bytes: &[u8], receiver: ReceiverCheck) -> Result<Option<Word>, Refused> {
    if bytes.len() != PAGE_BYTES {
        let detail = format!("{} bytes, {PAGE_BYTES} expected", bytes.len());
        return Err(refused("I/NAV page of wrong length", detail));
    }
    if unsigned(bytes, 0, 1) != 0 || unsigned(bytes, HALF, 1) != 1 {
        return Err(refused("I/NAV page whose halves are not even and odd", format!("{bytes:02x?}")));
    }
    let sent = unsigned(bytes, CHECKED, 24);
    let blanked = sent == 0 && receiver == ReceiverCheck::Passed;
    if u64::from(crc24q(bytes, CHECKED)) != sent && !blanked {
        return Err(refused("I/NAV page with wrong CRC", format!("{bytes:02x?}")));
    }
    if unsigned(bytes, 1, 1) != 0 || unsigned(bytes, HALF + 1, 1) != 0 {
        return Ok(None);
    }
    let mut word = Word::default();
    copy(bytes, 2, &mut word, 0, 112);
    copy(bytes, HALF + 2, &mut word, 112, 16);
    Ok(Some(word))
}
