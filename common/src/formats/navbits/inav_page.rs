//! Pages of Galileo I/NAV: two halves of 114 bits, and the data word of 128 bits in them (Galileo OS SIS ICD 2.1, 4.3.2).

use super::{ReceiverCheck, Refused, refused};
use crate::formats::bits::{copy, crc24q_of_bits, invert, unsigned};
use crate::skips::Reason;

/// Bytes of a page as Android gives it: 228 bits, even half first.
pub(super) const PAGE_BYTES: usize = 29;
/// Bits of a half.
const HALF: usize = 114;
/// Bits under the CRC: the even half, and the odd one up to the CRC.
const CHECKED: usize = 196;

/// The data word of a page.
pub(super) type Word = [u8; 16];

/// A page.
type Page = [u8; PAGE_BYTES];

/// The data word of a page; `None` of an alert page, which has none. Each half has its own synchronisation, and so may be turned
/// over by itself where the receiver is locked half a cycle off; its first bit, 0 of the even half and 1 of the odd one, tells.
pub(super) fn word(bytes: &[u8], receiver: ReceiverCheck) -> Result<Option<Word>, Refused> {
    let Ok(received) = Page::try_from(bytes) else {
        let detail = format!("{} bytes, {PAGE_BYTES} expected", bytes.len());
        return Err(refused(Reason::INavPageWrongLength, detail));
    };
    let page = upright(received);
    let sent = unsigned(&page, CHECKED, 24);
    let blanked = sent == 0 && receiver == ReceiverCheck::Passed && page == received;
    if u64::from(crc24q_of_bits(&page, CHECKED)) != sent && !blanked {
        let reason = if page == received { Reason::INavPageWrongCrc } else { Reason::INavPageHalvesWrong };
        return Err(refused(reason, format!("{bytes:02x?}")));
    }
    if unsigned(&page, 1, 1) != 0 || unsigned(&page, HALF + 1, 1) != 0 {
        return Ok(None);
    }
    let mut word = Word::default();
    copy(&page, 2, &mut word, 0, 112);
    copy(&page, HALF + 2, &mut word, 112, 16);
    Ok(Some(word))
}

/// The page with its halves as sent, the even one in front.
fn upright(mut page: Page) -> Page {
    for (start, is_odd) in [(0, 0), (HALF, 1)] {
        if unsigned(&page, start, 1) != is_odd {
            invert(&mut page, start, HALF);
        }
    }
    page
}
