//! Values and text as differences from their predecessors (Hatanaka 2008).

use crate::skips::Reason;

/// Highest order of differences that is read; writers use three.
const MAX_ORDER: usize = 9;
/// Numbers as F14.3 holds them, in thousandths.
const BOUNDS: (i64, i64) = (-999_999_999_999, 9_999_999_999_999);

/// One type of value of one satellite in time: differences of order 0 (the value itself) upwards.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Arc {
    differences: [i64; MAX_ORDER + 1],
    order: usize,
    /// Values so far, up to `order`; 0 without an arc.
    known: usize,
}

impl Arc {
    /// Takes a field and gives the value; `None` for an empty field, which ends the arc.
    ///
    /// # Errors
    /// The reason, when the value cannot be restored; the arc is over then.
    pub(super) fn restore(&mut self, field: &[u8]) -> Result<Option<i64>, Reason> {
        if field.is_empty() {
            self.known = 0;
            return Ok(None);
        }
        let value = self.next(field);
        if value.is_err() {
            self.known = 0;
        }
        value.map(Some)
    }

    fn next(&mut self, field: &[u8]) -> Result<i64, Reason> {
        if let [order @ b'0'..=b'9', b'&', first @ ..] = field {
            let value = number(first)?;
            *self = Self { order: usize::from(order - b'0'), known: 1, ..Self::default() };
            self.differences[0] = value;
            return within(value);
        }
        let difference = number(field)?;
        if self.known == 0 {
            return Err(Reason::HatanakaDifferenceWithoutArc);
        }
        // The highest difference is in the file; each lower one grows by the next higher.
        let highest = self.known.min(self.order);
        let mut sum = 0_i64;
        for (index, slot) in self.differences.iter_mut().enumerate().take(highest + 1).rev() {
            sum = if index == highest {
                difference
            } else {
                slot.checked_add(sum).ok_or(Reason::HatanakaValueUnreadable)?
            };
            *slot = sum;
        }
        self.known = (self.known + 1).min(self.order.max(1));
        within(sum)
    }
}

fn within(value: i64) -> Result<i64, Reason> {
    let (low, high) = BOUNDS;
    if (low..=high).contains(&value) { Ok(value) } else { Err(Reason::HatanakaValueUnreadable) }
}

fn number(field: &[u8]) -> Result<i64, Reason> {
    let digits = field.strip_prefix(b"-").unwrap_or(field);
    if digits.is_empty() || !digits.iter().all(u8::is_ascii_digit) {
        return Err(Reason::HatanakaValueUnreadable);
    }
    std::str::from_utf8(field).ok().and_then(|text| text.parse().ok()).ok_or(Reason::HatanakaValueUnreadable)
}

/// Applies a difference of text: a blank keeps the character, `&` makes it a blank, any other character replaces it.
pub(super) fn change_text(text: &mut Vec<u8>, difference: &[u8]) {
    if text.len() < difference.len() {
        text.resize(difference.len(), b' ');
    }
    for (old, new) in text.iter_mut().zip(difference) {
        match new {
            b' ' => {}
            b'&' => *old = b' ',
            other => *old = *other,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skips::Reason;

    #[test]
    fn third_differences_restore_cubes() {
        // 1, 8, 27, 64, 125, 216: first value, then differences of first, second and third order.
        let mut arc = Arc::default();
        let fields: [&[u8]; 6] = [b"3&1", b"7", b"12", b"6", b"6", b"6"];
        let values = fields.map(|field| arc.restore(field).unwrap().unwrap());
        assert_eq!(values, [1, 8, 27, 64, 125, 216]);
    }

    #[test]
    fn orders_down_to_zero() {
        let restore = |fields: [&[u8]; 3]| {
            let mut arc = Arc::default();
            fields.map(|field| arc.restore(field).unwrap().unwrap())
        };
        assert_eq!(restore([b"0&5", b"7", b"-3"]), [5, 7, -3]);
        assert_eq!(restore([b"1&5", b"7", b"-3"]), [5, 12, 9]);
    }

    #[test]
    fn an_arc_ends_with_a_gap_and_with_damage() {
        let mut arc = Arc::default();
        assert_eq!(arc.restore(b"5"), Err(Reason::HatanakaDifferenceWithoutArc));
        assert_eq!(arc.restore(b"3&10"), Ok(Some(10)));
        assert_eq!(arc.restore(b""), Ok(None));
        assert_eq!(arc.restore(b"5"), Err(Reason::HatanakaDifferenceWithoutArc));
        assert_eq!(arc.restore(b"3&10"), Ok(Some(10)));
        assert_eq!(arc.restore(b"1x"), Err(Reason::HatanakaValueUnreadable));
        assert_eq!(arc.restore(b"5"), Err(Reason::HatanakaDifferenceWithoutArc));
        assert_eq!(arc.restore(b"3&9223372036854775807"), Err(Reason::HatanakaValueUnreadable));
        assert_eq!(arc.restore(b"3&1"), Ok(Some(1)));
        assert_eq!(arc.restore(b"9223372036854775807"), Err(Reason::HatanakaValueUnreadable));
    }

    #[test]
    fn text_changes_by_character() {
        let mut text = b"> 2010 10 24".to_vec();
        change_text(&mut text, b"           5&x");
        assert_eq!(text, b"> 2010 10 25 x");
    }
}
