//! Files packed with `compress` (.Z), as older archives have them: LZW with codes of 9 to 16 bits (Welch 1984).
//!
//! Codes stand lowest bit first, in groups of eight: when their width changes, or after the code that empties the table,
//! the rest of a group is padding. Code 256 empties the table; the first own code is 257 (256 in old files that lack it).

use std::io::{self, Read};

/// The first two bytes of such a file.
pub(super) const COMPRESS_MAGIC: [u8; 2] = [0x1f, 0x9d];

const FIRST_BITS: u32 = 9;
const LAST_BITS: u32 = 16;
const CODES_PER_GROUP: u32 = 8;
const LITERALS: usize = 256;
const CLEAR: u16 = 256;
/// Flags of the third byte.
const WIDTH_MASK: u8 = 0x1f;
const BLOCK_MODE: u8 = 0x80;

/// Expands data packed by `compress`, in bounded memory.
#[derive(Debug)]
pub(super) struct UnixCompress<R> {
    inner: R,
    /// Widest codes, bits; 0 before the head of the file is read.
    widest: u32,
    clears: bool,
    width: u32,
    group: [u8; LAST_BITS as usize],
    group_bits: u32,
    at_bit: u32,
    /// Of each own code: the code of all bytes but the last, and the last.
    table: Vec<(u16, u8)>,
    previous: Option<u16>,
    /// Expanded bytes of one code, last first.
    expanded: Vec<u8>,
    /// Damage at which expansion ended.
    damage: Option<String>,
}

impl<R: Read> UnixCompress<R> {
    /// Reads from the beginning of the file. Reads are small: give it a buffered reader.
    pub(super) fn new(inner: R) -> Self {
        Self {
            inner,
            widest: 0,
            clears: false,
            width: FIRST_BITS,
            group: [0; LAST_BITS as usize],
            group_bits: 0,
            at_bit: 0,
            table: Vec::new(),
            previous: None,
            expanded: Vec::new(),
            damage: None,
        }
    }

    fn head(&mut self) -> io::Result<()> {
        let mut head = [0; 3];
        self.inner.read_exact(&mut head)?;
        let [first, second, flags] = head;
        let widest = u32::from(flags & WIDTH_MASK);
        if [first, second] != COMPRESS_MAGIC || !(FIRST_BITS..=LAST_BITS).contains(&widest) {
            return Err(damaged(&format!("first bytes {head:02x?}")));
        }
        self.clears = flags & BLOCK_MODE != 0;
        self.widest = widest;
        Ok(())
    }

    /// The code that the next table entry will have.
    fn next_own(&self) -> usize {
        LITERALS + usize::from(self.clears) + self.table.len()
    }

    /// The next code; `None` at the end.
    fn code(&mut self) -> io::Result<Option<u16>> {
        if self.next_own() == 1 << self.width && self.width < self.widest {
            self.width += 1;
            self.group_bits = 0;
            self.at_bit = 0;
        }
        if self.at_bit + self.width > self.group_bits {
            self.next_group()?;
        }
        if self.at_bit + self.width > self.group_bits {
            return Ok(None);
        }
        let mut code = 0_u32;
        for (index, byte) in (0..).zip(self.group.iter().skip(self.at_bit as usize / 8).take(3)) {
            code |= u32::from(*byte) << (8 * index);
        }
        let code = code >> (self.at_bit % 8) & ((1 << self.width) - 1);
        self.at_bit += self.width;
        Ok(u16::try_from(code).ok())
    }

    fn next_group(&mut self) -> io::Result<()> {
        let (mut wanted, mut filled) = (self.group.get_mut(..self.width as usize).unwrap_or_default(), 0);
        while !wanted.is_empty() {
            match self.inner.read(wanted) {
                Ok(0) => break,
                Ok(count) => {
                    filled += count;
                    wanted = wanted.get_mut(count..).unwrap_or_default();
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        self.group_bits = CODES_PER_GROUP * u32::try_from(filled).unwrap_or(0);
        self.at_bit = 0;
        Ok(())
    }

    /// Expands one code; false at the end.
    fn step(&mut self) -> io::Result<bool> {
        let Some(code) = self.code()? else { return Ok(false) };
        if code == CLEAR && self.clears {
            self.table.clear();
            self.previous = None;
            self.width = FIRST_BITS;
            self.group_bits = 0;
            self.at_bit = 0;
            return Ok(true);
        }
        // A code may be the one that this very step defines: the bytes before, and their first once more.
        let is_new = usize::from(code) == self.next_own();
        match self.previous {
            Some(previous) if is_new => {
                self.expand(previous)?;
                let first = self.expanded.last().copied().unwrap_or(0);
                self.expanded.insert(0, first);
            }
            _ => self.expand(code)?,
        }
        if let (Some(previous), Some(first)) = (self.previous, self.expanded.last())
            && self.next_own() < 1 << self.widest
        {
            self.table.push((previous, *first));
        }
        self.previous = Some(code);
        Ok(true)
    }

    /// The bytes of a code, last first.
    fn expand(&mut self, mut code: u16) -> io::Result<()> {
        while usize::from(code) >= LITERALS {
            let own = usize::from(code).checked_sub(LITERALS + usize::from(self.clears));
            let entry = own.and_then(|index| self.table.get(index)).copied();
            let Some((before, last)) = entry else {
                return Err(damaged(&format!("code {code} before it is defined")));
            };
            self.expanded.push(last);
            code = before;
        }
        self.expanded.push(u8::try_from(code).unwrap_or(0));
        Ok(())
    }
}

impl<R: Read> Read for UnixCompress<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if let Some(damage) = &self.damage {
            return Err(damaged(damage));
        }
        if self.widest == 0 {
            self.head()?;
        }
        let mut count = 0;
        for slot in buffer {
            while self.expanded.is_empty() {
                match self.step() {
                    Ok(true) => {}
                    Ok(false) => return Ok(count),
                    Err(error) => {
                        self.expanded.clear();
                        self.damage = Some(error.to_string());
                        // Bytes before the damage are given first.
                        return if count > 0 { Ok(count) } else { Err(error) };
                    }
                }
            }
            *slot = self.expanded.pop().unwrap_or(0);
            count += 1;
        }
        Ok(count)
    }
}

fn damaged(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::HashMap;

    /// Packs as `compress` does; `clear_every` so many codes empties the table.
    struct Packer {
        out: Vec<u8>,
        bits: u32,
        buffer: u64,
        width: u32,
        in_group: u32,
        widest: u32,
        clears: bool,
    }

    impl Packer {
        fn new(widest: u32, clears: bool) -> Self {
            let flags = u8::try_from(widest).unwrap() | if clears { BLOCK_MODE } else { 0 };
            let out = [&COMPRESS_MAGIC[..], &[flags]].concat();
            Self { out, bits: 0, buffer: 0, width: FIRST_BITS, in_group: 0, widest, clears }
        }

        fn put(&mut self, code: u32) {
            self.buffer |= u64::from(code) << self.bits;
            self.bits += self.width;
            while self.bits >= 8 {
                self.out.push(self.buffer.to_le_bytes()[0]);
                self.buffer >>= 8;
                self.bits -= 8;
            }
            self.in_group = (self.in_group + 1) % CODES_PER_GROUP;
        }

        fn pad_group(&mut self) {
            while self.in_group != 0 {
                self.put(0);
            }
        }

        fn pack(mut self, text: &[u8], clear_every: usize) -> Vec<u8> {
            let first_own = 256 + u32::from(self.clears);
            let (mut table, mut next, mut codes) = (HashMap::<(u32, u8), u32>::new(), first_own, 0_usize);
            let mut rest = text.iter();
            let Some(first) = rest.next() else { return self.out };
            let mut code = u32::from(*first);
            for byte in rest {
                if let Some(known) = table.get(&(code, *byte)) {
                    code = *known;
                    continue;
                }
                self.put(code);
                codes += 1;
                // The reader defines a code one step later than the writer.
                if next == 1 << self.width && self.width < self.widest {
                    self.pad_group();
                    self.width += 1;
                }
                if self.clears && codes % clear_every == 0 {
                    self.put(u32::from(CLEAR));
                    self.pad_group();
                    (self.width, next) = (FIRST_BITS, first_own);
                    table.clear();
                } else if next < 1 << self.widest {
                    table.insert((code, *byte), next);
                    next += 1;
                }
                code = u32::from(*byte);
            }
            self.put(code);
            while self.bits > 0 {
                self.out.push(self.buffer.to_le_bytes()[0]);
                self.buffer >>= 8;
                self.bits = self.bits.saturating_sub(8);
            }
            self.out
        }
    }

    fn expand(packed: &[u8]) -> io::Result<Vec<u8>> {
        let mut out = Vec::new();
        UnixCompress::new(packed).read_to_end(&mut out).map(|_| out)
    }

    /// Text with enough variety to need wide codes.
    fn long_text() -> Vec<u8> {
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            b"0123456789. \n"[(state >> 24) as usize % 13]
        };
        (0..600_000).map(|_| next()).collect()
    }

    #[test]
    fn an_example_of_the_manual_kind() {
        // "aaaa": a, then the code that this defines, then a. Nine bits each: 97, 257, 97.
        let packed = [0x1f, 0x9d, 0x90, 97, 0b0000_0010, 0b1000_0110, 0b0000_0001];
        assert_eq!(expand(&packed).unwrap(), b"aaaa");
        assert_eq!(expand(&[0x1f, 0x9d, 0x90]).unwrap(), b"");
    }

    #[test]
    fn all_widths_and_both_modes_come_back() {
        let text = long_text();
        for (widest, clears) in [(9, true), (12, true), (16, true), (16, false), (10, false)] {
            let packed = Packer::new(widest, clears).pack(&text, 70_001);
            assert!(packed.len() < text.len(), "{widest}");
            assert!(expand(&packed).unwrap() == text, "{widest} {clears}");
        }
        assert!(expand(&Packer::new(16, true).pack(&text, 777)).unwrap() == text);
    }

    #[test]
    fn damage_ends_it_for_good() {
        for packed in [&[0x1f, 0x9d][..], &[0x1f, 0x9d, 0x88, 1, 2], &[0x1f, 0x9d, 0x91, 1, 2]] {
            assert!(expand(packed).is_err(), "{packed:?}");
        }
        // A literal, then a code far beyond what is defined.
        let mut reader = UnixCompress::new(&[0x1f, 0x9d, 0x90, 97, 0xfe, 0x03, 0, 0, 0, 0, 0, 0][..]);
        let mut buffer = [0; 10];
        assert_eq!(reader.read(&mut buffer).unwrap(), 1);
        assert_eq!(buffer[0], b'a');
        for _ in 0..2 {
            assert!(reader.read(&mut buffer).unwrap_err().to_string().contains("before it is defined"));
        }
    }

    proptest! {
        #[test]
        fn any_bytes_come_back(text in proptest::collection::vec(0..4_u8, 0..3000), clear in 1..600_usize) {
            prop_assert_eq!(expand(&Packer::new(16, true).pack(&text, clear)).unwrap(), text);
        }

        #[test]
        fn noise_never_panics(noise in proptest::collection::vec(any::<u8>(), 0..500), flags in any::<u8>()) {
            let _ = expand(&[&[0x1f, 0x9d, flags][..], &noise].concat());
        }
    }
}
